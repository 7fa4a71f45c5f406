"""What the core carries from one decision to the next, in frozen parts. Plain values only, so that it can be written
down and read again.

Theory of operation. Each part is made by one module (`MADE_BY`), from the facts and the part as it was: nobody else can
change it, and what has not changed is the same object. No two parts have a field of the same name, so that a record
can hold them side by side; the fields say what kind of thing they carry (`parts.py`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from orchestrator.core.parts import Kind, changed, event, measured, of_kind, total
from orchestrator.core.states import ENERGISED, SETTLED
from orchestrator.core.witnesses.followed import Witnessed
from orchestrator.model import Cause, Command, CurrentStep, Session, State

ANYWHERE, QUALIFYING = frozenset(State), frozenset({State.QUALIFYING})


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
    unheard: bool = False  #: whether it may only be unseen: a device was not heard at the last look
    worst: float | None = None  #: the worst value of its one figure since it was raised, if it has one


@dataclass(frozen=True, slots=True)
class Still:
    """What the charger has measured since `t_s` without any change, and what the BMU measured then."""

    t_s: float
    volts: float
    amps: float
    pack_v: float
    pack_a: float


@dataclass(frozen=True, slots=True)
class Operator:
    """What an operator wants of the bay."""

    hold: Cause | None = event(None)  #: why a person must start before the next charge; None is free to go
    paused: bool = event(default=False)  #: the operator paused the bay
    resets: tuple[tuple[float, str], ...] = event(())  #: (when, fault id) of a person's resets within the last hour


@dataclass(frozen=True, slots=True)
class Stop:
    """How the charger was stopped, and whether that is proved."""

    stop_cause: Cause | None = event(None)  #: why the last charge was stopped
    stopping_s: float | None = event(None)  #: since when a stop has been tried that was not proved to last …
    verified_s: float | None = event(None)  #: … and when standby was last proved
    returns: int = event(0)  #: how often the charger has run again since that stop began
    unverified: bool = event(
        default=False, tells=SETTLED | {State.STARTING}
    )  #: the charger was told to run, perhaps by the last run of the service, and
    #: has not been seen to stand by since


@dataclass(frozen=True, slots=True)
class Stage:
    """What the present state has come to; every state begins with an empty one."""

    ran: bool = event(
        default=False, tells=ENERGISED
    )  #: the charger runs, or did: by its own word, by the BMU's, or by what it left
    shown: bool = event(default=False)  #: the charger has shown the mode that it was told
    qualified_s: float | None = event(None, tells=QUALIFYING)  #: since when everything has spoken for a charge
    ready: bool = event(default=False)  #: everything speaks for a charge; it waits for its turn
    intends: bool = event(default=False, tells=QUALIFYING)  #: it is its turn, and a charge begins once that is on disk
    reached_s: float | None = event(None, by_policy=True)  #: since when the pack has been above the stage's voltage
    taper_s: float | None = event(None, by_policy=True)  #: since when the current has been tapered off
    step: CurrentStep | None = measured(None, by_policy=True)  #: while energised
    raise_s: float | None = event(None, by_policy=True)  #: since when a higher step has been allowed


@dataclass(frozen=True, slots=True)
class Sequence:
    """How far the charger has been brought to its setpoint."""

    command: Command | None = event(None, tells=ENERGISED)  #: what the sequence is waiting to see confirmed …
    command_s: float = measured(0.0)  #: … since when
    tries: int = measured(0)  #: … and how often the resume was repeated for it
    resumed: bool = event(default=False)  #: the charger was brought back from standby …
    resume_s: float = measured(0.0)  #: … by a resume sent after this moment


@dataclass(frozen=True, slots=True)
class ChargerHistory:
    """What the charger has shown until now."""

    runs_s: float | None = event(None)  #: since when the charger has reported that it runs, or delivers current
    search_s: float = total(0.0)  #: how long a running charger has been looking for a battery …
    wake_s: float = total(0.0)  #: … recovering or precharging one by its own choice …
    idle_s: float = total(0.0)  #: … and delivering nothing; they drain
    limit: int | None = event(None)  #: the current-limit step that the charger shows …
    limit_before: int | None = event(None)  #: … the one that it showed before …
    limit_s: float = measured(0.0)  #: … and since when it shows this one
    confirmed: bool = event(default=False)  #: the charger's newest reply showed the step that it was told
    reverts: tuple[float, ...] = event(())  #: when a setting that the charger had confirmed went back by itself
    still: Still | None = measured(None)  #: the charger's measurements, for as long as they do not change
    counted_t_s: float | None = measured(None)  #: the reading up to which the session's Ah are counted


@dataclass(frozen=True, slots=True)
class BatteryHistory:
    """What the bay's battery has told until now, and what became of it."""

    boots: int = event(0)  #: boot-ups of the BMU that were dealt with
    full_s: float | None = event(None)  #: when it was last charged all the way; before that, first seen
    full_pct: float | None = event(
        None, tells=ANYWHERE
    )  #: the SOC at which it was charged full here; None: it was not, or it left
    left_s: float | None = event(None)  #: when it left in mid-charge; None: it did not, or that is dealt with
    left_as: tuple[float | None, float | None] = event((None, None))  #: … and with which SOC and volts
    returned_s: float | None = event(None)  #: when one came back so soon that only its plug can have been loose
    charge: tuple[float, float | None] = measured((0.0, None))  #: (t_s, SOC), the newest; None since it is here
    charge_step: tuple[float, Cause] | None = event(None)  #: when the SOC took a step that no charge explains
    exchange: tuple[float, Cause] | None = event(None)  #: the same over a gap in which nobody could see the BMU
    peak: tuple[float, float] | None = measured(None)  #: (t_s, SOC) of the highest SOC of the charger's present run
    sample: tuple[float, float] | None = measured(None)  #: (t_s, °C), the newest …
    sample_before: tuple[float, float] | None = measured(None)  #: … and the one before
    warmth: tuple[tuple[float, float], ...] = measured(())  #: (t_s, °C) of the last minutes, oldest first


