"""The guardian's messages from a dying controller that may send anything, and the ports it is left with."""

import os
import socket
from array import array
from pathlib import Path
from unittest.mock import patch

import pytest

from orchestrator.lastresort import bareport, guardian
from orchestrator.lastresort.guardian import BEAT, DONE, DROP, MESSAGE, PORT, Guardian
from tests.fuzz.target import Target, cut_records, kind_of_record, record, records, scratch

#: Events: any message with or without a descriptor, a port's name with one, three or no descriptors, a port
#: given up, a heartbeat, the end.
RAW, RAW_FD, HOLD, HOLD_3, NAME, GIVE_UP, LIVE, END = range(8)
BEGINS = {HOLD: PORT, HOLD_3: PORT, NAME: PORT, GIVE_UP: DROP, LIVE: BEAT, END: DONE, RAW: b"", RAW_FD: b""}
DESCRIPTORS = {RAW_FD: 1, HOLD: 1, HOLD_3: 3}
#: Names count as files of this empty directory.
DIRECTORY = bytes(scratch()) + b"/"
NULL = os.open(os.devnull, os.O_RDWR)


def one(data: bytes) -> None:
    """One controller's last words."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    before = _descriptors()
    watched = Guardian(os.getpid(), ours)
    with ours, theirs, patch.object(guardian, "aside", lambda work: work()):  # without a thread for each run
        for kind, content in records(data):
            _send(theirs, kind, content)
            assert watched._message() or (kind in (RAW, RAW_FD) and not content)
        theirs.close()
        assert not watched._message() or not watched._message(), "the end, behind one word of answers left unread"
        for name, fd in watched._ports.items():
            assert len(name) <= MESSAGE
            if fd is not None:
                os.close(fd)
            else:
                with pytest.raises(OSError, match=r"\w"):
                    bareport.open_port(name, leave_held=True)
        os.close(watched._child)
    assert _descriptors() <= before, "a descriptor is left open"


def _send(theirs: socket.socket, kind: int, content: bytes) -> None:
    name = DIRECTORY + content.replace(b"/", b"_") if kind in (HOLD, HOLD_3, NAME, GIVE_UP) else content
    rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", [NULL] * DESCRIPTORS.get(kind, 0)))]
    theirs.sendmsg([BEGINS[kind] + name], rights if kind in DESCRIPTORS else [])


def _descriptors() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


TARGET = Target(
    one,
    cut_records,
    kind_of_record,
    [
        record(HOLD, b"ttyS1") + record(LIVE) + record(GIVE_UP, b"ttyS1") + record(HOLD, b"ttyS1") + record(END),
        record(NAME, b"ttyS2") + record(LIVE) * 3,
    ],
    [
        record(LIVE), record(END), record(HOLD, b"ttyS1"), record(HOLD_3, b"ttyS1"), record(NAME, b"a\0b"),
        record(HOLD), record(NAME, b"\xff\xfe"), record(GIVE_UP, b"ttyS1"), record(RAW), record(RAW, b"?"),
        record(RAW_FD), record(RAW_FD, b"B"), record(RAW_FD, b"D"), record(RAW_FD, b"E"), record(RAW_FD, b"\0"),
        record(NAME, b"x" * 31),
    ],
    [f"orchestrator/lastresort/{name}.py" for name in ("guardian", "contactors", "bareport")],
    max_bytes=128,
    limit_s=1.0,
)  # fmt: skip
