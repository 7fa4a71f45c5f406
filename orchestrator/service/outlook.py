"""A bay's part of the status that looks around and ahead: since when, what limits it, what comes next, for how long."""

from collections.abc import Iterator

from orchestrator.core.demand import WAITS
from orchestrator.core.facts import Facts
from orchestrator.core.finish import goes_full, once, target
from orchestrator.core.limits import bounds, limit, lowest
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.core.states import BY_PERSON
from orchestrator.model import Cause, Decision, Effect, Snapshot, State
from orchestrator.model.bay_document import Outlook
from orchestrator.model.cause import SEVERAL
from orchestrator.model.document import Forecast, Limit, Target
from orchestrator.service.forecast import bmu_minutes, own_minutes
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import as_told, fields, say

#: What comes next where neither the reason nor a fault says it. CHARGING has sentences of its own.
NEXT = {
    State.STARTING: "next_standby",
    State.STOPPING: "next_standby",
    State.OFFLINE: "next_answers",
    State.IDLE: "next_battery",
    State.HELD: "next_start",
    State.QUALIFYING: "next_checked",
    State.PRECHARGE_PULSE: "next_precharged",
    State.PRECHARGE_CONTINUOUS: "next_precharged",
    State.FULL: "next_recharge",
    State.SUSPENDED: "next_clears",
    State.TRIPPED: "next_reset",
    State.UNCONTROLLABLE: "next_mains",
}
#: What says of a bay in another state that a person must start it.
TO_GO_ON = "to_go_on"


def outlook(
    decision: Decision,
    snapshot: Snapshot,
    memory: Memory | None,
    rules: Rules,
    clock: WallClock,
    language: str,
    *,
    closely: bool,
) -> Outlook:
    """`since` and `at` are Unix time. Only `closely` there are `limits` and `forecast`, which cost most of it.

    Nothing but `next` is known before the first decision.
    """
    coming = next_of(decision, rules)
    told, at_s = as_told(clock.told(coming), language), _moment(coming, clock)
    since_s = memory.since_s if memory is not None else None
    asked = once(memory.operator) if memory is not None else None
    found: Outlook = {
        "since": round(clock.unix_s(since_s), 3) if since_s is not None else None,
        "next": {**told, "by_itself": by_itself(decision), "at": at_s},
        "target": None if asked is None else _target(asked, clock, language),
    }
    if not closely or memory is None or memory.last_s is None:
        return found
    f = Facts.of(memory.last_s, snapshot, memory, rules)
    return {**found, "limits": list(_limits(f, decision, clock, language)), "forecast": forecast(f, clock)}


def _target(asked: Cause, clock: WallClock, language: str) -> Target:
    return {"soc_pct": asked.param("target_pct"), **as_told(clock.told(asked), language)}


# --- what limits it ---------------------------------------------------------------------------------------------------


def _limits(f: Facts, decision: Decision, clock: WallClock, language: str) -> Iterator[Limit]:
    """What limits the current, the lowest first, and then what else bounds a charge."""
    for allowed_a, cause, binds in current_limits(f, decision):
        told = as_told(clock.told(cause), language)
        yield {"allowed_a": allowed_a, "binds": binds, "cause": told, "text": told["text"]}
    for cause in charge_limits(f.rules):
        yield {"allowed_a": None, "binds": False, "cause": fields(cause, language), "text": say(cause, language)}


def current_limits(f: Facts, decision: Decision) -> Iterator[tuple[float, Cause, bool]]:
    """Everything that limits the current now: the amperes that it allows, and whether it sets the step."""
    worst, step = decision.faults[0] if decision.faults else None, decision.step
    least = lowest(f, worst)
    key = step.key if step is not None else least.key if least.allowed_a < f.rules.worst_a[-1] else ""
    why = f.snapshot.granted_why if decision.cause.id == WAITS else None
    found = [(one.allowed_a, limit(f, one), not why and bool(key) and one.key == key) for one in bounds(f, worst)]
    if why is not None:  # the others say what the bay could use
        found.append((0.0, why, True))
    if step is not None and step.key and not any(binds for *_, binds in found):  # precharge, or a row just left
        found.append((f.rules.worst_a[step.index], step.rule, True))
    return iter(sorted(found, key=lambda one: (not one[2], one[0])))


def charge_limits(rules: Rules) -> Iterator[Cause]:
    """What else bounds a charge: volts, temperature, ampere-hours and hours."""
    policy, limits = rules.policy, rules.bay.limits
    by_policy = policy.pack.voltage_v.high <= limits.voltage_v
    key, source = ("pack.voltage_v", policy.source) if by_policy else ("limits.voltage_v", rules.bay.source)
    yield Cause.of("limit_volts", key=key, place=source.at(key), most_v=rules.max_v)
    (low_key, low_place), (high_key, high_place) = rules.coldest_at, rules.hottest_at
    same = low_key == high_key
    yield Cause.of(
        "limit_temperature",
        key=high_key,
        place=high_place if same else f"{low_place}, {high_place}",
        low=rules.temperature_c.low,
        high=rules.temperature_c.high,
    )
    for id_, key, most in (
        ("limit_ah", "finish.max_ah", rules.max_ah),
        ("limit_h", "finish.max_hours", rules.max_hours),
    ):
        yield Cause.of(id_, key=key, place=policy.source.at(key), most=most)


# --- what comes next --------------------------------------------------------------------------------------------------


def next_of(decision: Decision, rules: Rules) -> Cause:
    """What happens next, and whose turn it is: as the reason says it, else the worst fault, else the state."""
    said = list(_thens(decision.cause))
    if said:
        return said[0]
    waits = decision.state in BY_PERSON or decision.state is State.SUSPENDED
    ends = next((one.next for one in decision.faults if waits and one.effect >= Effect.NO_START), None)
    if ends is not None:
        return ends
    if decision.state is State.CHARGING:
        return Cause("next_full")
    return Cause.of(NEXT[decision.state], bay=rules.bay.name)


def by_itself(decision: Decision) -> bool:
    """Whether the bay goes on without a person."""
    return decision.state not in BY_PERSON and all(one.id != TO_GO_ON for one in _thens(decision.cause))


def _thens(cause: Cause) -> Iterator[Cause]:
    """What a reason says that comes next."""
    then, parts = cause.param("then"), cause.param("whats") if cause.id == SEVERAL else None
    if isinstance(then, Cause):
        yield then
    for part in parts if isinstance(parts, tuple) else ():
        yield from _thens(part) if isinstance(part, Cause) else ()


def _moment(cause: Cause, clock: WallClock) -> float | None:
    """When that is, as far as known."""
    until_s = cause.param("until_t_s")
    return round(clock.unix_s(until_s), 3) if isinstance(until_s, int | float) else None


# --- how long ---------------------------------------------------------------------------------------------------------


def forecast(f: Facts, clock: WallClock) -> Forecast | None:
    """The target of the charge, and how long it still takes by the BMU and by ourselves; None without a charge."""
    if f.memory.session is None or not f.energised:
        return None
    target_pct, key = target(f)
    bmu, own = bmu_minutes(f), own_minutes(f)
    return {
        "target_soc_pct": target_pct,
        "goes_full": goes_full(f),
        "key": key,
        "place": f.rules.policy.source.at(key) if key else "",
        "bmu_min": bmu,
        "bmu_at": _after(bmu, clock),
        "own_min": round(own, 1) if own is not None else None,
        "own_at": _after(own, clock),
    }


def _after(minutes: float | None, clock: WallClock) -> float | None:
    return round(clock.wall_s + 60 * minutes, 3) if minutes is not None else None