@dataclass(frozen=True, slots=True)
class Tables:
    """Which of the policy's rows are in force (`core/rows.py`)."""

    rows: tuple[tuple[str, int], ...] = event((), by_policy=True)  #: of each table …
    row_returns: tuple[tuple[str, int], ...] = event((), by_policy=True)  #: … and how often each brought the step down
    #: in this charge


@dataclass(frozen=True, slots=True)
class Memory:
    """`decide()` is given one and returns the next."""

    state: State = event(State.STARTING)
    since_s: float | None = event(None)  #: when the state was entered; None before the first step
    last_s: float | None = measured(None)  #: when the last step was taken
    looked_s: float | None = measured(None)  #: when the fault table was last looked through
    cause: Cause = measured(Cause("service_started"))
    closed: bool = event(default=False)  #: the contactor is to be closed
    faults: Mapping[str, FaultMemory] = field(default_factory=dict)  #: what of the fault table is, or lately was
    session: Session | None = None  #: the open charge
    witnessed: Witnessed = Witnessed()  #: what both witnesses have shown
    operator: Operator = Operator()
    stop: Stop = Stop()
    stage: Stage = Stage()
    sequence: Sequence = Sequence()
    charger: ChargerHistory = ChargerHistory()
    battery: BatteryHistory = BatteryHistory()
    tables: Tables = Tables()


#: Each part: its name → its class.
PARTS: Mapping[str, type[Any]] = {one.name: type(one.default) for one in fields(Memory) if is_dataclass(one.default)}
#: The parts whose fields stand side by side with the memory's own, wherever it is written down.
FLAT = tuple(name for name in PARTS if name not in ("cause", "witnessed"))
#: Where each value is to be found: its name → the part that it is in.
PART_OF = {one.name: part for part in FLAT for one in fields(PARTS[part])}
#: What the fields of the records are that are no parts.
RECORDS: Mapping[type[Any], Mapping[Kind, tuple[str, ...]]] = {
    FaultMemory: {
        Kind.EVENT: ("present", "raised_s", "clean_s", "latched", "strikes"),
        Kind.MEASURED: ("seen_s", "polls", "poll_t_s", "cause", "now", "unheard", "worst"),
    },
    Session: {
        Kind.EVENT: ("rise_v", "full"),
        Kind.MEASURED: (
            "started_s", "elapsed_s", "energised_s", "charged_ah", "charged_wh", "soc_start_pct", "soc_pct",
            "step_changes", "pulse_s", "continuous_s", "rise_s", "full_pct", "held_s", "unseen_s", "result",
        ),
    },
}  # fmt: skip


def names() -> list[str]:
    """Of all values, as they stand side by side."""
    return [name for name in (one.name for one in fields(Memory)) if name not in FLAT] + list(PART_OF)


def paths(kind: Kind) -> list[str]:
    """Where to find all values of this kind, from the memory on: "stage.ran"."""
    inside = [f"{part}.{name}" for part, one in PARTS.items() for name in of_kind(one, kind)]
    return [*of_kind(Memory, kind), *inside]


def telling(state: State) -> list[str]:
    """Where to find all that tells two memories in this state apart."""
    return [
        f"{part}.{one.name}" for part, kind in PARTS.items() for one in fields(kind)
        if state in one.metadata.get("tells", ())
    ]  # fmt: skip


def by_policy() -> list[str]:
    """The names of what the policy alone keeps: its own debounces and holds."""
    kept = [one.name for part in FLAT for one in fields(PARTS[part]) if one.metadata["by_policy"]]
    return ["faults", *kept]


def value_of(memory: Memory, name: str) -> Any:  # noqa: ANN401 - any field
    """The value of this name, in whatever part it is."""
    return getattr(getattr(memory, PART_OF[name]) if name in PART_OF else memory, name)


def with_values(memory: Memory, **values: Any) -> Memory:  # noqa: ANN401 - any field
    """The memory with other values by name: for who begins one anew, or tries what another one would lead to."""
    own: dict[str, Any] = {name: value for name, value in values.items() if name not in PART_OF}
    for part in FLAT:
        others = {name: value for name, value in values.items() if PART_OF.get(name) == part}
        if others:
            own[part] = changed(getattr(memory, part), **others)
    return changed(memory, **own)


def side_by_side(memory: Memory) -> dict[str, Any]:
    """All values by name, as the journal has them."""
    return {name: value_of(memory, name) for name in names()}


def in_parts(values: Mapping[str, Any]) -> dict[str, Any]:
    """The other way round: each value in its part."""
    found: dict[str, Any] = {part: {} for part in FLAT}
    for name, value in values.items():
        (found[PART_OF[name]] if name in PART_OF else found)[name] = value
    return found
