"""Rules of the fault table at edges that `test_edges.py` leaves out: the whole cause, with its key and every figure."""

from typing import Any

import pytest

from orchestrator.core.checks import battery, charge, obedience, state_of_charge
from orchestrator.core.outofcontrol import out_of_control
from orchestrator.core.safestop import LASTS_S, gives_up, proved_to_last, stands_by
from orchestrator.model import (
    Action,
    BatteryReading,
    Cause,
    ChargeMode,
    Command,
    ControlMode,
    CurrentStep,
    Measurement,
    Operation,
    Session,
    State,
)
from tests.core.edges import PULSE, STANDS_BY, UNHEARD, Edge, ago, by_policy, witnessed
from tests.core.said import cause

STOPPED_FULL = {"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL}

# --- the battery ------------------------------------------------------------------------------------------------------


def quiet(age_s: float) -> dict[str, Any]:
    """All values but the temperature arrived so long ago."""
    names = ("voltage_v", "current_a", "status", "soc_pct", "soh_pct")
    return {"battery": BatteryReading(**{name: Measurement(50.0, ago(age_s)) for name in names})}


STALE = Cause.of("stale_reading", missing=("temperature",))
BATTERY = (
    Edge(battery.bmu_rebooted, None, {"boots": 2}, bmu_link={"boots": 2}),
    Edge(battery.bmu_rebooted, Cause("bmu_rebooted"), {"boots": 2}, bmu_link={"boots": 3}),
    Edge(battery.runaway, by_policy(
        "runaway", "faults.temperature_rise_k_per_min", rate_k_per_min=3.0, limit_k_per_min=1.0),
        {"warmth": ((ago(180), 11.0),)}),
    Edge(battery.stale_reading, None),
    Edge(battery.stale_reading, STALE, bmu={"temperature_c": None}),
    Edge(battery.stale_reading, None, {"stalled_s": ago(1.4)}, bmu={"temperature_c": None}),
    Edge(battery.stale_reading, STALE, {"stalled_s": ago(1.5)}, bmu={"temperature_c": None}),
    Edge(battery.stale_reading, STALE, snapshot=quiet(0.5)),
    Edge(battery.stale_reading, None, snapshot=quiet(0.61)),
    Edge(battery.stale_reading, STALE, snapshot=quiet(0.61), bmu_link={"boot_t_s": ago(2.4)}),
    Edge(battery.stale_reading, None, snapshot=quiet(0.61), bmu_link={"boot_t_s": ago(2.5)}),
    Edge(state_of_charge.figures_disagree,
         Cause.of("energy_disagrees", remaining_ah=1.0, available_wh=99.0, implied_v=99.0, pack_v=5.0),
         bmu={"remaining_ah": 1.0, "available_wh": 99.0, "voltage_v": 5.0}),
    Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 1.0, "available_wh": 99.0, "voltage_v": 4.99}),
)  # fmt: skip

# --- the charge -------------------------------------------------------------------------------------------------------


def unseen(seconds: float, ah: float = 0.0, energised_s: float = 0.0) -> dict[str, Any]:
    """So much may have passed uncounted before a kill; it counts as charged, with the bay's limit of 15 A."""
    return {"session": Session(0.0, charged_ah=ah, energised_s=energised_s, soc_start_pct=0.0, unseen_s=seconds)}


CHARGE = (
    Edge(charge.ah_limit, None, unseen(3600, ah=29.0)),
    Edge(charge.ah_limit, by_policy("ah_limit", "finish.max_ah", charged_ah=45.0, begun_pct=0.0, whole_ah=44.0,
                                    limit_ah=44.0), unseen(3600, ah=30.0)),
    Edge(charge.time_limit, None, unseen(36, energised_s=12 * 3600.0 - 36)),
    Edge(charge.time_limit, by_policy("time_limit", "finish.max_hours", lasted_h=12.01, limit_h=12.0),
         unseen(36, energised_s=12 * 3600.0)),
)  # fmt: skip

# --- whether the charger obeys ----------------------------------------------------------------------------------------

STEP_3 = {"step": CurrentStep(2, 8.0, cause(""))}
MOST_A = 8.0 * 110 / 100 + 0.3
ABOVE = Cause.of("above_step", charger_a=10.0, limit_a=MOST_A, step_a=8.0)


def set_to(action: Action, value: int, seconds: float) -> dict[str, Any]:
    return {"command": Command(action, value), "command_s": ago(seconds)}


def unconfirmed(command: str, value: int) -> Cause:
    return Cause.of("setting_not_obeyed", command=command, value=value, waited_s=9.0, held=None)


def reverted(*ages_s: float) -> dict[str, Any]:
    return {**STEP_3, "reverts": tuple(map(ago, ages_s))}


