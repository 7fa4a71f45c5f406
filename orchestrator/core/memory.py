"""What the core carries from one decision to the next, in frozen parts of plain values that can be written and read.

Theory of operation. Each part is made by one module (`MADE_BY` in `tests/core/test_parts.py`), from the facts and the
previous part. Nothing else can change it, and an unchanged part stays the same object. No two parts have a field of the
same name, so a record can hold them side by side; the fields declare what kind of value they carry (`parts.py`).
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
    """One row of the fault table whose condition is, or recently was, true."""

    present: bool = False  #: whether the condition was true at the last look …
    seen_s: float = 0.0  #: … and for how long it has been, draining while it is not
    polls: float = 0.0  #: charger readings that showed it, draining likewise
    poll_t_s: float = 0.0  #: the newest reading looked at
    raised_s: float | None = None  #: when it became a fault; None while it is being debounced
    clean_s: float | None = None  #: when the condition became false again
    cause: Cause | None = None  #: the evidence when it was raised
    latched: bool = False  #: a person must reset it
    strikes: tuple[float, ...] = ()  #: when it was raised within the last hour
    now: Cause | None = None  #: the evidence at the last look; None: the condition was false
    unheard: bool = False  #: nothing was heard, or looked for, at the last look, so it may only be unseen
    worst: float | None = None  #: the worst value of its one figure since it was raised, if it has one


@dataclass(frozen=True, slots=True)
class Still:
    """The charger's measurements, unchanged since `t_s`, and the BMU's at that time."""

    t_s: float
    volts: float
    amps: float
    pack_v: float
    pack_a: float


@dataclass(frozen=True, slots=True)
class Operator:
    """What an operator has asked of the bay."""

    hold: Cause | None = event(None)  #: why a person must start before the next charge; None: free to go
    paused: bool = event(default=False)  #: the operator paused the bay …
    paused_by: Cause | None = event(None)  #: … with this name; None: unknown
    resets: tuple[tuple[float, str], ...] = event(())  #: (when, fault id) of a person's resets in the last hour
    target_pct: float | None = event(None, tells=ANYWHERE)  #: the SOC to charge to once; None: by the policy …
    target_by: Cause | None = event(None)  #: … and who has asked for that; None: unknown


@dataclass(frozen=True, slots=True)
class Stop:
    """How the charger was stopped, and whether that is proved."""

    stop_cause: Cause | None = event(None)  #: why the last charge was stopped
    stopping_s: float | None = event(None)  #: since when a stop has been tried without lasting proof …
    verified_s: float | None = event(None)  #: … and when standby was last proved
    returns: int = event(0)  #: how often the charger has run again since that stop began
    unverified: bool = event(
        default=False, tells=SETTLED | {State.STARTING}
    )  #: the charger was told to run, perhaps by the previous run of the service, and
    #: has not been seen in standby since


@dataclass(frozen=True, slots=True)
class Stage:
    """Progress within the present state; every state begins with an empty one."""

    ran: bool = event(
        default=False, tells=ENERGISED
    )  #: the charger runs, or did: reported by itself, seen by the BMU, or deduced
    shown: bool = event(default=False)  #: the charger has shown the commanded mode
    qualified_s: float | None = event(None, tells=QUALIFYING)  #: since when every condition for a charge has held
    ready: bool = event(default=False)  #: every condition for a charge holds; it waits for its turn
    intends: bool = event(default=False, tells=QUALIFYING)  #: its turn has come; a charge begins once that is on disk
    reached_s: float | None = event(None, by_policy=True)  #: since when the pack has been at the stage's voltage
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

    runs_s: float | None = event(None)  #: since when the charger has reported that it runs or delivers current
    search_s: float = total(0.0)  #: how long a running charger has been searching for a battery …
    wake_s: float = total(0.0)  #: … recovering or precharging one by its own choice …
    idle_s: float = total(0.0)  #: … or delivering nothing; all three drain
    limit: int | None = event(None)  #: the current step that the charger shows …
    limit_before: int | None = event(None)  #: … the one that it showed before …
    limit_s: float = measured(0.0)  #: … and since when it has shown this one
    confirmed: bool = event(default=False)  #: the charger's newest reply showed the commanded step
    reverts: tuple[float, ...] = event(())  #: when a setting that the charger had confirmed reverted by itself
    still: Still | None = measured(None)  #: the charger's measurements, for as long as they do not change
    counted_t_s: float | None = measured(None)  #: the reading up to which the session's Ah are counted


@dataclass(frozen=True, slots=True)
class BatteryHistory:
    """What the bay's battery has reported until now, and whether it was removed."""

    boots: int = event(0)  #: boot-ups of the BMU already dealt with
    full_s: float | None = event(None)  #: when it was last charged all the way; before that, when it was first seen
    full_pct: float | None = event(
        None, tells=ANYWHERE
    )  #: its SOC when it was charged full here; None: it was not, or this may be another battery
    serial: int | None = event(None)  #: the serial number of the battery that was last here; None: it has none
    another: bool = event(default=False)  #: what is there, or comes next, may be another battery than the last one
    sight: tuple[float, float | None] | None = measured(None)  #: when the charger last saw the pack of a silent BMU,
    #: and its volts; None: the BMU is heard
    left_s: float | None = event(None)  #: when it was removed in mid-charge; None: it was not, or that is dealt with
    left_as: tuple[float | None, float | None] = event((None, None))  #: … and its SOC and volts then
    returned_s: float | None = event(None)  #: when one returned so soon that only its plug can have been loose
    charge: tuple[float, float | None] = measured((0.0, None))  #: (t_s, SOC), the newest; None: none so far
    charge_step: tuple[float, Cause] | None = event(None)  #: when the SOC took a step that no charge explains
    exchange: tuple[float, Cause] | None = event(None)  #: the same across a gap in which the BMU was not seen
    peak: tuple[float, float] | None = measured(None)  #: (t_s, SOC) of the highest SOC of the charger's present run
    sample: tuple[float, float] | None = measured(None)  #: (t_s, °C), the newest …
    sample_before: tuple[float, float] | None = measured(None)  #: … and the one before
    warmth: tuple[tuple[float, float], ...] = measured(())  #: (t_s, °C) of the last minutes, oldest first


