"""docs/install.md as a technician uses it: its commands, section by section."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PAGE = ROOT / "docs" / "install.md"
#: Commands the guest cannot run, and why; all others are run.
NOT_HERE = {
    "sudo apt-get": "there is no network",
    "sudo systemctl restart systemd-modules-load": "the guest's modules are loaded before it starts",
    "ls -l /dev/serial": "there are no USB adapters",
    "udevadm info": "there are no USB adapters",
    "sudo udevadm": "there is no udev",
    "ls -l /dev/charger": "no udev made the link",
    "sudo systemctl enable --now systemd-networkd": "the interface is a virtual one, and is up",
    "ip -details": "the interface is a virtual one, and is up",
    "sudo nano": "nobody is here to type",
    "sudo -E orchestrator status --watch": "it does not end",
    "journalctl": "it does not end",
}
SUDO = """\
#!/bin/sh
# What `sudo` is to root, in a guest that has none.
[ "$1" = -E ] && shift
[ "$1" = -u ] && exec runuser --user "$2" -- sh -c 'shift 2; exec "$@"' sh "$@"
exec "$@"
"""


def commands(section: str) -> list[str]:
    """The indented lines of this section that start with a command's name."""
    text = PAGE.read_text(encoding="utf-8")
    (part,) = re.findall(rf"^## {section}\. .*?(?=^## )", text, re.MULTILINE | re.DOTALL)
    lines = re.findall(r"^    ((?:sudo|orchestrator|systemctl|echo|\.) .*)$", part, re.MULTILINE)
    return [line for line in lines if not line.startswith(tuple(NOT_HERE))]


def drill() -> list[str]:
    """The commands in the table of section 8, each of which stops a charge."""
    return re.findall(r"^\| `(sudo [^`]*)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def provide_sudo() -> None:
    path = Path("/usr/local/bin/sudo")
    path.write_text(SUDO, encoding="ascii")
    path.chmod(0o755)


def run(command: str, timeout_s: float = 240.0) -> str:
    """Run it in the checkout; returns the output. AssertionError with the output if it fails."""
    done = subprocess.run(
        ["bash", "-c", command], cwd=ROOT, capture_output=True, text=True, timeout=timeout_s, check=False
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr
