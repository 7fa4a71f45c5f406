"""What the core carries from one step to the next. Plain values only, so that it can be written down and read again."""

from dataclasses import dataclass, field

from orchestrator.core.witnesses.followed import Witnessed
from orchestrator.model import Cause, Command, Session, State, Step


@dataclass(frozen=True, slots=True)
class FaultMemory:
    """One row of the fault table whose condition is, or lately was, true."""

    present: bool = False  #: whether the condition was true at the last look …
    seen_s: float = 0.0  #: … and for how long it has been, draining while it is not
    polls: float = 0.0  #: charger readings that showed it, draining likewise
    poll_t_s: float = 0.0  #: the newest reading that was looked at
    raised_s: float | None = None  #: when it became a fault, None while it is being debounced
    clean_s: float | None = None  #: when the condition became false again
    cause: Cause | None = None  #: what was seen when it was raised
    latched: bool = False  #: a person must reset it
    strikes: tuple[float, ...] = ()  #: when it was raised within the last hour
    now: Cause | None = None  #: what was seen at the last look; None: it was not there
    worst: float | None = None  #: the worst value of its one figure since it was raised, if it has one


@dataclass(frozen=True, slots=True)
class Still:
    """What the charger has measured since `t_s` without any change, and what the BMU measured then."""

    t_s: float
    volts: float
    amps: float
    pack_v: float
    pack_a: float


@dataclass  # no slots: every step makes a copy, and a dict is copied four times as fast
class Memory:
    """`step()` changes a copy of its own, never the one it was given."""

    state: State = State.STARTING
    since_s: float | None = None  #: when the state was entered; None before the first step
    last_s: float | None = None  #: when the last step was taken
    looked_s: float | None = None  #: when the fault table was last looked through
    cause: Cause = Cause("service_started")
    faults: dict[str, FaultMemory] = field(default_factory=dict)
    stop_cause: Cause | None = None  #: why the last charge was stopped
    resets: tuple[tuple[float, str], ...] = ()  #: (when, fault id) of a person's resets within the last hour
    hold: Cause | None = None  #: why a person must start before the next charge; None is free to go
    paused: bool = False  #: the operator paused the bay
    stopping_s: float | None = None  #: since when a stop has been tried that was not proved to last …
    verified_s: float | None = None  #: … and when standby was last proved
    returns: int = 0  #: how often the charger has run again since that stop began
    left_s: float | None = None  #: when the battery left in mid-charge; None: it did not, or that is dealt with
    left_as: tuple[float | None, float | None] = (None, None)  #: … and with which SOC and volts
    returned_s: float | None = None  #: when a battery came back so soon that only its plug can have been loose
    reverts: tuple[float, ...] = ()  #: when a setting that the charger had confirmed went back by itself
    confirmed: bool = False  #: the charger's newest reply showed the step that it was told
    search_s: float = 0.0  #: how long a running charger has been looking for a battery …
    wake_s: float = 0.0  #: … and recovering or precharging one by its own choice; both drain
    full_s: float | None = None  #: when the battery of this bay was last charged all the way; before that, first seen
    full_pct: float | None = None  #: the SOC at which this battery was charged full here; None: it was not, or it left
    boots: int = 0  #: boot-ups of the BMU that were dealt with
    session: Session | None = None
    counted_t_s: float | None = None  #: the charger reading up to which the session's Ah are counted
    resumed: bool = False  #: the charger was brought back from standby …
    resume_s: float = 0.0  #: … by a resume sent after this moment
    ran: bool = False  #: the charger runs, or did, in this stage: by its own word, by the BMU's, or by what it left
    shown: bool = False  #: the charger has shown the mode that it was told, in this stage
    order: Command | None = None  #: what the sequence is waiting to see confirmed …
    order_s: float = 0.0  #: … since when
    tries: int = 0  #: … and how often the resume was repeated for it
    qualified_s: float | None = None  #: since when everything has spoken for a charge
    rows: tuple[tuple[str, int], ...] = ()  #: which row of each of the policy's tables is in force (`core/rows.py`) …
    row_returns: tuple[tuple[str, int], ...] = ()  #: … and how often each brought the step down in this charge
    step: Step | None = None
    raise_s: float | None = None  #: since when a higher step has been allowed
    taper_s: float | None = None  #: since when the current has been tapered off
    reached_s: float | None = None  #: since when the pack has been above the stage's voltage
    sample: tuple[float, float] | None = None  #: (t_s, °C), the newest …
    sample_before: tuple[float, float] | None = None  #: … and the one before
    charge: tuple[float, float | None] = (0.0, None)  #: (t_s, SOC), the newest; None since this battery is here
    charge_step: tuple[float, Cause] | None = None  #: when the SOC took a step that no charge explains, and which
    exchange: tuple[float, Cause] | None = None  #: the same over a gap in which nobody could see the BMU
    peak: tuple[float, float] | None = None  #: (t_s, SOC) of the highest SOC of the present run of the charger
    warmth: tuple[tuple[float, float], ...] = ()  #: (t_s, °C) of the last minutes, oldest first
    runs_s: float | None = None  #: since when the charger has reported that it runs, or delivers current
    idle_s: float = 0.0  #: how long a running charger has delivered nothing; drains
    limit: int | None = None  #: the current-limit step that the charger shows …
    limit_before: int | None = None  #: … the one that it showed before …
    limit_s: float = 0.0  #: … and since when it shows this one
    still: Still | None = None  #: the charger's measurements, for as long as they do not change
    witnessed: Witnessed = Witnessed()
    closed: bool = False  #: the contactor is to be closed
    ready: bool = False  #: everything speaks for a charge; it waits for its turn
    intends: bool = False  #: it is its turn, and a charge begins once that is on disk
    unverified: bool = False  #: the charger was told to run, perhaps by the last run of the service, and has not been
    #: seen to stand by since

    def copy(self) -> "Memory":
        """An independent copy."""
        copy = object.__new__(Memory)
        copy.__dict__.update(self.__dict__, faults=dict(self.faults))
        return copy
