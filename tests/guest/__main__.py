"""Run tests in a guest with a real SocketCAN and with systemd: `python -m tests.guest [PYTEST'S ARGUMENTS]`.

The guest is a User Mode Linux: it needs no privileges and no virtual machine, sees this machine's files and keeps its
own writes to itself. Timing inside is coarse: nothing below 50 ms means anything.
"""

import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.guest.kernel import CACHE, Kernel, MissingError, find

ROOT = Path(__file__).resolve().parent.parent.parent
OUT = ROOT / "run" / "guest"
#: Installed in the guest, which has no network, by the system's own Python, as a technician would.
WHEELS = CACHE / "wheels"
PYTHON = "/usr/bin/python3"
LIST = ROOT / "requirements" / "runtime.txt"
#: A guest still running by then hangs; where a test hangs is shown by pytest's own time-out.
LIMIT_S = 2400
MEMORY = "1G"
PYTEST = ("-m", "pytest", "-p", "no:cacheprovider", "--color=no", "--timeout=300", "-v")
#: The guest gave no answer.
NOTHING = 125


def boot(kernel: Kernel, command: Sequence[str], out: Path) -> int:
    """Run a command as root in a fresh guest; returns its exit status, or NOTHING without one."""
    out.mkdir(parents=True, exist_ok=True)
    status = out / "status"
    status.unlink(missing_ok=True)
    job = {
        "modules": [str(module) for module in kernel.modules],
        "checkout": str(ROOT),
        "command": shlex.join(command),
        "variables": f"GUEST=/mnt PIP_NO_INDEX=1 PIP_CONFIG_FILE=/dev/null PIP_FIND_LINKS={WHEELS}",
    }
    (out / "job.json").write_text(json.dumps(job), encoding="utf-8")
    with tempfile.TemporaryDirectory(prefix="guest-") as scratch:
        words = [str(kernel.program), f"mem={MEMORY}", "quiet", "loglevel=3", f"uml_dir={scratch}/", "umid=guest"]
        words += ["root=/dev/root", "rootfstype=hostfs", "rootflags=/", "ro", "con=null", "con0=null,fd:1"]
        words += [f"init={sys.executable}", "--", str(Path(__file__).with_name("first.py")), str(out)]
        environment = {**os.environ, "TMPDIR": scratch, "LD_PRELOAD": str(kernel.preload or "")}
        with (out / "kernel.log").open("wb") as log:
            try:
                subprocess.run(
                    words, env=environment, stdin=subprocess.DEVNULL, stderr=log, timeout=LIMIT_S, check=False
                )
            except subprocess.TimeoutExpired:
                print(f"the guest was ended after {LIMIT_S} s", file=sys.stderr)
    return int(status.read_text()) if status.exists() else NOTHING


def fetch_wheels() -> None:
    """Download the locked libraries for the guest's Python, unless they are there."""
    marker = WHEELS / LIST.name
    if marker.exists() and marker.read_bytes() == LIST.read_bytes():
        return
    asked = subprocess.run(
        [PYTHON, "-c", "import ensurepip, venv, sys; print('%d.%d' % sys.version_info[:2])"],
        capture_output=True,
        text=True,
        check=False,
    )
    if asked.returncode:
        raise MissingError(f"{PYTHON} cannot make a virtual environment: sudo apt-get install python3-venv")
    words = ["--quiet", "--require-hashes", "--only-binary", ":all:", "--python-version", asked.stdout.strip()]
    command = [sys.executable, "-m", "pip", "download", *words, "--dest", str(WHEELS), "--requirement", str(LIST)]
    if subprocess.run(command, check=False).returncode:
        raise MissingError(f"pip cannot download what {LIST} names: is there a network?")
    marker.write_bytes(LIST.read_bytes())


def main(arguments: Sequence[str]) -> int:
    try:
        kernel = find()
        fetch_wheels()
    except MissingError as missing:
        print(f"make test-guest: {missing}", file=sys.stderr)
        return 2
    print(f"load of this machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors (above, times mean nothing)")
    chosen = arguments or [str(Path(__file__).parent)]
    return boot(kernel, [sys.executable, *PYTEST, *chosen], OUT)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
