"""The charger's messages: the meaning of its frames (protocol 2/2, §3.3, §4.1.1 and §4.2)."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import lru_cache
from typing import Any

from orchestrator.errors import ProtocolError
from orchestrator.model import (
    Action,
    Cause,
    ChargeMode,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    ErrorBit,
    Operation,
    Precharge,
)
from orchestrator.protocol.frame import ADDRESS, OVERHEAD, Frame


class Code(IntEnum):
    """The commands (§3.2.5)."""

    STATUS_REQUEST = 0x01
    SET = 0x02  #: acted on in manual mode only
    STATUS_REPLY = 0x03
    REST = 0x10  #: stop (to standby, from any activity) and resume; acted on in both modes
    ERROR = 0x1F


class Kind1(IntFlag):
    """Basic values requested by a status request (§3.3.1)."""

    VOLTAGE = 0x01
    CURRENT = 0x02
    TEMPERATURE_1 = 0x04
    TEMPERATURE_2 = 0x08
    CONTROL_MODE = 0x10


class Kind2(IntFlag):
    """Extended values requested by a status request (§3.3.1)."""

    OPERATION = 0x01
    CURRENT_LIMIT = 0x02
    CHARGE_MODE = 0x04
    PRECHARGE = 0x08
    CONNECTION = 0x10


class Push(IntFlag):
    """The value that a 0x02 frame sets (§3.3.2). The document lists single bits only: one value per frame."""

    OPERATION = 0x01
    CURRENT_LIMIT = 0x02
    CHARGE_MODE = 0x04
    PRECHARGE = 0x08


# --- to the charger --------------------------------------------------------------------------------------------------

Kinds = tuple[int, int]  #: kind 1, kind 2

#: The values that the service requests: all but the two temperatures, which carry no information since 2022-01.
STATUS_KINDS: Kinds = (0x13, 0x1F)


def _frame(code: Code, *data: int) -> bytes:
    return Frame(code, ADDRESS, bytes(data)).encode()


def status_request(kind1: int = STATUS_KINDS[0], kind2: int = STATUS_KINDS[1]) -> bytes:
    """The frame requesting these values."""
    return _frame(Code.STATUS_REQUEST, kind1, kind2)


STATUS_REQUEST = status_request()
STOP_FRAME = _frame(Code.REST, 0)  #: to standby, in manual and automatic mode; always the first frame of a stop
OPERATION_STOP_FRAME = _frame(Code.SET, Push.OPERATION, 0)  #: the second, in manual mode

#: Every command and its frame; nothing else can be sent (§4.2.1).
_FRAMES: dict[Command, bytes] = {
    Command(Action.RESUME): _frame(Code.REST, 1),
    Command(Action.RUN): _frame(Code.SET, Push.OPERATION, 1),
    **{Command(Action.SET_LIMIT, value): _frame(Code.SET, Push.CURRENT_LIMIT, value) for value in range(5)},
    **{Command(Action.SET_MODE, value): _frame(Code.SET, Push.CHARGE_MODE, value) for value in (3, 4, 5)},
    **{Command(Action.SET_PRECHARGE, value): _frame(Code.SET, Push.PRECHARGE, value) for value in range(3)},
}


def encode(command: Command) -> bytes:
    """The frame for a command; ValueError if its value is not listed in §4.2.1.

    A stop is never refused, whatever its value. In manual mode `OPERATION_STOP_FRAME` follows it.
    """
    if command.action is Action.STOP:
        return STOP_FRAME
    frame = _FRAMES.get(command)
    if frame is None:
        allowed = ", ".join(str(known.value) for known in _FRAMES if known.action is command.action)
        raise ValueError(f"{command.action} {command.value}: the charger takes {allowed}")
    return frame


# --- from the charger ------------------------------------------------------------------------------------------------


def _hundredths(raw: int) -> float:
    return raw / 100


def _signed_tenths(raw: int) -> float:
    # §4.1.1 contradicts itself: scale 0.1, range ±327.67. We use 0.1 and never rely on the value.
    return (raw - 0x10000 if raw & 0x8000 else raw) / 10


@dataclass(frozen=True, slots=True)
class StatusValue:
    """One row of §4.1.1: a value in a status reply."""

    name: str  #: as in `ChargerReading`
    title: str  #: for people
    kind1: int
    kind2: int
    decode: Callable[[int], float]  #: decodes the 16 raw bits; ValueError if they are not documented
    documented: str = ""  #: the documented values

    def value(self, raw: int) -> float | Cause:
        """The value, or why it is none."""
        try:
            return self.decode(raw)
        except ValueError:
            return Cause.of("undocumented", value=self.name, raw=raw, documented=self.documented)

    def refused(self, raw: int) -> str:
        """The same for who decodes frames by hand: "charge mode 9 (documented: 1 … 8)"."""
        return f"{self.title} {raw} (documented: {self.documented})"


#: In the order of a reply. The document numbers the data of the ten defined values 1 to 20 without gaps, so the six
#: void ones, mentioned in §3.3.3 but not listed, can only follow them. Nothing needs to request those.
STATUS_VALUES = (
    StatusValue("voltage_v", "voltage", Kind1.VOLTAGE, 0, _hundredths),
    StatusValue("current_a", "current", Kind1.CURRENT, 0, _hundredths),
    StatusValue("temperature_1_c", "temperature 1", Kind1.TEMPERATURE_1, 0, _signed_tenths),
    StatusValue("temperature_2_c", "temperature 2", Kind1.TEMPERATURE_2, 0, _signed_tenths),
    StatusValue("control_mode", "control mode", Kind1.CONTROL_MODE, 0, ControlMode, "0, 1"),
    StatusValue("operation", "operation", 0, Kind2.OPERATION, Operation, "0, 1"),
    StatusValue("current_step", "current limit", 0, Kind2.CURRENT_LIMIT, range(5).index, "0 … 4"),
    StatusValue("charge_mode", "charge mode", 0, Kind2.CHARGE_MODE, ChargeMode, "1 … 8"),
    StatusValue("precharge", "precharge function", 0, Kind2.PRECHARGE, Precharge, "0 … 2"),
    StatusValue("connection", "battery connection", 0, Kind2.CONNECTION, Connection, "0, 1"),
    *(
        StatusValue(f"void_{kind1:02x}{kind2:02x}", f"void {kind1:02X} {kind2:02X}", kind1, kind2, int)
        for kind1, kind2 in ((0x20, 0), (0x40, 0), (0x80, 0), (0, 0x20), (0, 0x40), (0, 0x80))
    ),
)


@lru_cache(maxsize=64)
def status_values(kind1: int, kind2: int) -> tuple[StatusValue, ...]:
    """The rows in the reply to a request for these kinds, in order."""
    return tuple(row for row in STATUS_VALUES if row.kind1 & kind1 or row.kind2 & kind2)


def reply_bytes(kind1: int, kind2: int) -> int:
    """The length of the complete reply frame to a request for these kinds."""
    return 2 * len(status_values(kind1, kind2)) + OVERHEAD


STATUS_REPLY_BYTES = reply_bytes(*STATUS_KINDS)


def _expect(frame: Frame, code: Code, size: int, order: int) -> None:
    got = (frame.command, frame.order, len(frame.data))
    if got != (code, order, size):
        raise ProtocolError(
            f"expected command 0x{code:02X}, order 0x{order:02X}, {size} data bytes; "
            f"got command 0x{frame.command:02X}, order 0x{frame.order:02X}, {len(frame.data)} data bytes in {frame}"
        )


def parse_values(frame: Frame, kind1: int, kind2: int) -> dict[str, float | Cause]:
    """The values of a reply to a request for any kinds, by name; a Cause says why a value is not documented.

    ProtocolError if the frame cannot be that reply.
    """
    rows = status_values(kind1, kind2)
    data = frame.data
    _expect(frame, Code.STATUS_REPLY, 2 * len(rows), ADDRESS)
    return {row.name: row.value(data[2 * at] << 8 | data[2 * at + 1]) for at, row in enumerate(rows)}


def parse_status(frame: Frame, kinds: Kinds, t_s: float) -> ChargerReading:
    """The reading in a reply to a request sent at `t_s` for `kinds`, which must include `STATUS_KINDS`.

    A value outside its documented list is None and has its cause in `illegal`. ProtocolError as in `parse_values`.
    """
    if STATUS_KINDS[0] & ~kinds[0] or STATUS_KINDS[1] & ~kinds[1]:
        raise ValueError(f"kinds {kinds[0]:#04x} {kinds[1]:#04x} do not fill a reading")
    values = parse_values(frame, *kinds)
    illegal = tuple(value for value in values.values() if isinstance(value, Cause))
    reading: dict[str, Any] = {row.name: values[row.name] for row in status_values(*STATUS_KINDS)}
    if illegal:
        reading = {name: None if isinstance(value, Cause) else value for name, value in reading.items()}
    return ChargerReading(t_s=t_s, illegal=illegal, **reading)


@dataclass(frozen=True, slots=True)
class ErrorReply:
    """A 0x1F frame: the charger rejects the frame that it received, and repeats parts of it."""

    bits: ErrorBit
    length: int
    command: int
    order: int
    checksum: int


def parse_error(frame: Frame) -> ErrorReply:
    """The charger's error reply. The order byte holds the error bits (§3.3.5). ProtocolError for any other frame."""
    _expect(frame, Code.ERROR, 4, frame.order)
    return ErrorReply(ErrorBit(frame.order), *frame.data)
