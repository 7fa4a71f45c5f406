"""What a BMU read costs the thread of its CAN bus: ours beside bare python-can, in turns, on the same emulated BMUs.

960 SDO reads a second, 64 nodes. On `udp_multicast`, and on the code path of SocketCAN with a pair of sockets in the
place of the kernel's CAN (which not every machine has; a real one has a wire to wait for and nothing else to do).
"""

import json
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from typing import IO, Any, Self

from benchmarks import stations
from benchmarks.can_reader import BITRATE, READS_HZ
from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series

SIDES = ("bare", "ours")
NEAR = 0.9  #: of READS_HZ: a window with less was not measured at what the row says …
TRIES = 5  #: … and is repeated
GOAL = Goal(median=80.0, share=0.8)


@dataclass(slots=True)
class Cost:
    """Of one side on one interface, by window."""

    us: list[float] = field(default_factory=list)
    wakeups: list[float] = field(default_factory=list)


def measure(effort: Effort) -> Iterator[Result]:
    """Both interfaces; both sides in turns, so that what else the machine does is shared out."""
    settle_s, window_s = effort.choose(2, 1), effort.choose(5, 1)  # opening, and every node asked once; then measured
    for interface in ("udp_multicast", "socketcan"):
        costs = {side: Cost() for side in SIDES}
        for _ in range(effort.choose(7, 1)):
            for side in SIDES:
                if not any(_window(interface, side, settle_s, window_s, costs[side]) for _ in range(TRIES)):
                    raise RuntimeError(
                        f"{side} on {interface} does not make {READS_HZ} reads a second: a busy machine?"
                    )
        ours, bare = (Series(label, costs[side].us) for label, side in (("ours", "ours"), ("bare python-can", "bare")))
        yield Result(f"CAN thread, a read of {READS_HZ}/s, {interface}", "µs", ours, bare, GOAL, processor_time=True)
        ours, bare = (Series(label, costs[side].wakeups) for label, side in (("ours", "ours"), ("bare", "bare")))
        yield Result(f"… and wake-ups, {interface}", "", ours, bare)


def _window(interface: str, side: str, settle_s: float, seconds: float, cost: Cost) -> bool:
    """Fresh processes each time: nothing of one window is left in the next."""
    with ExitStack() as stack:
        if interface == "socketcan":
            ends = [
                stack.enter_context(closing(end)) for end in socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            ]
            here, there = ends[0].fileno(), ends[1].fileno()
            settings: dict[str, Any] = {"interface": interface, "channel": "can0", "bitrate": BITRATE}
            nodes = stack.enter_context(_Asked(["can_answers", "socket", str(there)], there))
            reader = stack.enter_context(_Asked(["can_reader", side, json.dumps(settings), str(here)], here))
        else:
            settings = stations.bus(0)
            nodes = stack.enter_context(
                _Asked(["can_answers", "multicast", settings["channel"], str(settings["port"])])
            )
            words = settings if side == "bare" else {**settings, "bitrate": BITRATE}
            reader = stack.enter_context(_Asked(["can_reader", side, json.dumps(words)]))
        nodes.ready()
        reader.ask()
        time.sleep(settle_s)
        begin_s, (begin_ns, begin_wakeups), begin_reads = time.monotonic(), reader.ask(), nodes.ask()
        time.sleep(seconds)
        end_s, (end_ns, end_wakeups), end_reads = time.monotonic(), reader.ask(), nodes.ask()
    reads = end_reads - begin_reads
    if reads < NEAR * READS_HZ * (end_s - begin_s):
        return False
    cost.us.append((end_ns - begin_ns) / 1000 / reads)
    cost.wakeups.append((end_wakeups - begin_wakeups) / reads)
    return True


class _Asked:
    """A process that answers a line with a line of JSON."""

    def __init__(self, words: list[str], *fds: int) -> None:
        self._process = subprocess.Popen(
            stations.module(words[0], *words[1:]),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, pass_fds=fds, text=True,
        )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def ready(self) -> None:
        """Wait until it says so."""
        self._out.readline()

    def ask(self) -> Any:  # noqa: ANN401 - whatever it says
        """What it says now."""
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return json.loads(self._out.readline())

    @property
    def _out(self) -> IO[str]:
        assert self._process.stdout is not None
        return self._process.stdout