@dataclass(frozen=True, slots=True)
class Tables:
    """Which of the policy's rows are in force (`core/rows.py`)."""

    rows: tuple[tuple[str, int], ...] = event((), by_policy=True)  #: of each table …
    row_returns: tuple[tuple[str, int], ...] = event((), by_policy=True)  #: … and how often each lowered the step
    #: in this charge


@dataclass(frozen=True, slots=True)
class Memory:
    """`decide()` takes one and returns the next."""

    state: State = event(State.STARTING)
    since_s: float | None = event(None)  #: when the state was entered; None before the first decision
    last_s: float | None = measured(None)  #: when the last decision was made
    looked_s: float | None = measured(None)  #: when the fault table was last evaluated
    stalled_s: float | None = event(None)  #: when this service was last found to have stood still
    cause: Cause = measured(Cause("service_started"))
    closed: bool = event(default=False)  #: the contactor is to be closed
    faults: Mapping[str, FaultMemory] = field(default_factory=dict)  #: fault rows that are or were true
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
#: The parts whose fields stand beside the memory's own wherever it is written.
FLAT = tuple(name for name in PARTS if name not in ("cause", "witnessed"))
#: The part that holds each value: its name → the part.
PART_OF = {one.name: part for part in FLAT for one in fields(PARTS[part])}
#: The kinds of the fields of those records that are not parts.
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
    """The names of all values, side by side."""
    return [name for name in (one.name for one in fields(Memory)) if name not in FLAT] + list(PART_OF)


def paths(kind: Kind) -> list[str]:
    """The paths of all values of this kind, from the memory on: "stage.ran"."""
    inside = [f"{part}.{name}" for part, one in PARTS.items() for name in of_kind(one, kind)]
    return [*of_kind(Memory, kind), *inside]


def telling(state: State) -> list[str]:
    """The paths of all values that tell two memories in this state apart."""
    return [
        f"{part}.{one.name}" for part, kind in PARTS.items() for one in fields(kind)
        if state in one.metadata.get("tells", ())
    ]  # fmt: skip


def by_policy() -> list[str]:
    """The names of the values that depend on the policy alone: its debounces and holds."""
    kept = [one.name for part in FLAT for one in fields(PARTS[part]) if one.metadata["by_policy"]]
    return ["faults", *kept]


def value_of(memory: Memory, name: str) -> Any:  # noqa: ANN401 - any field
    """The value of this name, in whichever part it is."""
    return getattr(getattr(memory, PART_OF[name]) if name in PART_OF else memory, name)


def with_values(memory: Memory, **values: Any) -> Memory:  # noqa: ANN401 - any field
    """The memory with other values by name, to begin a new one or to try what another would lead to."""
    own: dict[str, Any] = {name: value for name, value in values.items() if name not in PART_OF}
    for part in FLAT:
        others = {name: value for name, value in values.items() if PART_OF.get(name) == part}
        if others:
            own[part] = changed(getattr(memory, part), **others)
    return changed(memory, **own)


def side_by_side(memory: Memory) -> dict[str, Any]:
    """All values by name, as the journal holds them."""
    return {name: value_of(memory, name) for name in names()}


def in_parts(values: Mapping[str, Any]) -> dict[str, Any]:
    """The inverse of `side_by_side`: each value in its part."""
    found: dict[str, Any] = {part: {} for part in FLAT}
    for name, value in values.items():
        (found[PART_OF[name]] if name in PART_OF else found)[name] = value
    return found
