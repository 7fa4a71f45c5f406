"""What the core is given and what it says: a snapshot in, a decision out."""

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Any

from orchestrator.model.battery import BatteryLink, BatteryReading
from orchestrator.model.cause import Cause
from orchestrator.model.charger import ChargeMode, ChargerLink, ChargerReading, Command, Precharge


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
    unkept: Cause | None = None  #: why faults that latch now would be forgotten by a restart; None while they would not
    ending: Cause | None = None  #: why the service is about to end; None while it is not
    connected: bool = True  #: nothing is between charger and battery, or a contactor that was closed for this reading
    contactor_problem: Cause | None = None  #: why the contactor cannot be driven
    waits: Cause | None = (
        None  #: why no charge may begin here right now, though nothing is wrong: another bay begins one
    )
    moves: str = ""  #: the bay whose BMU has seen the first amperes of this bay's charger, if it is another one
    running_kept: bool = True  #: it is on disk that this bay's charger may be running


class State(StrEnum):
    """The states of a bay (theory of operation: `core/machine.py`)."""

    STARTING = "STARTING"
    OFFLINE = "OFFLINE"
    IDLE = "IDLE"
    HELD = "HELD"
    QUALIFYING = "QUALIFYING"
    PRECHARGE_PULSE = "PRECHARGE_PULSE"
    PRECHARGE_CONTINUOUS = "PRECHARGE_CONTINUOUS"
    CHARGING = "CHARGING"
    FULL = "FULL"
    SUSPENDED = "SUSPENDED"
    STOPPING = "STOPPING"
    TRIPPED = "TRIPPED"
    UNCONTROLLABLE = "UNCONTROLLABLE"


class Effect(IntEnum):
    """What a fault does, mildest first; of all that are active the highest wins."""

    WARN = 1  #: said, nothing else
    LIMIT = 2  #: charge on the lowest step only
    NO_START = 3  #: a charge that runs goes on, none begins
    PAUSE = 4  #: stop, go on by itself once clear
    STOP = 5  #: stop; may go on after a backoff or when an operator starts
    TRIP = 6  #: stop and latch until a person resets


class Alarm(IntEnum):
    """How urgently people must look at a bay; of many bays the highest counts."""

    NONE = 0  #: nobody need look: it works, rests, or stands by because an operator wanted it so
    ATTENTION = 1  #: its charger stands by, verified, and a fault waits for a person
    DANGER = 2  #: its charger is, or may be, out of control


@dataclass(frozen=True, slots=True)
class ActiveFault:
    """One fault as status and journal show it."""

    id: str
    effect: Effect
    cause: Cause  #: what, with its evidence as it is now, or as it was if it is gone, and what to do
    since_s: float
    gone_s: float | None = None  #: since when what raised it is gone; None: it is there
    next: Cause | None = None  #: what ends it: a command, a time, or what must happen first
    raised: Cause | None = None  #: the evidence alone, as it was when it was raised
    when: tuple[tuple[str, Any], ...] = ()  #: its times and figures, as parameters of a cause

    @property
    def told(self) -> Cause:
        """All that a person reads of it: `cause` with its times and figures, and what ends it."""
        then = {"then": self.next} if self.next is not None else {}
        return self.cause.with_("", **dict(self.when), **then)


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
    """The current step in force, and the rule that bound it."""

    index: int  #: as the charger's protocol counts them: 0 (lowest) … 4
    current_a: float
    rule: Cause  #: what limits it, with the line that says so

    @property
    def key(self) -> str:
        """What bound it, the same however it is worded: "current.temperature_c.rows[0]"; "": nothing did."""
        return self.rule.key

    @property
    def place(self) -> str:
        """Where that stands, FILE:LINE."""
        return self.rule.place

    @property
    def number(self) -> int:
        """As people count them, on the charger's display too: 1 (lowest) … 5."""
        return self.index + 1

    @property
    def label(self) -> str:
        """For people: "step 2 (5.0 A)"."""
        return f"step {self.number} ({self.current_a:.1f} A)"


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
    pulse_s: float = 0.0  #: spent in pulse precharge …
    continuous_s: float = 0.0  #: … and in continuous precharge, pauses not counted
    rise_s: float = 0.0  #: spent in precharge since the pack's rise was last counted from the beginning …
    rise_v: float | None = None  #: … at this pack voltage; None: precharge has not begun
    full: Cause | None = None  #: by what the pack was found full; None while it is not …
    full_pct: float | None = None  #: … at which SOC …
    held_s: float = 0.0  #: … and for how long it has stayed on since
    unseen_s: float = 0.0  #: for so long it may have gone on before a kill, uncounted: the limits count it as charged
    result: Cause | None = None  #: why it ended; None while it goes on


@dataclass(frozen=True, slots=True)
class Decision:
    """What one `step()` says. The service carries out `command` and shows the rest."""

    state: State
    cause: Cause  #: why the bay is in this state
    command: Command | None = None  #: standing order for the charger's port; None: only poll
    setpoint: Setpoint = STANDBY
    step: Step | None = None  #: while energised
    faults: tuple[ActiveFault, ...] = ()  #: the most dangerous first
    alarm: Alarm = Alarm.NONE
    closed: bool = False  #: the contactor between charger and battery is to be closed
    session: Session | None = None  #: running, or just ended (`result` set, in this one decision)
    answer: Cause | None = None  #: why the operator's request was refused; None: it was not
