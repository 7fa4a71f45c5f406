"""The charger: the values in its document (protocol 2/2, §4.1.1 and §4.2), its commands and its reports."""

from dataclasses import dataclass
from enum import IntEnum, IntFlag, StrEnum

from orchestrator.model.cause import Cause


class ControlMode(IntEnum):
    """Whether charger or service sets the values, chosen by the charger's rotary switch (§1.3.1)."""

    AUTOMATIC = 0  #: positions 2 to 5; the charger obeys only stop and resume
    MANUAL = 1  #: position 1; every value is commanded


class Operation(IntEnum):
    """Whether the charger reports that it is running."""

    STOPPED = 0
    RUNNING = 1


class ChargeMode(IntEnum):
    """What the charger reports that it is doing; 3, 4 and 5 can be commanded."""

    BATTERY_SEARCH = 1
    BATTERY_RECOVERY = 2
    PRECHARGE = 3
    CHARGE = 4
    FULL = 5  #: "full (standby)": a charger in standby also shows this
    REVERSED = 6
    SYSTEM_STOP = 7
    ERROR_STOP = 8  #: since 2022-01


class Precharge(IntEnum):
    """The precharge function."""

    OFF = 0
    PULSE = 1
    CONTINUOUS = 2


class Connection(IntEnum):
    """How the battery is connected to the charger."""

    REVERSED = 0
    NORMAL = 1


class ErrorBit(IntFlag):
    """What was wrong with a frame that the charger received, in its own terms (§3.3.5)."""

    LENGTH = 1
    COMMAND = 2
    ORDER = 4
    CHECKSUM = 8


class Action(StrEnum):
    """What one frame to the charger can do."""

    STOP = "stop"  #: 0x10 rest 0, followed in manual mode by operation 0
    RESUME = "resume"  #: 0x10 rest 1: from standby back to normal
    SET_LIMIT = "set_limit"  #: value 0 … 4, the current step
    SET_MODE = "set_mode"  #: value 3, 4 or 5 (`ChargeMode`)
    SET_PRECHARGE = "set_precharge"  #: value 0 … 2 (`Precharge`)
    RUN = "run"  #: operation 1


@dataclass(frozen=True, slots=True)
class Command:
    """A command for the charger, repeated in every command slot until a read-back confirms it."""

    action: Action
    value: int = 0


STOP = Command(Action.STOP)


@dataclass(frozen=True, slots=True)
class ChargerReading:
    """One status reply. A field is None if its value was outside its documented list; `illegal` then says so."""

    t_s: float
    voltage_v: float
    current_a: float
    control_mode: ControlMode | None
    operation: Operation | None
    current_step: int | None
    charge_mode: ChargeMode | None
    precharge: Precharge | None
    connection: Connection | None
    illegal: tuple[Cause, ...] = ()  #: the values that are not documented


@dataclass(frozen=True, slots=True)
class Sent:
    """The last command written to the port, and when its last byte was handed over."""

    command: Command
    t_s: float


@dataclass(frozen=True, slots=True)
class ChargerLink:
    """The state of the link to a charger."""

    online: bool = False  #: it answered one of the last five polls (of the last three, while answers come late)
    problem: Cause | None = None  #: why not
    misses: int = 0  #: polls in a row without an answer
    sent: Sent | None = None
    stop_sent_s: float | None = None  #: when the last complete stop was handed to the port
    refused: Cause | None = None  #: the interlock's reason, if it held the standing command back
    error_bits: int = 0  #: of the newest 0x1F frame
    error_t_s: float | None = None  #: when that frame arrived
    bad_frames: int = 0  #: frames dropped since the port was opened: checksum, length, end
    bad_pct: float = 0.0  #: share of the last minute's polls without a good answer, or answered with an error frame
    taken_over: Cause | None = None  #: what another program had set this port to when that was last found
    taken_over_t_s: float | None = None  #: when that was; the port was set up again at once
    locked_by: Cause | None = None  #: which program, none of ours, holds the port's lock; it is used in spite of that
