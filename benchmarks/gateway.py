"""The gateway factor: how long this machine takes for a fixed piece of Python, compared with the reference machine.

A figure in processor time, times the factor of your gateway, is what to expect there. The work is of the service's
kind: frames taken apart, frozen records, look-ups, comparisons. It uses nothing of the service, so that it stays the
same when the service changes. Changing it makes all earlier factors void.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from time import thread_time_ns

from benchmarks.effort import Effort
from benchmarks.report import Result, Series

#: The best of 400 runs on the machine of the figures in docs/proofs.md (2 cores of an AMD EPYC, Python 3.11.7).
REFERENCE_MS = 76.95
FACT = "gateway_factor"  #: its name among the machine's facts
RUNS = 20
ROUNDS = 11_000
REPLY = bytes.fromhex("AF FA 90 13 03 90 13 93 09 07 00 01 00 01 00 03 00 04 00 00 00 01 7B AF A0")
LAYOUT = struct.Struct(">8H")
NAMES = ("volts", "amps", "manual", "operation", "step", "mode", "precharge", "connection")
LIMITS = {"volts": (0, 6000), "amps": (0, 3000), "step": (0, 4), "mode": (0, 8), "connection": (0, 1)}


@dataclass(frozen=True, slots=True)
class Reading:
    """A value, and when it was read."""

    name: str
    value: int
    at_s: float
    valid: bool


@dataclass(frozen=True, slots=True)
class Total:
    """What is carried from one reply to the next."""

    replies: int = 0
    ampere_s: float = 0.0
    changes: int = 0


def work() -> Total:
    """The same result every time, on every machine."""
    total, last = Total(), dict[str, Reading]()
    for number in range(ROUNDS):
        now_s = 0.2 * number
        readings = _read(REPLY, number, now_s)
        changed = sum(last[name].value != new.value if name in last else 1 for name, new in readings.items())
        flowing = readings["operation"].value == 1 and all(one.valid for one in readings.values())
        amps = readings["amps"].value / 100 if flowing else 0.0
        total = Total(total.replies + 1, total.ampere_s + 0.2 * amps, total.changes + changed)
        last = readings
    return total


def _read(frame: bytes, number: int, now_s: float) -> dict[str, Reading]:
    body = bytearray(frame[2:-3])
    body[4:6] = (int.from_bytes(frame[6:8], "big") + number % 7).to_bytes(2, "big")
    checksum = 0
    for byte in body:
        checksum = (checksum + byte) & 0xFF
    readings = {}
    for name, value in zip(NAMES, LAYOUT.unpack(body[4:20]), strict=True):
        low, high = LIMITS.get(name, (0, 0xFFFF))
        readings[name] = Reading(name, value, now_s, low <= value <= high and checksum > 0)
    return readings


@cache
def times_ms() -> tuple[float, ...]:
    """Processor time of several runs. Measured once: whoever asks later gets the same figures."""
    samples = []
    for _ in range(RUNS):
        begin_ns = thread_time_ns()
        work()
        samples.append((thread_time_ns() - begin_ns) / 1e6)
    return tuple(samples)


def factor() -> float:
    """1.0 on the reference machine; 4.0 is four times slower. Of the best run: other programs only slow one down."""
    return round(min(times_ms()) / REFERENCE_MS, 3)


def measure(_: Effort) -> Iterator[Result]:
    """The work alone. It is no `processor_time`: scaled by its own factor, it would be the same on every machine."""
    yield Result("a fixed piece of Python, for the gateway factor", "ms", Series("ours", times_ms()))
