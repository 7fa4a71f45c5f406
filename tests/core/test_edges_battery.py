"""What the battery and its BMU report, at the edges of the rules about it: the whole cause, with its key."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.core.cells import LFP, LTO, NMC, Chemistry
from orchestrator.core.checks import battery, charge, obedience, ourselves
from orchestrator.core.facts import CHARGER_STALE_S, Facts
from orchestrator.core.memory import Memory, Still
from orchestrator.core.shared import shared
from orchestrator.core.witnesses import measured
from orchestrator.core.witnesses.followed import Sample
from orchestrator.core.witnesses.pack import another_pack
from orchestrator.model import BatteryReading, Cause, ChargeMode, ChargerLink, Measurement, Operation, State
from tests.core.bays import POLICY
from tests.core.edges import NOW_S, Edge, ago, by_policy, witnessed
from tests.core.said import cause

S = State
UNHEARD = {"t_s": ago(9)}
STANDS_BY = {"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL, "current_a": 0.0}

# --- whether it is heard ----------------------------------------------------------------------------------------------

NAMES = ("voltage_v", "current_a", "status", "temperature_c", "soc_pct", "soh_pct")
SILENT = Cause.of("bmu_silent", node_id=0x10)
PROBLEM = cause("the bus is off")


def heard(age_s: float, *names: str) -> dict[str, Any]:
    """Only these values, so old."""
    return {"battery": BatteryReading(**{name: Measurement(50.0, ago(age_s)) for name in names})}


HEARD = (
    Edge(battery.bmu_silent, None),
    Edge(battery.bmu_silent, SILENT, bmu_link={"online": False}),
    Edge(battery.bmu_silent, PROBLEM, bmu_link={"online": False, "problem": PROBLEM}),
    Edge(battery.bmu_silent, SILENT, snapshot={"battery": BatteryReading()}),
    Edge(battery.bmu_silent, SILENT, snapshot=heard(0.61, *NAMES[:3])),
    Edge(battery.bmu_silent, None, snapshot=heard(0.5, *NAMES[:3])),
    Edge(battery.bmu_silent, None, snapshot=heard(0.61, *NAMES)),
    Edge(battery.bmu_silent, None, {"stalled_s": ago(1)}, snapshot={"battery": BatteryReading()}),
    Edge(battery.bmu_silent, None, snapshot={"battery": BatteryReading()}, bmu_link={"boot_t_s": ago(1)}),
)  # fmt: skip

# --- what is wrong with it --------------------------------------------------------------------------------------------

SEEN, ABORT = cause("NMT stop"), cause("0x2010 refused")


def news(name: str, age_s: float) -> dict[str, Any]:
    return {name: SEEN, f"{name}_t_s": ago(age_s)}


def aborted(code: int) -> dict[str, Any]:
    return {"abort": ABORT, "abort_code": code}


REPORTED = (
    *(Edge(rule, says, bmu_link=news(rule.__name__, age_s))
      for rule in (battery.other_master, battery.heartbeat_set) for age_s, says in ((9.9, SEEN), (10.0, None))),
    *(Edge(battery.sdo_refused, ABORT, bmu_link=aborted(code)) for code in (0x06010000, 0x06020000, 0x0609FFFF)),
    *(Edge(battery.sdo_refused, None, bmu_link=aborted(code)) for code in (0x06030000, 0x060A0000, 0x08000000, 0)),
    *(Edge(battery.sdo_aborted, None, bmu_link=aborted(code)) for code in (0x06010000, 0x06020000, 0x0609FFFF)),
    *(Edge(battery.sdo_aborted, ABORT, bmu_link=aborted(code)) for code in (0x06030000, 0x060A0000, 0x08000000, 0)),
    Edge(battery.temperature_invalid, SEEN, bmu_link={"implausible": {"temperature_c": SEEN}}),
    Edge(battery.temperature_invalid, None, bmu_link={"implausible": {"soc_pct": SEEN}}),
    Edge(battery.temperature_invalid, None, bmu_link={"implausible": {"temperature_c": SEEN}, "boot_t_s": ago(1)}),
    Edge(battery.over_temperature, by_policy(
        "over_temperature", "pack.temperature_c", pack_c=45.0, limit_c=45.0, again_c=40.0),
        bmu={"temperature_c": 45.0}),
    Edge(battery.under_temperature, by_policy(
        "under_temperature", "pack.temperature_c", pack_c=-0.1, limit_c=0.0, again_c=3.0),
        bmu={"temperature_c": -0.1}),
    Edge(battery.under_voltage, None, bmu={"voltage_v": 26.0, "soc_pct": 3.0}),
    Edge(battery.under_voltage, by_policy("under_voltage", "pack.voltage_v", pack_v=25.99, limit_v=26.0),
         bmu={"voltage_v": 25.99, "soc_pct": 3.0}),
)  # fmt: skip

# --- whether it is the pack of the policy -----------------------------------------------------------------------------

LOW_V, HIGH_V = NMC.bounds_v(50.0)


def another(id_: str, pack_v: float, bound_v: float) -> Cause:
    return by_policy(
        id_, "pack.cells_in_series",
        pack_v=pack_v, soc_pct=50.0, cells=13, kind="NMC/NCA", cell_v=pack_v / 13, bound_v=bound_v,
    )  # fmt: skip


PACK = (
    Edge(another_pack, None, state=S.IDLE, bmu={"voltage_v": 13 * LOW_V}),
    Edge(another_pack, another("pack_too_low", 45.4, LOW_V), state=S.IDLE, bmu={"voltage_v": 45.4}),
    Edge(another_pack, another("pack_too_low", 45.4, LOW_V), bmu={"voltage_v": 45.4}),
    Edge(another_pack, None, state=S.IDLE, bmu={"voltage_v": 13 * HIGH_V}),
    Edge(another_pack, another("pack_too_high", 52.1, HIGH_V), state=S.IDLE, bmu={"voltage_v": 52.1}),
    Edge(another_pack, None, bmu={"voltage_v": 52.1}),
    Edge(another_pack, None, state=S.IDLE, bmu={"voltage_v": 20.0, "soc_pct": None}),
    Edge(another_pack, None, state=S.IDLE, bmu={"voltage_v": None}),
)  # fmt: skip


def test_a_cell_may_have_any_low_voltage_up_to_20_percent() -> None:
    assert NMC.bounds_v(20.0)[0] == float("-inf")
    assert NMC.bounds_v(20.5)[0] == pytest.approx(3.00 + 0.35 * 0.5 / 5 - 0.10)
    assert NMC.bounds_v(50.0) == pytest.approx((3.60 - 0.10, 3.85 + 0.15))


@pytest.mark.parametrize("kind", [NMC, LFP, LTO], ids=lambda kind: kind.name)
def test_a_cell_has_the_volts_of_its_curve(kind: Chemistry) -> None:
    for soc_pct, volts in kind.curve:
        assert kind.ocv_v(soc_pct) == pytest.approx(volts, abs=1e-12)
    (low_pct, low_v), (next_pct, next_v) = kind.curve[:2]
    assert kind.ocv_v((low_pct + next_pct) / 2) == pytest.approx((low_v + next_v) / 2)
    assert (kind.ocv_v(-1.0), kind.ocv_v(101.0)) == (low_v, kind.curve[-1][1])


# --- the charge and the charger ---------------------------------------------------------------------------------------

assert POLICY.precharge is not None
GENTLE = replace(POLICY, precharge=replace(POLICY.precharge, max_a=1.5))
TAKEN = cause("9600 baud")


def of_charger(limit: str, **params: Any) -> Cause:
    return Cause.of(limit, port="/dev/ttyX", **params)


CHARGER = (
    Edge(charge.precharge_too_strong, None, policy=GENTLE, bmu={"voltage_v": 39.0}),
    Edge(charge.precharge_too_strong, by_policy(
        "precharge_too_strong", "precharge.max_a", pack_v=38.9, max_a=1.5, lowest_a=2.0),
        policy=GENTLE, bmu={"voltage_v": 38.9}),
    Edge(charge.precharge_too_strong, None, bmu={"voltage_v": 38.9}),
    Edge(obedience.charger_silent, None),
    Edge(obedience.charger_silent, of_charger("charger_silent", misses=5), charger_link={"online": False, "misses": 5}),
    Edge(obedience.charger_silent, of_charger("charger_stale", limit_s=CHARGER_STALE_S), charger=UNHEARD),
    Edge(obedience.charger_silent, None, {"stalled_s": ago(1)}, charger=UNHEARD),
    Edge(obedience.line_taken_over, of_charger("line_taken_over", settings=TAKEN),
         charger_link={"taken_over": TAKEN, "taken_over_t_s": ago(4.9)}),
    Edge(obedience.line_taken_over, None, charger_link={"taken_over": TAKEN, "taken_over_t_s": ago(5)}),
    Edge(obedience.line_taken_over, None),
    Edge(obedience.loose_plug, Cause("loose_plug"), {"returned_s": NOW_S}),
    Edge(obedience.loose_plug, None, {"returned_s": ago(0.25)}),
    Edge(obedience.loose_plug, None),
)  # fmt: skip

# --- both side by side ------------------------------------------------------------------------------------------------

WAKES = {"charge_mode": ChargeMode.PRECHARGE, "voltage_v": 48.0}
PULSED = witnessed(trail=tuple(Sample(ago(age_s), 46.0, 1.0, v, 1.0) for age_s, v in ((1, 48.0), (0.5, 50.0))))


def disagree(charger_v: float, pack_v: float) -> Cause:
    return Cause.of("volts_disagree", charger_v=charger_v, pack_v=pack_v, wrong=None)


def still(seconds: float, charger_v: float, pack_v: float) -> dict[str, Any]:
    return {"still": Still(ago(seconds), charger_v, 0.0, pack_v, 0.0)}


FROZEN = Cause.of("charger_frozen_at_rest", charger_v=48.0, lasted_s=60.0, moved_v=1.0)
AT_49_V: dict[str, float | None] = {"voltage_v": 49.0}
SIDE_BY_SIDE = (
    # while a charger wakes a pack with pulses, their means count
    Edge(measured.volts_disagree, disagree(49.0, 46.0), PULSED, charger=WAKES),
    Edge(measured.volts_disagree, None, PULSED),
    Edge(measured.volts_disagree, None, witnessed(trail=()), charger=WAKES),
    Edge(measured.volts_disagree, disagree(51.0, 48.0), witnessed(trail=()), charger={**WAKES, "voltage_v": 51.0}),
    # values that stand still at rest
    Edge(measured.charger_frozen_at_rest, FROZEN, still(60, 48.0, 48.0), S.IDLE, charger=STANDS_BY, bmu=AT_49_V),
    Edge(measured.charger_frozen_at_rest, None, still(59.9, 48.0, 48.0), S.IDLE, charger=STANDS_BY, bmu=AT_49_V),
    Edge(measured.charger_frozen_at_rest, None, still(60, 48.0, 48.0), S.IDLE, bmu=AT_49_V),
    Edge(measured.charger_frozen_at_rest, None, still(60, 48.0, 48.0), S.IDLE, charger=STANDS_BY, bmu=AT_49_V,
         snapshot={"connected": False}),
    Edge(measured.charger_frozen_at_rest, None, still(60, 48.0, 48.0), S.IDLE, charger=STANDS_BY,
         bmu={"voltage_v": None}),
    Edge(measured.charger_frozen_at_rest, None, state=S.IDLE, charger=STANDS_BY, bmu=AT_49_V),
    Edge(measured.charger_frozen_at_rest, None, still(60, 48.0, 0.0), S.IDLE, charger=STANDS_BY,
         bmu={"voltage_v": 0.2}),
    Edge(measured.charger_frozen_at_rest, None, still(60, 0.0, 48.0), S.IDLE, charger=STANDS_BY,
         bmu={"voltage_v": 0.2}),
)  # fmt: skip

EDGES = (*HEARD, *REPORTED, *PACK, *CHARGER, *SIDE_BY_SIDE)


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: edge.name)
def test_a_rule_at_its_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_what_cannot_be_judged_is_told_without_an_error_that_there_was_not() -> None:
    f, broken = Edge(ourselves.internal, None).facts, cause("over_current cannot be judged")
    both = replace(f, broken=(broken,), snapshot=replace(f.snapshot, internal="boom"))
    error = Cause.of("internal_error", error="boom")
    assert ourselves.internal(f) is None
    assert ourselves.internal(replace(f, broken=(broken,))) == Cause.of("internal", whats=(broken,))
    assert ourselves.internal(both) == Cause.of("internal", whats=(error, broken))


@pytest.mark.parametrize(
    ("link", "waits"),
    [
        ({}, None),
        ({"locked_by": Cause("program_unknown")}, Cause("port_was_locked")),
        ({"locked_by": Cause.of("program", pid=7)}, None),
        ({"problem": Cause.of("port_of_service", pid=7)}, Cause.of("port_was_shared", pid=7)),
        ({"problem": Cause("port_gone")}, None),
    ],
)
def test_why_a_port_that_was_shared_waits_for_a_person(link: dict[str, Any], waits: Cause | None) -> None:
    assert shared(ChargerLink(**link)) == waits


# --- what is known at all ---------------------------------------------------------------------------------------------

NO_NUMBERS = (float("nan"), float("inf"), float("-inf"))


@pytest.mark.parametrize("value", NO_NUMBERS)
def test_what_is_no_number_is_not_known(value: float) -> None:
    facts = Edge(another_pack, None, bmu={"voltage_v": value, "soc_pct": value}).facts
    assert (facts.pack_v, facts.soc, facts.temperature_c) == (None, None, 20.0)
    for name in ("voltage_v", "current_a"):
        facts = Edge(another_pack, None, charger={name: value}).facts
        assert (facts.reading, facts.volts, facts.amps) == (None, None, None)


def test_no_time_has_passed_before_the_first_decision() -> None:
    f = Edge(another_pack, None).facts
    assert Facts.of(NOW_S, f.snapshot, Memory(), f.rules).state_s == 0.0
