"""Lints where a station keeps its socket and its journal: a look at the disk, as only `check` may take.

What is named may not be there yet, so each question is asked of the nearest directory above it that is.
"""

import os
import re
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path

from orchestrator.config.rules import Problems
from orchestrator.keys import Source

MOUNTS = Path("/proc/self/mounts")
#: File systems in memory.
VOLATILE = frozenset({"tmpfs", "ramfs", "devtmpfs"})
#: Directories that the shipped unit has systemd make (RuntimeDirectory, StateDirectory).
MADE = (Path("/run/orchestrator"), Path("/var/lib/orchestrator"))
#: Here, and in `/` itself, only root may create a directory, and the service is not root.
OF_ROOT, TOP = (Path("/etc"), Path("/run"), Path("/usr"), Path("/var")), Path("/")
JOURNAL = "journal.directory"
#: What to write instead, by key.
BETTER = {
    "control.socket": "/run/orchestrator/orchestrator.sock",
    JOURNAL: "/var/lib/orchestrator/journal",
}

_FORGETS = (
    "{directory} is in memory ({place}) and lost at each boot, with every latch and hold: write a directory on a disk, "
    "{better} for the installed service"
)
_HOMELESS = (
    "there is no {directory}, and the service may not create it in {above}: create it for the service's user, or write "
    "{better}, which the installed service has"
)


def disk_lint(values: Mapping[str, object], _written: Source) -> Problems:
    """Warnings about a journal in memory, and about directories that nobody makes."""
    socket, journal = values.get("control.socket"), values.get("journal.directory")
    if isinstance(journal, Path) and (place := in_memory(journal)):
        yield JOURNAL, _FORGETS.format(directory=journal, place=place, better=BETTER[JOURNAL])
    for key, directory in (("control.socket", socket.parent if isinstance(socket, Path) else None), (JOURNAL, journal)):
        if isinstance(directory, Path) and (above := unmakeable(directory)) is not None:
            yield key, _HOMELESS.format(directory=directory, above=above, better=BETTER[key])


def in_memory(directory: Path, mounts: Path = MOUNTS) -> str:
    """The file system in memory that the directory is on, as `tmpfs on /run`; "" if it is on a disk, or unknown."""
    place = _real(_there(directory))
    try:
        listed = [line.split() for line in mounts.read_text(encoding="utf-8", errors="replace").splitlines()]
    except OSError:
        return ""
    found = "", ""
    for _, point, kind, *_ in (words for words in listed if len(words) > 2):
        mounted = Path(re.sub(r"\\([0-7]{3})", lambda match: chr(int(match[1], 8)), point))
        # Of two on one point, the later one covers the other.
        if place.is_relative_to(mounted) and len(str(mounted)) >= len(found[0]):
            found = str(mounted), kind
    return f"{found[1]} on {found[0]}" if found[1] in VOLATILE else ""


def unmakeable(directory: Path) -> Path | None:
    """The existing directory in which the service cannot create this one; None if it can, or need not."""
    above = _there(directory)
    if above == directory or not above.is_dir() or any(_real(directory).is_relative_to(made) for made in MADE):
        return None
    if not os.access(above, os.W_OK | os.X_OK):
        return above
    everybody = above.stat().st_mode & stat.S_IWOTH
    is_roots = _real(above) == TOP or any(_real(above).is_relative_to(root) for root in OF_ROOT)
    return above if is_roots and not everybody else None


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _there(directory: Path) -> Path:
    return next(one for one in _up(directory) if os.path.lexists(one))


def _up(directory: Path) -> Iterator[Path]:
    yield directory
    yield from directory.parents
    yield Path()
