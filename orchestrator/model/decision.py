"""The core's input and output: a snapshot in, a decision out."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Any, NamedTuple

from orchestrator.model.battery import BatteryLink, BatteryReading
from orchestrator.model.cause import Cause
from orchestrator.model.charger import ChargeMode, ChargerLink, ChargerReading, Command, Precharge


class Request(StrEnum):
    """What an operator can request of a bay."""

    START = "start"
    PAUSE = "pause"
    STOP = "stop"
    RESET = "reset"


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything known about one bay at one moment; a decision depends only on this and the memory."""

    charger: ChargerReading | None = None
    charger_link: ChargerLink = ChargerLink()
    battery: BatteryReading = BatteryReading()
    battery_link: BatteryLink = BatteryLink()
    request: Request | None = None
    internal: str = ""  #: an exception in our own code, caught at the boundary, as text
    late_s: float = 0.0  #: how much later than planned this decision is made
    slept_s: float = 0.0  #: how long the whole machine was suspended since the previous decision
    not_persisted: Cause | None = (
        None  #: why faults that latch now would be forgotten by a restart; None while they would not
    )
    ending: Cause | None = None  #: why the service is about to end; None while it is not
    connected: bool = True  #: no contactor between charger and battery, or one that was closed for this reading
    contactor_problem: Cause | None = None  #: why the contactor cannot be driven
    waits: Cause | None = (
        None  #: why no charge may begin here right now, although nothing is wrong: another bay is beginning one
    )
    moves: str = ""  #: the other bay whose BMU saw the first amperes of this bay's charger, if that happened
    running_persisted: bool = True  #: the disk records that this bay's charger may be running
    asked_by: Cause | None = None  #: who made the request, when and why, as the cause that it becomes
    target_pct: float | None = None  #: to which SOC a requested start shall charge once; None: by the policy
    granted: int | None = (
        None  #: the level that the bay's supply grants: 0 none, 1 the lowest step …; None: no supply …
    )
    granted_why: Cause | None = None  #: … what binds that; always said where a level is
    supply_problem: Cause | None = None  #: why the supplies cannot be divided


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
    """What a fault does, mildest first; the highest of all active ones wins."""

    WARN = 1  #: reported, nothing else
    LIMIT = 2  #: charge on the lowest step only
    NO_START = 3  #: a running charge continues, none begins
    PAUSE = 4  #: stop, resume by itself once clear
    STOP = 5  #: stop; may resume after a backoff or an operator's start
    TRIP = 6  #: stop and latch until a person resets


class Alarm(IntEnum):
    """How urgently people must look at a bay; of several bays the highest counts."""

    NONE = 0  #: nobody needs to look: it works, rests, or is in standby at an operator's request
    ATTENTION = 1  #: its charger is in verified standby, and a fault waits for a person
    DANGER = 2  #: its charger is, or may be, out of control


class Account(NamedTuple):
    """What people read of an active fault, in parts."""

    cause: Cause  #: what, with its evidence as it is now, or as it was if it is gone, and what to do
    next: Cause | None = None  #: what ends it: a command, a time, or what must happen first
    when: tuple[tuple[str, Any], ...] = ()  #: its times and figures, as parameters of a cause


@dataclass(frozen=True, slots=True)
class ActiveFault:
    """One active fault, as the decisions use it and as status and journal show it.

    What people read of it is worked out when somebody reads it: decisions are many, and readers few.
    """

    id: str
    effect: Effect
    since_s: float
    account: Callable[[], Account] = field(repr=False, compare=False)
    gone_s: float | None = None  #: since when what raised it is gone; None: it is there
    raised: Cause | None = None  #: the evidence alone, as it was when it was raised

    @property
    def cause(self) -> Cause:
        """As in `Account`."""
        return self.account().cause

    @property
    def next(self) -> Cause | None:
        """As in `Account`."""
        return self.account().next

    @property
    def told(self) -> Cause:
        """All that a person reads of it: its cause with its times and figures, and what ends it."""
        account = self.account()
        then = {"then": account.next} if account.next is not None else {}
        return account.cause.with_("", **dict(account.when), **then)


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What the charger should be doing; None where the charger decides (automatic mode, standby)."""

    run: bool = False
    current_step: int | None = None
    charge_mode: ChargeMode | None = None
    precharge: Precharge | None = None


STANDBY = Setpoint()


@dataclass(frozen=True, slots=True)
class CurrentStep:
    """The current step in force, and the rule that limits it."""

    index: int  #: as in the charger's protocol: 0 (lowest) … 4
    current_a: float
    rule: Cause  #: what limits it, with the line that sets the limit

    @property
    def key(self) -> str:
        """The limiting key, independent of wording: "current.temperature_c.rows[0]"; "" if nothing limits it."""
        return self.rule.key

    @property
    def place(self) -> str:
        """Where that key is: FILE:LINE."""
        return self.rule.place

    @property
    def number(self) -> int:
        """As people and the charger's display count: 1 (lowest) … 5."""
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
    energised_s: float = 0.0  #: time during which the charger was commanded to run
    charged_ah: float = 0.0  #: integral of the charger's current
    charged_wh: float = 0.0
    soc_start_pct: float | None = None
    soc_pct: float | None = None
    step_changes: int = 0
    pulse_s: float = 0.0  #: spent in pulse precharge …
    continuous_s: float = 0.0  #: … and in continuous precharge, pauses not counted
    rise_s: float = 0.0  #: spent in precharge since the current rise window began …
    rise_v: float | None = None  #: … at this pack voltage; None: precharge has not begun
    full: Cause | None = None  #: the sign by which the pack was found full; None while it is not …
    full_pct: float | None = None  #: … the SOC at that moment …
    held_s: float = 0.0  #: … and how long charging has continued since
    unseen_s: float = 0.0  #: uncounted time that may have passed before a kill; the limits count it as charged
    result: Cause | None = None  #: why it ended; None while it continues


@dataclass(frozen=True, slots=True)
class Decision:
    """The result of one `decide()`. The service carries out `command` and shows the rest."""

    state: State
    cause: Cause  #: why the bay is in this state
    command: Command | None = None  #: repeated to the charger until confirmed; None: only poll
    setpoint: Setpoint = STANDBY
    step: CurrentStep | None = None  #: while energised
    faults: tuple[ActiveFault, ...] = ()  #: the most dangerous first
    alarm: Alarm = Alarm.NONE
    closed: bool = False  #: the contactor between charger and battery should be closed
    session: Session | None = None  #: running, or just ended (`result` set, in this one decision)
    answer: Cause | None = None  #: why the operator's request was refused; None: it was not
