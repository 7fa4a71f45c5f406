"""The objects behind descriptors of the virtual kernel: open files, sockets, streams, processes, and /proc."""

from collections import deque
from dataclasses import dataclass, field
from typing import Any

from tests.proof.virtual_disk import Inode
from tests.proof.virtual_gpio import Chip, Output
from tests.proof.virtual_threads import Waiting
from tests.proof.virtual_time import Time
from tests.proof.virtual_tty import Tty


@dataclass(slots=True, eq=False)
class Node:
    """The object behind an open file that is neither a tty nor a file: `news` signals incoming data."""

    time: Time
    news: Waiting = field(init=False)

    def __post_init__(self) -> None:
        self.news = Waiting(self.time)


@dataclass(slots=True, eq=False)
class Socket(Node):
    """One end of a pair of SOCK_SEQPACKET sockets."""

    peer: "Socket | None" = None
    heard: deque[tuple[bytes, list[int]]] = field(default_factory=deque)
    closed: bool = False
    reset: bool = False  #: the other end died with our messages unread


@dataclass(slots=True, eq=False)
class Stream(Node):
    """Standard error or output; `stopped`: its reader stands still (Ctrl-S), and it is full."""

    stopped: bool = False


@dataclass(slots=True, eq=False)
class Death(Node):
    """A pidfd."""

    process: Any = None


@dataclass(slots=True, eq=False)
class File:
    """An open file; several descriptors, of several processes, may refer to it."""

    path: str
    what: Tty | Inode | Socket | Stream | Death | Chip | Output | None
    flags: int = 0
    at: int = 0
    owners: int = 0
    locker: Any = None  #: the process holding its lock


class Proc:
    """/proc, as far as the product reads it; without our processes it is the real one."""

    def has(self, _path: str) -> bool:
        return False

    def text(self, _path: str) -> str:
        return ""

    def listdir(self, _path: str) -> list[str]:
        return []

    def link(self, _path: str) -> str:
        return ""
