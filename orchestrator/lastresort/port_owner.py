"""Finds out who else holds a serial port: an orchestrator, or a foreign program, which must not block a stop.

A port in use is locked (flock): /proc/locks names the locking process. If that list cannot be read, or the locker has
gone and left the open file to another process, the open files of all processes are searched. Only processes visible to
us are found: they must belong to the same user, or we must be root. Standard library only, and nothing here accesses a
device or a file system that might hang.
"""

import os
import stat
from collections.abc import Iterable, Iterator

LISTENS = "00010000"  #: __SO_ACCEPTCON among the flags in /proc/net/unix
#: The command lines of our own processes contain this: the program itself, or one of its modules.
PROGRAM = "orchestrator"
#: The only one that commands chargers to run; our other processes with open ports only stop or query them.
CONTROLLER = "orchestrator.service.controller"


class Holder:
    """A process that holds a port; `ours` if it is an orchestrator, which takes care of the charger itself."""

    def __init__(self, pid: int, name: str, *, ours: bool) -> None:
        self.pid, self.name, self.ours = pid, name, ours

    def __str__(self) -> str:
        return f"{self.name} (pid {self.pid})" if self.pid else self.name


UNKNOWN = Holder(0, "an unknown program", ours=False)


def holder(port: str, but: Iterable[int] = ()) -> Holder:
    """Who has locked this port, or else has it open, other than these processes. If unknown, a foreign program."""
    besides = set(but)
    lockers = [found for pid in _lockers(port) if pid not in besides and (found := _process(pid))]
    if lockers:
        return _best(lockers)
    return _best([found for pid in _openers(port) if pid not in besides and (found := _process(pid))])


def controller_on(port: str) -> int:
    """The process that has locked this port, if it is another service's controller; 0 if there is none."""
    pids = [pid for pid in _lockers(port) if pid != os.getpid()]
    return next((pid for pid in pids if is_orchestrator(words := _words(pid)) and CONTROLLER in words), 0)


def control_sockets(ports: Iterable[str]) -> list[str]:
    """The control socket of every orchestrator that has one of these ports open, each once."""
    return services(ports)[0]


def services(ports: Iterable[str]) -> tuple[list[str], list[int]]:
    """The same, plus the controllers whose sockets are not visible: in another container, say."""
    devices = {os.path.realpath(port) for port in ports if _may_be_tty(port)}
    found = {pid: words for pid, words in orchestrators() if not devices.isdisjoint(_files(pid))}
    sockets = {pid: _listens_on(pid) for pid in found}
    mute = [pid for pid, words in found.items() if CONTROLLER in words and not sockets[pid]]
    return [path for path in dict.fromkeys(sockets.values()) if path], mute


def _may_be_tty(port: str) -> bool:
    """Whether this may be a serial port, by the kernel's list; every process has /dev/null open, for example."""
    try:
        at = os.stat(port)
    except OSError:
        return True  # unplugged: find who still has it open
    except ValueError:
        return False
    drivers = [line.split() for line in _read("/proc/tty/drivers").splitlines()]
    majors = {words[-3] for words in drivers if len(words) >= 5}  # serial /dev/ttyS 4 64-95 serial
    major = str(os.major(at.st_rdev))
    return stat.S_ISCHR(at.st_mode) and (major in majors if majors else major != "1")


def orchestrators() -> Iterator[tuple[int, list[str]]]:
    """Every visible process of this program, with its command line: guardians and controllers."""
    for pid in _pids():
        words = _words(pid)
        if is_orchestrator(words):
            yield pid, words


def is_orchestrator(words: list[str]) -> bool:
    """Whether a command line is ours: `orchestrator …`, `python orchestrator …`, `python -m orchestrator…`."""
    if any(word.rpartition("/")[2] == PROGRAM for word in words[:2]):
        return True
    module = words[words.index("-m") + 1 : words.index("-m") + 2] if "-m" in words[:4] else []
    return any(word == PROGRAM or word.startswith(f"{PROGRAM}.") for word in module)


def _best(found: list[Holder]) -> Holder:
    return next((one for one in found if one.ours), found[0] if found else UNKNOWN)


def _process(pid: int) -> Holder | None:
    """The holder for a process; None if it has ended."""
    words = _words(pid)
    if pid == os.getpid():
        return Holder(pid, "this program", ours=True)
    if not words:
        return None
    ours = is_orchestrator(words)
    return Holder(pid, PROGRAM if ours else _read(f"/proc/{pid}/comm").strip() or words[0], ours=ours)


def _lockers(port: str) -> list[int]:
    """The processes that have locked this file: "1: FLOCK ADVISORY WRITE 4711 00:05:99 0 EOF"."""
    try:
        at = os.stat(port)
    except (OSError, ValueError):
        return []
    place = f"{os.major(at.st_dev):02x}:{os.minor(at.st_dev):02x}:{at.st_ino}"
    lines = [line.split() for line in _read("/proc/locks").splitlines()]
    return [int(line[4]) for line in lines if len(line) > 5 and line[1] == "FLOCK" and line[5] == place]


def _openers(port: str) -> list[int]:
    """The processes that have this device open."""
    device = os.path.realpath(port)
    return [pid for pid in _pids() if device in _files(pid)]


def _listens_on(pid: int) -> str:
    """The Unix socket on which a process listens, "" if none."""
    files = set(_files(pid))
    for line in _read("/proc/net/unix").splitlines():
        words = line.split(None, 7)  # Num RefCount Protocol Flags Type St Inode Path
        if len(words) == 8 and words[3] == LISTENS and f"socket:[{words[6]}]" in files:
            return os.path.join(directory(pid), words[7])
    return ""


def directory(pid: int) -> str:
    """A process's working directory; "" if it is not visible to us."""
    return _link(f"/proc/{pid}/cwd")


def _files(pid: int) -> list[str]:
    """A process's open files, as named by the kernel."""
    try:
        return [_link(f"/proc/{pid}/fd/{fd}") for fd in os.listdir(f"/proc/{pid}/fd")]
    except OSError:
        return []


def _link(path: str) -> str:
    try:
        return os.readlink(path)
    except OSError:
        return ""


def _pids() -> list[int]:
    try:
        return [int(name) for name in os.listdir("/proc") if name.isdecimal()]
    except OSError:
        return []


def _words(pid: int) -> list[str]:
    return _read(f"/proc/{pid}/cmdline").split("\0")[:-1]


def _read(path: str) -> str:
    try:
        with open(path, encoding="utf-8", errors="surrogateescape") as file:
            return file.read()
    except OSError:
        return ""
