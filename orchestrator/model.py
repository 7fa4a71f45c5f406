"""The nouns that travel through the system, all frozen: readings in, a decision out.

Units are in the names. Times called `t_s` are monotonic seconds and say when the value was *asked for*, so that an age
computed from them is never too young. Unknown is `None`, never a number.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag, StrEnum

# --- the charger, in its document's own values (protocol 2/2, §4.1.1 and §4.2) ---------------------------------------


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
    illegal: tuple[str, ...] = ()  #: e.g. "charge mode 9 (documented: 1 … 8)"


@dataclass(frozen=True, slots=True)
class Sent:
    """The last order that was written to the port, and when its last byte was handed over."""

    command: Command
    t_s: float


@dataclass(frozen=True, slots=True)
class ChargerLink:
    """How the line to a charger is doing."""

    online: bool = False  #: it answered one of the last five polls
    problem: str = ""  #: why not, for a person: port, errno text, what to do
    misses: int = 0  #: polls in a row without an answer
    sent: Sent | None = None
    stop_sent_s: float | None = None  #: when the last whole stop was handed to the port
    refused: str = ""  #: the interlock's reason, if it held the standing order back
    error_bits: int = 0  #: of the newest 0x1F frame
    error_t_s: float | None = None  #: when that frame came
    bad_frames: int = 0  #: frames dropped since the port was opened: checksum, length, end
    bad_pct: float = 0.0  #: of the last minute's polls, those without a good answer or with a complaint


# --- the battery -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Measurement:
    """A decoded value, in range, and when it was asked for."""

    value: float
    t_s: float


class BatteryStatus(IntEnum):
    """Bits of the BMU's status word (inferred, see the object map)."""

    OVER_VOLTAGE = 0
    LOW_VOLTAGE = 1
    CHARGE_OVER_CURRENT = 2
    DISCHARGE_OVER_CURRENT = 3
    HIGH_TEMPERATURE = 4
    LOW_TEMPERATURE = 5
    BMU_ERROR = 6


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """The newest valid value of each field; None until one came. Field names are those an object map may use."""

    voltage_v: Measurement | None = None
    current_a: Measurement | None = None  #: positive while charging
    status: Measurement | None = None  #: bits, `BatteryStatus`
    temperature_c: Measurement | None = None
    soc_pct: Measurement | None = None
    soh_pct: Measurement | None = None
    time_to_full_min: Measurement | None = None
    time_to_empty_min: Measurement | None = None
    remaining_ah: Measurement | None = None
    available_wh: Measurement | None = None


@dataclass(frozen=True, slots=True)
class BatteryLink:
    """How the line to a BMU is doing. Silence and refusal are two different faults."""

    online: bool = False  #: it answered within the stale limit
    problem: str = ""  #: why not, for a person: bus, node, what to do
    boots: int = 0  #: boot-up frames seen
    boot_t_s: float | None = None  #: when the newest came
    heartbeat_s: float | None = None  #: period that the BMU accepted, None while there is none
    heartbeat_t_s: float | None = None  #: newest heartbeat, or when it was armed
    nmt_state: int | None = None
    abort: str = ""  #: a read that the BMU refuses: object, code and meaning; "" once it answers again
    abort_code: int = 0
    implausible: Mapping[str, str] = field(default_factory=dict)  #: field → why its newest value was thrown away
    emergency: str = ""  #: newest EMCY that is not "error reset"
    bad_frames: int = 0  #: frames of this node thrown away: wrong length, not understood, late or second answers


class Request(StrEnum):
    """What an operator can ask of a bay."""

    START = "start"
    PAUSE = "pause"
    STOP = "stop"
    RESET = "reset"


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All that is known of one bay at one moment; together with the memory, all that a decision may depend on."""

    charger: ChargerReading | None = None
    charger_link: ChargerLink = ChargerLink()
    battery: BatteryReading = BatteryReading()
    battery_link: BatteryLink = BatteryLink()
    request: Request | None = None
    internal: str = ""  #: an exception of our own code, caught at the boundary, in words
    late_s: float = 0.0  #: how much later than planned this step comes
    slept_s: float = 0.0  #: how long the whole machine was suspended since the step before
    unkept: str = ""  #: why faults that latch now would be forgotten by a restart, "" while they would not
    ending: str = ""  #: why the service is about to end, "" while it is not


class State(StrEnum):
    """The states of a bay (theory of operation: `core/machine.py`)."""

    STARTING = "STARTING"
    OFFLINE = "OFFLINE"
    IDLE = "IDLE"
    QUALIFYING = "QUALIFYING"
    PRECHARGE_PULSE = "PRECHARGE_PULSE"
    PRECHARGE_CONTINUOUS = "PRECHARGE_CONTINUOUS"
    CHARGING = "CHARGING"
    FULL = "FULL"
    SUSPENDED = "SUSPENDED"
    STOPPING = "STOPPING"
    TRIPPED = "TRIPPED"
    UNCONTROLLABLE = "UNCONTROLLABLE"


#: The states in which the charger is commanded to run.
ENERGISED = frozenset({State.PRECHARGE_PULSE, State.PRECHARGE_CONTINUOUS, State.CHARGING})


class Effect(IntEnum):
    """What a fault does, mildest first; of all that are active the highest wins."""

    WARN = 1  #: said, nothing else
    LIMIT = 2  #: charge on the lowest step only
    NO_START = 3  #: a charge that runs goes on, none begins
    PAUSE = 4  #: stop, go on by itself once clear
    STOP = 5  #: stop; may go on after a backoff or when an operator starts
    TRIP = 6  #: stop and latch until a person resets


@dataclass(frozen=True, slots=True)
class ActiveFault:
    """One fault as status and journal show it."""

    id: str
    effect: Effect
    text: str  #: what, with its evidence, for the operator
    since_s: float


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What the charger shall be doing; None where this is left to it (automatic mode, standby)."""

    run: bool = False
    current_limit: int | None = None
    charge_mode: ChargeMode | None = None
    precharge: Precharge | None = None


STANDBY = Setpoint()


@dataclass(frozen=True, slots=True)
class Step:
    """The current-limit step in force, and the rule that bound it."""

    index: int  #: 0 (lowest) … 4
    current_a: float
    rule: str  #: "temperature 8.4 °C is in 0 … 10 °C, policies/li-ion-48v.yaml:31"


@dataclass(frozen=True, slots=True)
class Session:
    """One charge of one battery, from its first stage to its end; a pause does not end it."""

    started_s: float
    elapsed_s: float = 0.0
    energised_s: float = 0.0  #: the part of it with the charger commanded to run
    charged_ah: float = 0.0  #: integral of the charger's current
    charged_wh: float = 0.0
    soc_start_pct: float | None = None
    soc_pct: float | None = None
    step_changes: int = 0
    result: str = ""  #: why it ended; "" while it goes on


@dataclass(frozen=True, slots=True)
class Decision:
    """What one `step()` says. The service carries out `command` and shows the rest."""

    state: State
    reason: str  #: why the bay is in this state, for the operator
    command: Command | None = None  #: standing order for the charger's port; None: only poll
    setpoint: Setpoint = STANDBY
    step: Step | None = None  #: while energised
    faults: tuple[ActiveFault, ...] = ()  #: worst first
    alarm: bool = False  #: the interlock output is to be open
    session: Session | None = None  #: running, or just ended (`result` set, in this one decision)
    answer: str = ""  #: what became of the operator's request: "" is yes, else why not
