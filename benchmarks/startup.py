"""From exec to the first stop and the first status request on the wire, and where that time goes.

The service stops the charger first and polls it two slots later. The floor is a bare Python that opens the same port
with pyserial and writes the single frame. Everything runs from bytecode, as pip leaves it behind.
"""

import os
import select
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory

from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series
from benchmarks.stations import Station, ours

POLL = bytes.fromhex("AF FA 90 05 01 90")  #: a status request, up to the requested kinds
STOP = bytes.fromhex("AF FA 90 04 10 90 00 34 AF A0")
FLOOR = "import serial, sys; serial.Serial(sys.argv[1], 19200).write(bytes.fromhex('AFFA90050190131F58AFA0'))"
#: If nothing comes within this, the program is broken.
BROKEN_S = 20.0
MANY = 64
IMPORT = "import gc; gc.disable(); import orchestrator.service.controller as controller"
#: What happens at a start, each measured alone, from exec to exit. The argument is the station file.
PARTS: Mapping[str, str] = {
    "bare Python": "pass",
    "the guardian's imports": "import orchestrator.lastresort.guardian",
    "the controller's imports before the ports": IMPORT,
    "… and the station file": f"{IMPORT}, sys; controller.load_station(sys.argv[1])",
    "everything but the CAN libraries": f"{IMPORT}, orchestrator.service.supervisor",
    "the CAN libraries": "import can, canopen",
}


@dataclass(slots=True)
class Port:
    """The far end of a pty on which nobody answers, and when each frame first came, in s from the program's start."""

    master: int
    bay: dict[str, str | int]
    heard: bytes = b""
    came: dict[bytes, float] = field(default_factory=dict)
    spent_ms: float = 0.0  #: processor time of guardian and controller when the stop came: others' load adds little


def measure(effort: Effort) -> Iterator[Result]:
    """Our first stop and poll against the floor's, with one bay and with many; then the parts."""
    runs = effort.choose(20, 5)
    with _bytecode() as environment:
        with _ports(1) as (port,), TemporaryDirectory(prefix="bench-") as name:
            argv = ours(Station(Path(name), (1,), (port.bay,)))
            _first(argv, [port], environment)  # which compiles everything
            begins, spent = [], []
            for _ in range(runs):
                begins += _first(argv, [port], environment)
                spent.append(port.spent_ms)
            bare = [sys.executable, "-c", FLOOR, str(port.bay["port"])]
            floor = [_first(bare, [port], environment)[0][POLL] for _ in range(runs)]
            parts = _parts(argv[-1], runs, environment)
        many = _of_many(MANY, effort.choose(20, 3), environment)
    beside = Series("bare pyserial, one frame", floor)
    polls, stops = ([begin[frame] for begin in begins] for frame in (POLL, STOP))
    slots = [begin[POLL] - begin[STOP] for begin in begins]
    yield Result("exec → first status poll", "s", Series("ours", polls), beside, Goal(median=0.5))
    yield Result("exec → first byte, a stop", "s", Series("ours", stops), beside)
    yield Result("… processor time until then", "ms", Series("ours", spent), processor_time=True)
    yield Result("first stop → first poll: two slots", "s", Series("ours", slots))
    yield Result(f"exec → a stop on the last of {MANY} ports", "s", Series("ours", many))
    yield from parts


def _parts(station: str, runs: int, environment: Mapping[str, str]) -> list[Result]:
    def row(what: str, code: str) -> Result:
        return Result(
            f"processor time alone: {what}",
            "ms",
            Series("ours", _times([sys.executable, "-c", code, station], runs, environment)),
            processor_time=True,
        )

    return [row(what, code) for what, code in PARTS.items()]


def _of_many(bays: int, runs: int, environment: Mapping[str, str]) -> list[float]:
    """When the last of so many ports had its first stop."""
    with _ports(bays) as ports, TemporaryDirectory(prefix="bench-") as name:
        numbers = tuple(range(1, bays + 1))
        argv = ours(Station(Path(name), numbers, tuple(port.bay for port in ports)))
        return [max(came[STOP] for came in _first(argv, ports, environment)) for _ in range(runs)]


@contextmanager
def _bytecode() -> Iterator[Mapping[str, str]]:
    """An environment in which each module is compiled once, whatever the caller's settings are."""
    with TemporaryDirectory(prefix="bench-") as name:
        usual = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        yield {**usual, "PYTHONPYCACHEPREFIX": name}


@contextmanager
def _ports(count: int) -> Iterator[list[Port]]:
    with ExitStack() as stack:
        ports = []
        for number in range(1, count + 1):
            master, slave = os.openpty()
            stack.callback(os.close, master)
            stack.callback(os.close, slave)
            tty.setraw(slave)
            bay: dict[str, str | int] = {
                "name": f"bay-{number}",
                "port": os.ttyname(slave),
                "node_id": 0x0F + number,
                "can": 0,
            }
            ports.append(Port(master, bay))
        yield ports


def _times(argv: Sequence[str], runs: int, environment: Mapping[str, str]) -> list[float]:
    """Processor time from exec to exit, in ms; one run before them warms up."""
    times = []
    for _ in range(runs + 1):
        begin_s = _children_s()
        subprocess.run(argv, env=environment, check=True)
        times.append(1000 * (_children_s() - begin_s))
    return times[1:]


def _children_s() -> float:
    use = getrusage(RUSAGE_CHILDREN)
    return use.ru_utime + use.ru_stime


def _first(argv: Sequence[str], ports: Sequence[Port], environment: Mapping[str, str]) -> list[dict[bytes, float]]:
    """When each of the two frames first came, on each port."""
    for port in ports:
        while select.select([port.master], [], [], 0.0)[0]:
            os.read(port.master, 4096)  # from the previous program
        port.heard, port.came, port.spent_ms = b"", {}, 0.0
    begin_s = time.monotonic()
    with subprocess.Popen(
        argv, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as process:
        try:
            _listen(ports, begin_s, process.pid)
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # guardian and controller at once, so that neither stops anything
    return [port.came for port in ports]


def _listen(ports: Sequence[Port], begin_s: float, pid: int) -> None:
    of_master, poll = {port.master: port for port in ports}, select.poll()
    for master in of_master:
        poll.register(master, select.POLLIN)
    while not all(POLL in port.came for port in ports):
        ready = poll.poll(BROKEN_S * 1000)
        if not ready:
            late = next(port for port in ports if POLL not in port.came)
            raise RuntimeError(f"{late.bay['name']}: no poll within {BROKEN_S:g} s, but {late.heard.hex(' ')}")
        for master, _ in ready:
            port = of_master[master]
            port.heard += os.read(master, 4096)
            for frame in (POLL, STOP):
                if frame in port.heard:
                    port.came.setdefault(frame, time.monotonic() - begin_s)
            if STOP in port.came and not port.spent_ms:
                port.spent_ms = _spent_ms(pid)


def _spent_ms(pid: int) -> float:
    """Of a process and its children, with all their threads."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    tasks = (task for one in (pid, *children) for task in Path(f"/proc/{one}/task").iterdir())
    return sum(int((task / "schedstat").read_text(encoding="ascii").split()[0]) for task in tasks) / 1e6
