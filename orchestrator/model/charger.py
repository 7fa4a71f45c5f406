"""The charger: its document's own values (protocol 2/2, §4.1.1 and §4.2), what it is told and what it says."""

from dataclasses import dataclass
from enum import IntEnum, IntFlag, StrEnum

from orchestrator.model.cause import Cause


class ControlMode(IntEnum):
    """Who sets the values: the charger's rotary switch (§1.3.1)."""

    AUTOMATIC = 0  #: positions 2 to 5; only stop and resume are obeyed
    MANUAL = 1  #: position 1; every value is commanded


class Operation(IntEnum):
    """Whether the charger says that it runs."""

    STOPPED = 0
    RUNNING = 1


class ChargeMode(IntEnum):
    """What the charger says that it is doing; 3, 4 and 5 can be commanded."""

    BATTERY_SEARCH = 1
    BATTERY_RECOVERY = 2
    PRECHARGE = 3
    CHARGE = 4
    FULL = 5  #: "full (standby)": also what a charger in standby shows
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
    """What was wrong with a frame that the charger received, in its words (§3.3.5)."""

    LENGTH = 1
    COMMAND = 2
    ORDER = 4
    CHECKSUM = 8


class Action(StrEnum):
    """What one frame to the charger can do."""

    STOP = "stop"  #: 0x10 rest 0, followed in manual mode by operation 0
    RESUME = "resume"  #: 0x10 rest 1: from standby back to normal
    SET_LIMIT = "set_limit"  #: value 0 … 4, the current-limit step
    SET_MODE = "set_mode"  #: value 3, 4 or 5 (`ChargeMode`)
    SET_PRECHARGE = "set_precharge"  #: value 0 … 2 (`Precharge`)
    RUN = "run"  #: operation 1


@dataclass(frozen=True, slots=True)
class Command:
    """A standing order for the charger: it is repeated in every command slot until a read-back ends it."""

    action: Action
    value: int = 0


STOP = Command(Action.STOP)


@dataclass(frozen=True, slots=True)
class ChargerReading:
    """One status reply. A field is None where its value was outside its documented list; `illegal` then says so."""

    t_s: float
    voltage_v: float
    current_a: float
    control_mode: ControlMode | None
    operation: Operation | None
    current_limit: int | None
    charge_mode: ChargeMode | None
    precharge: Precharge | None
    connection: Connection | None
    illegal: tuple[Cause, ...] = ()  #: the values that are not documented


@dataclass(frozen=True, slots=True)
class Sent:
    """The last order that was written to the port, and when its last byte was handed over."""

    command: Command
    t_s: float


@dataclass(frozen=True, slots=True)
class ChargerLink:
    """How the line to a charger is doing."""

    online: bool = False  #: it answered one of the last five polls
    problem: Cause | None = None  #: why not
    misses: int = 0  #: polls in a row without an answer
    sent: Sent | None = None
    stop_sent_s: float | None = None  #: when the last whole stop was handed to the port
    refused: Cause | None = None  #: the interlock's reason, if it held the standing order back
    error_bits: int = 0  #: of the newest 0x1F frame
    error_t_s: float | None = None  #: when that frame came
    bad_frames: int = 0  #: frames dropped since the port was opened: checksum, length, end
    bad_pct: float = 0.0  #: of the last minute's polls, those without a good answer or with a complaint
    taken_over: Cause | None = None  #: what another program had set this port to when that was last found
    taken_over_t_s: float | None = None  #: when that was; the port was set up again at once
    locked_by: Cause | None = None  #: which program, none of ours, holds the port's lock; it is used in spite of that
