"""When a charge is over, at its edges: the whole cause, with its key and every figure."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.config.policy import Needs, Policy
from orchestrator.core import limits
from orchestrator.core.facts import Facts
from orchestrator.core.finish import (
    ends_full,
    ends_hold,
    finished,
    full_due,
    goes_on,
    known_full,
    tapered_a,
    target,
)
from orchestrator.core.machine import Trigger
from orchestrator.core.memory import Stage
from orchestrator.core.next_transition import next_transition
from orchestrator.core.resting import resting_place
from orchestrator.core.rules import Bound, Rules
from orchestrator.core.witnesses.followed import Sample
from orchestrator.keys import Range
from orchestrator.model import Cause, ChargeMode, ControlMode, CurrentStep, Session, State
from tests.core.bays import POLICY
from tests.core.edges import CONTINUOUS, NOW_S, PULSE, Edge, ago, by_policy, witnessed
from tests.core.said import cause
from tests.core.world import bay, remembering, with_full

DAY_S = 86400.0
FOUND = cause("found full")
SAYS_FULL = {"charge_mode": ChargeMode.FULL}


def finishing(**changes: Any) -> Policy:
    return replace(POLICY, finish=replace(POLICY.finish, **changes))


HOLDS, TO_80 = finishing(hold_min=30.0), finishing(target_soc_pct=80.0)
FORTNIGHTLY = finishing(target_soc_pct=80.0, full_every_days=14.0)
BY_TAPER = replace(HOLDS, finish=replace(with_full(soc_pct=None).finish, hold_min=30.0))


def held(seconds: float, full: Cause | None = FOUND) -> dict[str, Any]:
    """The pack was found full, and has been charged for so long since."""
    return {"session": Session(0.0, full=full, held_s=seconds, charged_ah=1.0)}


def trail(*samples: tuple[float, float]) -> dict[str, Any]:
    """Seconds ago, and the current; oldest first, at 53 V, without a step."""
    return witnessed(trail=tuple(Sample(ago(age_s), 53.0, amps, 53.0, amps) for age_s, amps in samples))


SOC_80 = by_policy("full_soc", "finish.target_soc_pct", soc_pct=80.0, limit_pct=80.0)
SOC_100 = by_policy("full_soc", "finish.full.soc_pct", soc_pct=100.0, limit_pct=100.0)
FULL_HELD = by_policy("full_held", "finish.hold_min", what=FOUND, hold_min=30.0)
NOT_HELD = by_policy("not_held_yet", "finish.hold_min", hold_min=30.0)
NOT_KNOWN = by_policy("not_known_full", "finish.full")
STEP_1_A = {"step": CurrentStep(0, 1.0, cause(""))}
FINISH = (
    # a target below 100 %
    Edge(finished, SOC_80, policy=TO_80, bmu={"soc_pct": 80.0}),
    Edge(finished, None, policy=TO_80, bmu={"soc_pct": 79.9}),
    Edge(finished, None, policy=TO_80, bmu={"soc_pct": None}),
    # a hold at the top
    Edge(finished, None, held(1799.9), policy=HOLDS),
    Edge(finished, FULL_HELD, held(1800), policy=HOLDS),
    Edge(finished, FOUND, held(0)),
    Edge(finished, None, held(0, None)),
    Edge(finished, FOUND, held(60), policy=HOLDS, charger=SAYS_FULL),
    Edge(ends_hold, FOUND, held(60), charger=SAYS_FULL),
    Edge(ends_hold, None, held(60)),
    Edge(ends_hold, None, {**held(60), "ran": False}, charger=SAYS_FULL),
    Edge(ends_hold, None, charger=SAYS_FULL),
    Edge(ends_hold, None, held(60, None), charger=SAYS_FULL),
    # a charge that was interrupted
    Edge(goes_on, NOT_HELD, held(1799.9), policy=HOLDS),
    Edge(goes_on, NOT_HELD, held(1799.9), policy=BY_TAPER),
    Edge(goes_on, None, held(1800), policy=HOLDS),
    Edge(goes_on, None, held(1800), policy=BY_TAPER),
    Edge(goes_on, NOT_KNOWN, held(0, None), policy=BY_TAPER),
    Edge(goes_on, None, held(0, None), policy=HOLDS),
    Edge(goes_on, None, policy=BY_TAPER),
    Edge(goes_on, None, held(0), policy=TO_80),
    # all the way, every fortnight
    Edge(full_due, True, {"full_s": ago(14 * DAY_S)}, policy=FORTNIGHTLY),
    Edge(full_due, False, {"full_s": ago(14 * DAY_S - 1)}, policy=FORTNIGHTLY),
    Edge(full_due, False, policy=FORTNIGHTLY),
    Edge(full_due, False, {"full_s": ago(14 * DAY_S)}, policy=TO_80),
    Edge(target, (100.0, "finish.full_every_days"), {"full_s": ago(14 * DAY_S)}, policy=FORTNIGHTLY),
    Edge(target, (80.0, "finish.target_soc_pct"), {"full_s": ago(13 * DAY_S)}, policy=FORTNIGHTLY),
    Edge(goes_on, None, {**held(0), "full_s": ago(13 * DAY_S)}, policy=FORTNIGHTLY),
    # the signs
    Edge(known_full, SOC_100, policy=with_full(needs=Needs.ALL, taper=None, charger=False), bmu={"soc_pct": 100.0}),
    Edge(known_full, None, policy=with_full(needs=Needs.ALL, taper=None, charger=False), bmu={"soc_pct": 99.9}),
    Edge(known_full, None, policy=with_full(needs=Needs.ALL, charger=False), bmu={"soc_pct": 100.0}),
    Edge(known_full, Cause.of("full_by_all", whats=(
        SOC_100, by_policy("full_taper", "finish.full.taper", charger_a=10.0, below_a=1.0, for_s=120.0))),
        {"taper_s": ago(120)}, policy=with_full(needs=Needs.ALL, charger=False), bmu={"soc_pct": 100.0}),
    # what has tapered off
    Edge(tapered_a, 1.0),
    Edge(tapered_a, 0.5, STEP_1_A),
    Edge(tapered_a, 0.0, policy=with_full(taper=None)),
    Edge(tapered_a, 0.0, STEP_1_A, policy=with_full(taper=None)),
    Edge(ends_full, True, trail((9.0, 14.0), (0.0, 6.9))),
    Edge(ends_full, False, trail((9.0, 14.0), (0.0, 7.0))),
    Edge(ends_full, True, {**trail((5.0, 0.9), (0.0, 0.9)), "step": CurrentStep(4, 14.0, cause(""))}),
    Edge(ends_full, False, bmu={"voltage_v": None}),
)  # fmt: skip

# --- what a charge that is over leaves --------------------------------------------------------------------------------


def charged_full_s(f: Facts) -> object:
    """When the battery was last charged all the way, if the charge ends now."""
    known = next_transition(f, ()).changes.get("battery")
    return known.full_s if known is not None else "goes on"


LONG_AGO = {"full_s": ago(DAY_S)}
LEAVES = (
    Edge(charged_full_s, ago(DAY_S), LONG_AGO, policy=TO_80, bmu={"soc_pct": 80.0}),
    Edge(charged_full_s, ago(DAY_S), {**LONG_AGO, **held(0, None)}, policy=TO_80, bmu={"soc_pct": 80.0}),
    Edge(charged_full_s, NOW_S, {**LONG_AGO, **held(0)}, policy=TO_80, bmu={"soc_pct": 80.0}),
    Edge(charged_full_s, NOW_S, LONG_AGO, bmu={"soc_pct": 100.0}),
    Edge(charged_full_s, "goes on", LONG_AGO, bmu={"soc_pct": 99.9}),
)  # fmt: skip


def goes(f: Facts) -> tuple[Trigger | None, Cause, object]:
    """Where a bay goes, why, and what changes with it."""
    trigger, why, changes = next_transition(f, ())
    return trigger, why, tuple(changes.items())


RULE = Cause("limit_pack", (("allowed_a", 14.0),), "pack.current_a", "somewhere:1")
ON_STEP_5 = {"step": CurrentStep(4, 14.0, RULE)}


def charging(held: Cause | None = None) -> Cause:
    return Cause.of(
        "charging", key="pack.current_a", place="somewhere:1",
        step=5, step_a=14.0, rule=RULE, limited=None, rises=None, held=held,
    )  # fmt: skip


def at_the_top(left_min: float) -> Cause:
    return by_policy("held_at_the_top", "finish.hold_min", left_min=left_min)


GOES: tuple[Edge, ...] = (
    Edge(goes, (None, charging(), ()), ON_STEP_5),
    Edge(goes, (None, charging(at_the_top(20.0)), ()), {**ON_STEP_5, **held(600)}, policy=HOLDS),
    Edge(goes, (None, charging(at_the_top(0.5)), ()), {**ON_STEP_5, **held(1770)}, policy=HOLDS),
)  # fmt: skip


def ends(f: Facts) -> Cause:
    return next_transition(f, ()).cause


ENDS = (
    Edge(ends, Cause.of("full", key=SOC_80.key, place=SOC_80.place, what=SOC_80), policy=TO_80, bmu={"soc_pct": 80.0}),
    Edge(ends, Cause.of("full", what=FOUND), held(0)),
)  # fmt: skip

# --- precharge --------------------------------------------------------------------------------------------------------


def woken(pulse_s: float = 0.0, rise_s: float = 60.0) -> dict[str, Any]:
    return {"session": Session(0.0, pulse_s=pulse_s, rise_s=rise_s, rise_v=30.0), "reached_s": ago(2)}


def changes(reached_s: float | None, rise_s: float = 60.0, rise_v: float = 30.0, pulse_s: float = 0.0) -> object:
    return (
        ("stage", Stage(ran=True, reached_s=reached_s)),
        ("session", Session(0.0, pulse_s=pulse_s, rise_s=rise_s, rise_v=rise_v)),
    )


def reached(key: str, target_v: float) -> Cause:
    return by_policy("pack_reached", key, target_v=target_v)


PRECHARGE = (
    Edge(goes, (Trigger.CONTINUE, reached("precharge.pulse.until_v", 35.1), changes(ago(2))), woken(), PULSE,
         bmu={"voltage_v": 35.1}),
    Edge(goes, (None, by_policy("precharging_pulse", "precharge.pulse", below_v=39.0), changes(None)), woken(), PULSE,
         bmu={"voltage_v": 35.0}),
    Edge(goes, (Trigger.CONTINUE, by_policy("pulses_over", "precharge.pulse.max_min", limit_min=10.0),
                changes(None, pulse_s=600.0)), woken(600.0), PULSE, bmu={"voltage_v": 35.0}),
    Edge(goes, (None, by_policy("precharging_pulse", "precharge.pulse", below_v=39.0), changes(None, pulse_s=599.9)),
         woken(599.9), PULSE, bmu={"voltage_v": 35.0}),
    Edge(goes, (Trigger.CHARGE, reached("precharge.below_v", 39.0), changes(ago(2))), woken(), CONTINUOUS,
         bmu={"voltage_v": 39.0}),
    Edge(goes, (Trigger.CHARGE, reached("precharge.below_v", 39.0), changes(ago(2), rise_s=0.0, rise_v=39.0)),
         woken(rise_s=300.0), CONTINUOUS, bmu={"voltage_v": 39.0}),
    Edge(goes, (None, by_policy("precharging_continuous", "precharge.continuous", below_v=39.0), changes(None)),
         woken(), CONTINUOUS, bmu={"voltage_v": 38.9}),
)  # fmt: skip

# --- a full battery at rest -------------------------------------------------------------------------------------------


def rests(f: Facts) -> tuple[Trigger, Cause]:
    return resting_place(f, ())


def full_until(then: Cause) -> Cause:
    return Cause.of("full_before", past=True, then=then)


AGAIN = by_policy("charged_again", "recharge.soc_below_pct", soc_pct=90.0, threshold_pct=87.0)
RESTS = (
    Edge(rests, (Trigger.FILL, full_until(AGAIN)), {"full_pct": 90.0}, State.FULL, bmu={"soc_pct": 90.0}),
    Edge(rests, (Trigger.FILL, full_until(Cause("soc_unknown"))), {"full_pct": 90.0}, State.FULL,
         bmu={"soc_pct": None}),
)  # fmt: skip


@pytest.mark.parametrize("edge", [*FINISH, *LEAVES, *GOES, *ENDS, *PRECHARGE, *RESTS], ids=lambda edge: edge.name)
def test_the_end_of_a_charge_at_its_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_an_automatic_charger_is_not_told_a_step() -> None:
    f = Edge(goes, None, control=ControlMode.AUTOMATIC).facts
    assert goes(f) == (None, Cause("charges_by_itself"), ())


# --- what limits it ---------------------------------------------------------------------------------------------------


def row(key: str, **memory: Any) -> Any:
    """The row with this key as it is said with the present values."""

    def said(f: Facts) -> object:
        rule = limits.present(key, f.snapshot, remembering(f.memory, last_s=NOW_S, **memory), f.rules)
        return rule.param("spans") if rule is not None else None

    said.__name__ = key
    return said


def span(id_: str, pack_c: float, low: float, high: float, **more: Any) -> Cause:
    return Cause.of(id_, value=Cause.of("value_temperature_c", pack_c=pack_c), **more, low=low, high=high)


COLD, COOL, WHERE = "current.temperature_c.rows[0]", "current.temperature_c.rows[1]", "current.where[0]"
IN_COLD, IN_COOL = {"rows": (("temperature_c", 0),)}, {"rows": (("temperature_c", 1),)}
AT_85 = Cause.of("span_in", value=Cause.of("value_soc_pct", soc_pct=85.0), low=80.0, high=100.0)
SPANS = (
    Edge(row(COLD), (span("span_in", 5.0, 0.0, 10.0),), IN_COLD, bmu={"temperature_c": 5.0}),
    Edge(row(COLD), (span("span_left", 12.0, 0.0, 10.0),), IN_COOL, bmu={"temperature_c": 12.0}),
    Edge(row(COLD), (span("span_near", 10.5, 0.0, 10.0, well=1.0),), IN_COLD, bmu={"temperature_c": 10.5}),
    Edge(row(COLD), (span("span_kept", 11.0, 0.0, 10.0),), IN_COLD, bmu={"temperature_c": 11.0}),
    Edge(row(COOL), (span("span_near", 9.5, 10.0, 15.0, well=1.0),), IN_COOL, bmu={"temperature_c": 9.5}),
    Edge(row(COOL), (span("span_kept", 9.0, 10.0, 15.0),), IN_COOL, bmu={"temperature_c": 9.0}),
    Edge(row(COLD), (Cause.of("span_unknown", quantity="temperature"),), IN_COLD, bmu={"temperature_c": None}),
    Edge(row(WHERE), (span("span_near", 15.5, 0.0, 15.0, well=1.0), AT_85), {"rows": (("where[0]", 0),)},
         bmu={"temperature_c": 15.5, "soc_pct": 85.0}),
    Edge(row(WHERE), (span("span_left", 15.5, 0.0, 15.0), AT_85), bmu={"temperature_c": 15.5, "soc_pct": 85.0}),
    Edge(row("current.nothing"), None),
)  # fmt: skip


@pytest.mark.parametrize("edge", SPANS, ids=lambda edge: edge.name)
def test_a_row_as_it_is_said(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_the_limit_of_the_station_is_said_with_its_key() -> None:
    f = Edge(goes, None).facts
    place = f.rules.bay.source.at("limits.current_a")
    assert limits.limit(f, Bound(11.0, "limits.current_a")) == Cause(
        "limit_station", (("allowed_a", 11.0),), "limits.current_a", place
    )


@pytest.mark.parametrize(
    ("station_c", "hottest", "coldest"),
    [
        ((0, 45), "pack.temperature_c", "pack.temperature_c"),
        ((-1, 46), "pack.temperature_c", "pack.temperature_c"),
        ((0, 44), "limits.temperature_c", "pack.temperature_c"),
        ((1, 45), "pack.temperature_c", "limits.temperature_c"),
    ],
)
def test_the_stricter_temperature_limit_is_named(station_c: tuple[int, int], hottest: str, coldest: str) -> None:
    the_bay = bay()
    the_bay = replace(the_bay, limits=replace(the_bay.limits, temperature_c=Range(*station_c)))
    sources = {"pack.temperature_c": POLICY.source, "limits.temperature_c": the_bay.source}
    rules = Rules.of(the_bay)
    assert rules.hottest_at == (hottest, sources[hottest].at(hottest))
    assert rules.coldest_at == (coldest, sources[coldest].at(coldest))