OBEDIENCE = (
    Edge(obedience.above_step, ABOVE, STEP_3),
    Edge(obedience.above_step, None, STEP_3, charger={"current_a": MOST_A}),
    Edge(obedience.above_step, None, STEP_3, PULSE),
    Edge(obedience.above_step, None, STEP_3, charger=UNHEARD),
    Edge(obedience.above_step, None, STEP_3, control=ControlMode.AUTOMATIC),
    Edge(obedience.above_step, None),
    Edge(obedience.limit_reverted, Cause.of("limit_reverted", times=3), reverted(59.9, 2, 1)),
    Edge(obedience.limit_reverted, None, reverted(60, 2, 1)),
    Edge(obedience.limit_reverted, Cause.of("limit_reverted", times=3), reverted(60, 3, 2, 1)),
    Edge(obedience.limit_reverted, None, {**reverted(3, 2, 1), "step": None}),
    Edge(obedience.limit_reverted, None, STEP_3),
    Edge(obedience.setting_not_obeyed, unconfirmed("mode", 4), set_to(Action.SET_MODE, 4, 9)),
    Edge(obedience.setting_not_obeyed, unconfirmed("precharge", 1), set_to(Action.SET_PRECHARGE, 1, 9)),
    Edge(obedience.setting_not_obeyed, unconfirmed("step", 4), set_to(Action.SET_LIMIT, 3, 9)),
    Edge(obedience.stopped_by_itself, None, {"session": Session(0.0, full=cause("found full"))},
         charger=STOPPED_FULL, bmu={"soc_pct": 85.0}),
    Edge(obedience.stopped_by_itself, Cause("stopped_not_full"), {"session": Session(0.0)},
         charger=STOPPED_FULL, bmu={"soc_pct": 85.0}),
    Edge(obedience.no_battery, Cause.of("no_battery", lasted_min=1.5, limit_min=1.0), {"search_s": 90.0}),
    Edge(obedience.wakes_too_long, Cause.of("wakes_too_long", lasted_min=31.0, limit_min=30.0), {"wake_s": 1860.0}),
    Edge(obedience.wakes_too_long, None, {"wake_s": 1800.0}),
)  # fmt: skip

# --- whether it stopped -----------------------------------------------------------------------------------------------

S = State
STOP_SENT = {"stop_sent_s": ago(20)}


def proof(*ages_s: float) -> dict[str, Any]:
    """Replies that showed standby, so long ago, after a stop."""
    return witnessed(stop_s=ago(20), proof=tuple(map(ago, ages_s)))


def returned(seconds: float, returns: int = 1) -> dict[str, Any]:
    """A stop has been tried for so long; the charger has run again, and this state began a second ago."""
    return {"stopping_s": ago(seconds), "returns": returns}


STOPS = (
    Edge(proved_to_last, True, proof(10, 1), S.UNCONTROLLABLE, charger=STANDS_BY),
    Edge(proved_to_last, False, proof(9.9, 1), S.UNCONTROLLABLE, charger=STANDS_BY),
    Edge(proved_to_last, False, proof(10), S.UNCONTROLLABLE, charger=STANDS_BY),
    Edge(proved_to_last, False, proof(10, 1), S.UNCONTROLLABLE),
    Edge(proved_to_last, False, proof(10, 1), S.UNCONTROLLABLE, charger=STANDS_BY, charger_link={"online": False}),
    Edge(stands_by, True, proof(2, 1), S.STOPPING, charger=STANDS_BY),
    Edge(stands_by, False, proof(2), S.STOPPING, charger=STANDS_BY),
    Edge(stands_by, False, proof(2, 1), S.UNCONTROLLABLE, charger=STANDS_BY),
    Edge(stands_by, True, state=S.IDLE, charger=STANDS_BY),
    Edge(stands_by, False, state=S.IDLE),
    Edge(stands_by, False, state=S.OFFLINE, charger=STANDS_BY),
    Edge(stands_by, True, proof(2, 1), S.OFFLINE, charger=STANDS_BY),
    Edge(out_of_control, Cause.of("uncontrollable_stands_by", port="/dev/ttyX", lasts_s=4.0, limit_s=LASTS_S),
         proof(4, 1), S.UNCONTROLLABLE, charger=STANDS_BY),
    # it runs again, after an earlier stop in vain
    Edge(gives_up, False, {}, S.STOPPING, 2.9),
    Edge(gives_up, True, {}, S.STOPPING, 3.0),
    Edge(gives_up, False, returned(2.9), S.STOPPING, 1.0),
    Edge(gives_up, True, returned(3.0), S.STOPPING, 1.0),
    Edge(gives_up, False, returned(4.0), S.STOPPING, 1.0, charger={"t_s": ago(1.0)}),
    Edge(gives_up, True, returned(4.0), S.STOPPING, 1.0, charger={"t_s": ago(0.9)}),
    Edge(gives_up, False, returned(4.0), S.STOPPING, 1.0, charger=STANDS_BY),
    Edge(gives_up, True, returned(4.0, 2), S.STOPPING, 1.0, charger=STANDS_BY),
)  # fmt: skip


@pytest.mark.parametrize("edge", [*BATTERY, *CHARGE, *OBEDIENCE, *STOPS], ids=lambda edge: edge.name)
def test_a_rule_at_its_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_only_what_a_stop_was_denied_by_is_said_in_the_past() -> None:
    denied = Cause.of("will_not_stop", charger_a=10.0)
    assert obedience.did_not_stop(denied, 5.0) == Cause.of("did_not_stop", lasted_s=5.0)
    contradicted = Cause.of("stop_contradicted", pack_a=10.0)
    assert obedience.did_not_stop(contradicted, 5.0) == Cause.of("stop_was_contradicted", lasted_s=5.0)
    past = Cause.of("did_not_stop", lasted_s=4.0)
    assert obedience.did_not_stop(past, 5.0) is past
