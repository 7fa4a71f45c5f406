"""Who holds a serial port, by the kernel's own lists: so `estop` finds the service that must be told of a stop.

A service's port is locked (flock). /proc/locks names the process, and /proc/net/unix the socket on which it listens.
Both need what talking to it needs, too: to be its owner, or root.
"""

import os
from pathlib import Path

LISTENS = "00010000"  #: __SO_ACCEPTCON among the flags in /proc/net/unix


def control_socket(port: str) -> str:
    """The control socket of the service that holds this port; "" where none does, or where that cannot be told."""
    try:
        at = Path(port).stat()
        place = f"{os.major(at.st_dev):02x}:{os.minor(at.st_dev):02x}:{at.st_ino}"
        return next(filter(None, map(_listens_on, _lockers(place))), "")
    except OSError:
        return ""  # the process has just ended, or is none of ours


def _lockers(place: str) -> list[str]:
    """The processes that have locked this file: "1: FLOCK ADVISORY WRITE 4711 00:05:99 0 EOF"."""
    with Path("/proc/locks").open(encoding="ascii") as locks:
        lines = [line.split() for line in locks]
    return [words[4] for words in lines if words[1] == "FLOCK" and words[5] == place]


def _listens_on(pid: str) -> str:
    """The Unix socket on which a process listens, "" if on none."""
    process = Path("/proc", pid)
    files = {str(fd.readlink()) for fd in (process / "fd").iterdir()}
    with Path("/proc/net/unix").open(encoding="utf-8", errors="surrogateescape") as sockets:
        for line in sockets:
            words = line.rstrip("\n").split(None, 7)  # Num RefCount Protocol Flags Type St Inode Path
            if len(words) == 8 and words[3] == LISTENS and f"socket:[{words[6]}]" in files:
                return str((process / "cwd").readlink() / words[7])
    return ""
