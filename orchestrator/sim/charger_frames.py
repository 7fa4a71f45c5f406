"""The charger's side of its serial protocol, bytes in and bytes out, written from its document alone (§3 and §4.1).

It shares nothing with `orchestrator.protocol`: if the two disagree, one of them has misread the document.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import inf

from orchestrator.sim.charger import SimulatedCharger

ADDRESS = 0x90
HEAD, TAIL = b"\xaf\xfa", b"\xaf\xa0"
STATUS, SET, REPLY, REST, ERROR = 0x01, 0x02, 0x03, 0x10, 0x1F

#: The required length byte of each request: data + 3 (§3.2.4).
LENGTHS = {STATUS: 5, SET: 5, REST: 4}

LENGTH_ERROR, COMMAND_ERROR, ORDER_ERROR, CHECKSUM_ERROR = 1, 2, 4, 8

#: Frames are never longer than this (§3.2.7: at most 20 bytes of data).
MAX_LENGTH = 23


class Kind(IntEnum):
    """The values of a status reply, in the order of §4.1.1: five bits of kind 1, then five of kind 2."""

    VOLTAGE = 0
    CURRENT = 1
    TEMPERATURE_1 = 2
    TEMPERATURE_2 = 3
    CONTROL_MODE = 4
    OPERATION = 5
    CURRENT_LIMIT = 6
    CHARGE_MODE = 7
    PRECHARGE = 8
    CONNECTION = 9


@dataclass(slots=True)
class Lie:
    """A false value in status replies: in every one, in every n-th, or a limited number of times."""

    value: int
    every: int = 1  #: 2: every second reply
    times: float = inf  #: 1: once
    replies: int = 0  #: so far

    def is_told(self) -> bool:
        """Whether the next reply contains it."""
        self.replies += 1
        told = self.replies % self.every == 0 and self.times > 0
        self.times -= told
        return told


@dataclass(frozen=True, slots=True)
class Request:
    """One frame as received; `errors` has the bits of §3.3.5, 0 for a good one."""

    length: int
    command: int
    order: int
    data: bytes
    checksum: int
    errors: int


class Ear:
    """Finds requests in a byte stream."""

    def __init__(self) -> None:
        self._heard = b""

    @property
    def waiting(self) -> bool:
        """Whether a frame has begun but not ended."""
        return bool(self._heard)

    def forget(self) -> int:
        """Give up on an unfinished frame; returns the number of bytes dropped."""
        count, self._heard = len(self._heard), b""
        return count

    def hear(self, chunk: bytes) -> list[Request]:
        """The frames completed by this chunk: good and bad ones for address 0x90."""
        self._heard += chunk
        found = []
        while (start := self._heard.find(HEAD)) >= 0 and len(self._heard) >= start + 4:
            self._heard = self._heard[start:]
            address, length = self._heard[2], self._heard[3]
            size = length + 6  # the length counts command, order, data and checksum
            if address != ADDRESS:
                self._heard = self._heard[1:]
            elif not min(LENGTHS.values()) <= length <= MAX_LENGTH:
                found.append(Request(length, 0, 0, b"", 0, LENGTH_ERROR))
                self._heard = self._heard[1:]
            elif len(self._heard) < size:
                return found
            else:
                found.append(_read(self._heard[:size]))
                whole = self._heard[size - 2 : size] == TAIL
                self._heard = self._heard[size if whole else 1 :]
        if start < 0:  # keep only a possible first half of a head
            self._heard = HEAD[:1] if self._heard.endswith(HEAD[:1]) else b""
        return found


def _read(frame: bytes) -> Request:
    length, command, order, checksum = frame[3], frame[4], frame[5], frame[-3]
    wrong_length = LENGTHS.get(command, length) != length or frame[-2:] != TAIL
    errors = (
        LENGTH_ERROR * wrong_length
        | COMMAND_ERROR * (command not in LENGTHS)
        | ORDER_ERROR * (order != ADDRESS)
        | CHECKSUM_ERROR * (sum(frame[2:-3]) & 0xFF != checksum)
    )
    return Request(length, command, order, frame[6:-3], checksum, errors)


def frame(command: int, order: int, data: bytes) -> bytes:
    """A frame sent by the charger."""
    body = bytes((ADDRESS, len(data) + 3, command, order)) + data
    return HEAD + body + bytes((sum(body) & 0xFF,)) + TAIL


def complaint(request: Request, errors: int) -> bytes:
    """0x1F: the error bits, then parts of the received frame (§3.3.5)."""
    return frame(ERROR, errors, bytes((request.length, request.command, request.order, request.checksum)))


def status(charger: SimulatedCharger, kind1: int, kind2: int, lies: Mapping[Kind, int]) -> bytes:
    """0x03: the requested values, in list order, two bytes each; no values for undefined bits.

    `lies` replaces values, whatever the charger is doing.
    """
    wanted = kind1 & 0x1F | (kind2 & 0x1F) << 5
    values = _values(charger)
    answers = (lies.get(kind, values[kind]) for kind in Kind if wanted >> kind & 1)
    return frame(REPLY, ADDRESS, b"".join(value.to_bytes(2, "big") for value in answers))


def _values(charger: SimulatedCharger) -> tuple[int, ...]:
    """The ten values of §4.1.1, in its order; the two temperatures carry no information since 2022-01."""
    return (
        _hundredths(charger.voltage_v),
        _hundredths(charger.current_a),
        0,
        0,
        charger.control_mode,
        charger.operation,
        charger.current_step,
        charger.charge_mode,
        charger.precharge,
        charger.connection,
    )


def _hundredths(value: float) -> int:
    return min(max(round(value * 100), 0), 0xFFFF)
