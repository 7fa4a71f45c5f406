"""From exec to the first status request on the wire. The service stops the charger first and polls it two slots later.

The floor is a bare Python that opens the same port with pyserial and writes the single frame.
"""

import os
import select
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series
from benchmarks.stations import Station, ours

POLL = bytes.fromhex("AF FA 90 05 01 90")  #: a status request, up to the requested kinds
STOP = bytes.fromhex("AF FA 90 04 10 90 00 34 AF A0")
FLOOR = "import serial, sys; serial.Serial(sys.argv[1], 19200).write(bytes.fromhex('AFFA90050190131F58AFA0'))"
#: If nothing comes within this, the program is broken.
BROKEN_S = 20.0


def measure(effort: Effort) -> Iterator[Result]:
    """Our first poll against the floor's, then our first stop."""
    runs = effort.choose(20, 5)
    with _port() as (master, bay), TemporaryDirectory(prefix="bench-") as name:
        argv = ours(Station(Path(name), (1,), (bay,)))
        begins = [_first(argv, master) for _ in range(runs)]
        floor = [_first([sys.executable, "-c", FLOOR, str(bay["port"])], master)[POLL] for _ in range(runs)]
    polls, stops = [[begin[frame] for begin in begins] for frame in (POLL, STOP)]
    beside = Series("bare pyserial, one frame", floor)
    yield Result("exec → first status poll", "s", Series("ours", polls), beside, Goal(median=0.8))
    yield Result("exec → first byte, a stop", "s", Series("ours", stops), beside)


@contextmanager
def _port() -> Iterator[tuple[int, dict[str, str | int]]]:
    """A pty on which nobody answers, and its bay."""
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        yield master, {"name": "bay-1", "port": os.ttyname(slave), "node_id": 0x10, "can": 0}
    finally:
        os.close(master)
        os.close(slave)


def _first(argv: Sequence[str], master: int) -> dict[bytes, float]:
    """When each of the two frames first came, in s from the start of the program."""
    while _comes(master, 0.0):
        os.read(master, 4096)  # from the previous program
    begin_s = time.monotonic()
    with subprocess.Popen(
        argv, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as process:
        try:
            return _listen(master, begin_s)
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # guardian and controller at once, so that neither stops anything


def _listen(master: int, begin_s: float) -> dict[bytes, float]:
    heard, came = b"", dict[bytes, float]()
    while POLL not in came:
        if not _comes(master, BROKEN_S):
            raise RuntimeError(f"no poll within {BROKEN_S:g} s, but {heard.hex(' ')}")
        heard += os.read(master, 4096)
        now_s = time.monotonic()
        for frame in (POLL, STOP):
            if frame in heard and frame not in came:
                came[frame] = now_s - begin_s
    return came


def _comes(master: int, within_s: float) -> bool:
    return bool(select.select([master], [], [], within_s)[0])
