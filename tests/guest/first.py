"""The guest's first process, until systemd takes over: `python first.py FOLDER`.

The guest sees the host's files read-only, below a layer in memory that takes all writes. So the guest has a complete
system, /etc and /opt included, and the host stays unchanged. FOLDER is the one place shared with the host: its
`job.json` is the job, `status` is the answer; it is /mnt in the guest.
"""

import ctypes
import json
import os
import shutil
import sys
from pathlib import Path

LIBC = ctypes.CDLL(None, use_errno=True)
FINIT_MODULE = 313  #: the system call, on x86_64
MS_MOVE = 0x2000
UNITS = Path("/etc/systemd/system")
#: Units systemd would start first; a guest without disks, clocks and networks needs none of them.
EARLY = ("sysinit.target.wants", "sockets.target.wants", "local-fs.target.wants", "timers.target.wants")
#: The ones it does need: the log for `journalctl`.
KEPT = ("systemd-journald.service", "systemd-journald.socket")

TARGET = """\
[Unit]
Requires=basic.target
After=basic.target
Wants=guest-job.service
AllowIsolate=yes
"""
JOB = """\
[Unit]
SuccessAction=poweroff-force
FailureAction=poweroff-force

[Service]
Type=oneshot
WorkingDirectory={checkout}
Environment=PATH={path} PYTHONDONTWRITEBYTECODE=1 LANG=C.UTF-8 HOME=/root {variables}
ExecStart={command}
ExecStopPost=/bin/sh -c 'echo $EXIT_STATUS >/mnt/status'
StandardOutput=tty
StandardError=tty
TTYPath=/dev/console
TimeoutStartSec=infinity
"""


def mount(kind: str, place: Path | str, options: str = "", *, source: str = "none", flags: int = 0) -> None:
    done = LIBC.mount(source.encode(), str(place).encode(), kind.encode() or None, flags, options.encode() or None)
    if done:
        raise OSError(ctypes.get_errno(), f"mount {kind} {place}")


def load(module: str) -> None:
    with Path(module).open("rb") as file:
        if LIBC.syscall(FINIT_MODULE, file.fileno(), b"", 0):
            raise OSError(ctypes.get_errno(), f"load {module}")


def lay_over() -> None:
    """Make the writable layer the root."""
    layer = Path("/run")
    mount("tmpfs", layer)
    for name in ("upper", "work", "root"):
        (layer / name).mkdir()
    mount("overlay", layer / "root", "lowerdir=/,upperdir=/run/upper,workdir=/run/work")
    os.chdir(layer / "root")
    mount("", "/", source=".", flags=MS_MOVE)
    os.chroot(".")
    os.chdir("/")


def write_units(job: dict[str, str]) -> None:
    """Start none of the host's services: only ours, and what systemd itself needs."""
    shutil.rmtree(UNITS)
    UNITS.mkdir()
    for folder in EARLY:
        for unit in Path("/lib/systemd/system", folder).glob("*.*"):
            if unit.name not in KEPT and unit.suffix != ".target":
                (UNITS / unit.name).symlink_to("/dev/null")
    for name in ("tmp.mount", "systemd-remount-fs.service"):
        (UNITS / name).unlink(missing_ok=True)
        (UNITS / name).symlink_to("/dev/null")
    Path("/etc/fstab").write_text("", encoding="ascii")
    (UNITS / "default.target").write_text(TARGET, encoding="utf-8")
    (UNITS / "guest-job.service").write_text(JOB.format(path=os.environ["PATH"], **job), encoding="utf-8")


def main(folder: str) -> None:
    os.environ["PATH"] = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
    job = json.loads(Path(folder, "job.json").read_text(encoding="utf-8"))
    overlay, *modules = job.pop("modules")
    load(overlay)
    lay_over()
    for module in modules:
        load(module)
    mount("hostfs", "/mnt", folder)
    write_units(job)
    os.execv("/lib/systemd/systemd", ["/lib/systemd/systemd", "--log-target=kmsg", "--show-status=no"])


if __name__ == "__main__":
    main(sys.argv[1])
