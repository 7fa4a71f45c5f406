"""Run tests in a guest with a real SocketCAN and with systemd: `python -m tests.guest [PYTEST'S ARGUMENTS]`.

The guest is a User Mode Linux: no rights and no virtual machine are needed, it sees this machine's files and keeps its
own writing to itself. Timing inside is coarse: nothing below 50 ms means anything there.
"""

import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.guest.kernel import Kernel, MissingError, find

ROOT = Path(__file__).resolve().parent.parent.parent
OUT = ROOT / "run" / "guest"
#: A guest that has not ended by then hangs; what a test hangs in, pytest's own time-out shows.
LIMIT_S = 1500
MEMORY = "1G"
PYTEST = ("-m", "pytest", "-p", "no:cacheprovider", "--color=no", "--timeout=300", "-v")
#: The guest gave no answer.
NOTHING = 125


def boot(kernel: Kernel, command: Sequence[str], out: Path) -> int:
    """Run a command as root in a guest of its own; its exit status, NOTHING where it has none."""
    out.mkdir(parents=True, exist_ok=True)
    status = out / "status"
    status.unlink(missing_ok=True)
    job = {
        "modules": [str(module) for module in kernel.modules],
        "checkout": str(ROOT),
        "command": shlex.join(command),
        "variables": "GUEST=/mnt",
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


def main(arguments: Sequence[str]) -> int:
    try:
        kernel = find()
    except MissingError as missing:
        print(f"make test-guest: {missing}", file=sys.stderr)
        return 2
    chosen = arguments or [str(Path(__file__).parent)]
    return boot(kernel, [sys.executable, *PYTEST, *chosen], OUT)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
