"""The state machine as a picture, drawn from its own table; with a policy, arrows show when that policy takes them.

The table has more than seventy transitions, but few rules. So states are drawn in groups, and a transition common to a
whole group is one arrow; a transition from anywhere in a group to one of its own states is listed in the group's
heading.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from orchestrator.config.amperes import max_ah, taper_of
from orchestrator.config.policy import Policy
from orchestrator.core.machine import TABLE, Trigger
from orchestrator.core.states import ENERGISED, PRECHARGING, RESTING, UNVERIFIED, ordered
from orchestrator.model import State

Says = Callable[[Policy], Iterator[tuple[str, str]]]  #: the condition, and the policy key that sets it
Link = tuple[str, Trigger, State]  #: from a state or a group


@dataclass(frozen=True, slots=True)
class Group:
    """States with the same rows in the table; `lines` is the heading."""

    name: str
    states: tuple[State, ...]
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Arrow:
    """From a state or a group to another; `lines` lists the triggers and their conditions."""

    source: str
    dest: str
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Diagram:
    """The content of the picture; `single` are the states outside groups, `initial` is where a bay begins."""

    groups: tuple[Group, ...]
    single: tuple[State, ...]
    arrows: tuple[Arrow, ...]
    initial: State = State.STARTING


GROUPS = (
    Group("UNVERIFIED", ordered(UNVERIFIED), ("told to stop, not yet verified",)),
    Group("RESTING", ordered(RESTING), ("stands by, verified",)),
    Group("ENERGISED", ordered(ENERGISED), ("current flows",)),
)
GROUP_OF = {state: group.name for group in GROUPS for state in group.states}


def diagram(policy: Policy | None = None) -> Diagram:
    """The machine; with a policy, only the states that it uses, and with its thresholds."""
    used = [state for state in State if policy is None or policy.precharge is not None or state not in PRECHARGING]
    inside: dict[str, list[str]] = {group.name: [] for group in GROUPS}
    arrows: dict[tuple[str, str], list[str]] = {}
    links = list(_links(used))
    for source, trigger, dest in links:
        group = GROUP_OF.get(dest, "")
        if source == group:
            inside[group].append(f"{trigger} → {dest}")
        elif source in inside and sum(GROUP_OF.get(other) == group for from_, _, other in links if from_ == source) > 1:
            arrows.setdefault((source, group), []).append(trigger)
        else:
            arrows.setdefault((source, dest), []).extend((trigger, *_when(source, trigger, policy)))
    return Diagram(
        tuple(
            Group(one.name, tuple(state for state in one.states if state in used), (*one.lines, *inside[one.name]))
            for one in GROUPS
        ),
        tuple(state for state in used if state not in GROUP_OF),
        tuple(Arrow(source, dest, tuple(lines)) for (source, dest), lines in arrows.items()),
    )


def _links(used: list[State]) -> Iterator[Link]:
    """The table's transitions between these states; one shared by every state of a group belongs to the group."""
    for trigger, sources, dest in TABLE:
        if dest is None or dest not in used:
            continue
        whole = [group for group in GROUPS if set(group.states) <= set(sources)]
        yield from ((group.name, trigger, dest) for group in whole)
        grouped = {state for group in whole for state in group.states}
        yield from ((state, trigger, dest) for state in sources if state in used and state not in grouped)


# --- what a policy says ----------------------------------------------------------------------------------------------


def _arrives(p: Policy) -> Iterator[tuple[str, str]]:
    yield f"SOC below {p.start.soc_below_pct:g} %", "start.soc_below_pct"


def _recharges(p: Policy) -> Iterator[tuple[str, str]]:
    yield f"SOC below {p.recharge.soc_below_pct:g} %", "recharge.soc_below_pct"


def _wakes(p: Policy) -> Iterator[tuple[str, str]]:
    if p.precharge is not None:
        yield f"pack below {p.precharge.below_v:g} V", "precharge.below_v"


def _pulsed(p: Policy) -> Iterator[tuple[str, str]]:
    if p.precharge is not None:
        yield f"pack at {p.precharge.pulse.until_v:g} V", "precharge.pulse.until_v"
        yield f"or after {p.precharge.pulse.max_min:g} min", "precharge.pulse.max_min"


def _woken(p: Policy) -> Iterator[tuple[str, str]]:
    if p.precharge is not None:
        yield f"pack at {p.precharge.below_v:g} V", "precharge.below_v"


def _ends(p: Policy) -> Iterator[tuple[str, str]]:
    finish, full = p.finish, p.finish.full
    if finish.target_soc_pct < 100:
        yield f"target: SOC {finish.target_soc_pct:g} %", "finish.target_soc_pct"
    if full.soc_pct is not None:
        yield f"full: SOC {full.soc_pct:g} %", "finish.full.soc_pct"
    taper = taper_of(p)
    if taper is not None:
        yield f"full: below {taper.below_a:g} A above {taper.above_v:g} V", "finish.full.taper"
    if full.charger is not False:
        yield "full: the charger says so", "finish.full.charger"
    yield f"pause: outside {p.pack.temperature_c} °C", "pack.temperature_c"
    yield f"trip: {p.faults.temperature_trip_c:g} °C", "faults.temperature_trip_c"
    yield f"trip: above {p.pack.voltage_v.high:g} V", "pack.voltage_v"
    if finish.max_hours is not None:
        yield f"trip: {finish.max_hours:g} h", "finish.max_hours"
    yield f"trip: {max_ah(p.pack, finish):g} Ah", "finish.max_ah"
    yield "any other fault", ""


SAYS: Mapping[tuple[str, Trigger], Says] = {
    (State.IDLE, Trigger.QUALIFY): _arrives,
    (State.FULL, Trigger.QUALIFY): _recharges,
    (State.QUALIFYING, Trigger.PULSE): _wakes,
    (State.PRECHARGE_PULSE, Trigger.CONTINUE): _pulsed,
    (State.PRECHARGE_CONTINUOUS, Trigger.CHARGE): _woken,
    ("ENERGISED", Trigger.STOP): _ends,
}


def _when(source: str, trigger: Trigger, policy: Policy | None) -> Iterator[str]:
    """The conditions under which the policy takes this arrow, each with the line that sets it, unless a default."""
    says = SAYS.get((source, trigger))
    if policy is None or says is None:
        return
    for when, key in says(policy):
        line = policy.source.at(key).rpartition(":")[2] if key else ""
        yield f"{when} (line {line})" if line.isdigit() else when


# --- as text ---------------------------------------------------------------------------------------------------------


def mermaid(of: Diagram) -> str:
    """A Mermaid state diagram, for Markdown pages."""
    lines = ["stateDiagram-v2", f"    [*] --> {of.initial}"]
    for group in of.groups:
        lines.append(f'    state "{", ".join(group.lines)}" as {group.name} {{')
        lines += [f"        {state}" for state in group.states]
        lines.append("    }")
    lines += [f"    {state}" for state in of.single]
    lines += [f"    {arrow.source} --> {arrow.dest} : {'<br/>'.join(arrow.lines)}" for arrow in of.arrows]
    return "\n".join(lines) + "\n"
