"""Whole stories of a bay: how it gets from state to state, and the reasons it gives on the way."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from orchestrator.config.policy import Policy
from orchestrator.core.facts import FAST_STALE_S
from orchestrator.core.operator import STOPPED
from orchestrator.core.rules import Rules
from orchestrator.core.states import ENERGISED
from orchestrator.keys import Range
from orchestrator.model import (
    STOP,
    Action,
    Alarm,
    ChargeMode,
    ControlMode,
    Effect,
    Operation,
    Request,
    Session,
    State,
)
from tests.core.bays import IN, POLICY, charging, continuous, full, idle, offline, pulse, suspended, tripped
from tests.core.said import cause, reason_of, say
from tests.core.world import TICK_S, World, bay, with_full

S = State
START_AT, FULL_AT = POLICY.source.at("start.soc_below_pct"), POLICY.source.at("finish.full.soc_pct")


def sessions(world: World) -> list[Session]:
    """The sessions that have ended."""
    return [decision.session for decision in world.decisions if decision.session and decision.session.result]


# --- from empty to full -----------------------------------------------------------------------------------------------


def test_a_deeply_discharged_pack_goes_through_every_stage() -> None:
    world = World(voltage_v=33.0, soc_pct=0.0)
    assert reason_of(world.until(S.PRECHARGE_PULSE)).startswith("the pack has 33.00 V, below 39 V (")
    for volts in (33.5, 34.0, 34.6, 35.1):
        world.run(60)
        world.values["voltage_v"] = volts
    at = POLICY.source.at
    assert (
        reason_of(world.until(S.PRECHARGE_CONTINUOUS, 5))
        == f"the pack reached 35.1 V ({at('precharge.pulse.until_v')})"
    )
    for volts in (36.0, 37.0, 38.0, 39.0):
        world.run(60)
        world.values["voltage_v"] = volts
    assert reason_of(world.until(S.CHARGING, 5)) == f"the pack reached 39 V ({at('precharge.below_v')})"
    for soc in range(5, 100, 5):
        world.run(60, dt_s=1.0)
        world.values["soc_pct"] = float(soc)
    world.run(60)
    world.values["soc_pct"] = 100.0
    assert reason_of(world.tick()) == f"full: SOC 100 % reached 100 % ({FULL_AT})"
    world.until(S.FULL, 2)
    assert world.states() == [S.STARTING, S.IDLE, S.QUALIFYING, S.PRECHARGE_PULSE, S.PRECHARGE_CONTINUOUS, S.CHARGING,
                              S.STOPPING, S.FULL]  # fmt: skip
    assert all(decision.faults == () for decision in world.decisions)
    (session,) = sessions(world)
    assert say(session.result) == f"full: SOC 100 % reached 100 % ({FULL_AT})"
    assert (session.soc_start_pct, session.soc_pct) == (0.0, 100.0)


def test_a_stage_is_over_when_its_voltage_has_been_held() -> None:
    world = pulse()
    for _ in range(10):  # a pulse lifts the voltage for a moment
        world.values["voltage_v"] = 35.2
        world.run(2)
        world.values["voltage_v"] = 34.9
        world.run(1)
    assert world.is_in(S.PRECHARGE_PULSE)
    world.values["voltage_v"] = 35.1
    world.run(2)
    assert world.is_in(S.PRECHARGE_PULSE)
    assert world.tick().state is S.PRECHARGE_CONTINUOUS


def test_pulses_end_after_their_time() -> None:
    world = pulse()
    begun_s = world.memory.since_s
    assert begun_s is not None
    while world.is_in(S.PRECHARGE_PULSE):
        world.values["voltage_v"] = 33.0 + (world.now_s - begun_s) / 600
        world.tick(dt_s=1.0)
    assert world.is_in(S.PRECHARGE_CONTINUOUS)
    assert 600 <= world.now_s - begun_s < 601
    assert reason_of(world.decision) == f"10 min of pulses ({POLICY.source.at('precharge.pulse.max_min')})"


def test_the_rise_is_looked_at_again_and_again() -> None:
    """Enough in the first period is not enough in the second."""
    world = pulse()
    world.values["voltage_v"] = 33.4
    world.run(310, dt_s=1.0)
    assert world.is_in(S.PRECHARGE_PULSE)
    world.run(300, dt_s=1.0)
    assert "precharge_no_rise" in world.raised
    assert "0.00 V in 5.0 min" in world.raised["precharge_no_rise"]


def test_precharge_says_why_it_goes_on() -> None:
    for begin, stage in ((pulse, "pulse"), (continuous, "continuous")):
        at = POLICY.source.at(f"precharge.{stage}")
        assert reason_of(begin().tick()) == f"the pack is below 39 V: {stage} precharge ({at})"


@pytest.mark.parametrize(("volts", "state"), [(38.99, S.PRECHARGE_PULSE), (39.0, S.CHARGING)])
def test_precharge_begins_below_its_voltage(volts: float, state: State) -> None:
    world = World(voltage_v=volts)
    while world.tick().state not in ENERGISED:
        pass
    assert world.is_in(state)


def test_without_precharge_a_pack_is_charged_at_once_or_refused() -> None:
    policy = replace(POLICY, precharge=None)
    world = World(bay(policy), voltage_v=33.0)
    world.until(S.CHARGING)
    world = World(bay(policy), voltage_v=33.0, status=2.0)
    world.run(20)
    assert world.is_in(S.SUSPENDED)
    assert "no precharge" in reason_of(world.decision)


@pytest.mark.parametrize(
    ("values", "words"), [({"voltage_v": 25.9}, "25.90 V, below 26 V"), ({"soh_pct": 59.0}, "SOH 59 %, below 60 %")]
)
def test_a_pack_that_must_not_be_charged_is_refused_with_the_reason(values: dict[str, float], words: str) -> None:
    world = World(**values)  # type: ignore[arg-type]  # the values of the battery, by name
    world.run(60)
    assert world.is_in(S.SUSPENDED)
    assert words in reason_of(world.decision)
    assert not ENERGISED & set(world.states())


# --- full -------------------------------------------------------------------------------------------------------------


def tapering(world: World) -> None:
    world.values.update(voltage_v=54.0, soc_pct=97.0)
    world.amps = 0.99


def test_full_by_taper() -> None:
    world = charging()
    tapering(world)
    world.tick()  # one more decision, which sees the taper
    world.run(120)
    assert world.is_in(S.CHARGING)
    reason = reason_of(world.tick())
    assert reason == f"full: 0.99 A, tapered below 1 A for 120 s ({POLICY.source.at('finish.full.taper')})"
    world.until(S.FULL, 2)


NOT_TAPERED = [{"voltage_v": 53.6}, {"amps": 1.0}]


@pytest.mark.parametrize("spoil", NOT_TAPERED, ids=str)
def test_a_taper_is_low_current_at_high_voltage_without_a_break(spoil: dict[str, float]) -> None:
    world = charging()
    for _ in range(3):
        tapering(world)
        world.run(119)
        world.values["voltage_v"] = spoil.get("voltage_v", 54.0)
        world.amps = spoil.get("amps", 0.99)
        world.tick()
    assert world.is_in(S.CHARGING)


def test_no_taper_where_the_policy_has_none() -> None:
    world = World(bay(with_full(taper=None))).charging()
    tapering(world)
    world.run(200)
    assert world.is_in(S.CHARGING)


def charger_says_full(world: World) -> None:
    world.shows.update(charge_mode=ChargeMode.FULL, operation=Operation.STOPPED)


def tapers_off(world: World) -> None:
    """The current falls as before a charger's end, but not to where the policy ends a charge."""
    world.amps = 3.5
    world.run(5.5)


@pytest.mark.parametrize("soc_pct", [80.0, 99.0])
def test_full_when_the_charger_says_so(soc_pct: float) -> None:
    world = charging()
    world.values["soc_pct"] = soc_pct
    tapers_off(world)
    charger_says_full(world)
    world.tick()
    at = POLICY.source.at("finish.full.charger")
    assert reason_of(world.decision) == f"full: the charger reports full (mode 5) ({at})"
    world.until(S.FULL, 2)
    assert world.memory.battery.full_pct == soc_pct


def test_full_too_early_is_no_full() -> None:
    """Otherwise a battery at 30 % would be called full, and not be charged again before it lost some more."""
    world = charging()
    world.values["soc_pct"] = 79.9
    tapers_off(world)
    charger_says_full(world)
    world.run(2)
    assert world.is_in(S.HELD)
    assert "early_full" in world.raised
    assert world.memory.battery.full_pct is None


def test_a_standby_that_somebody_orders_is_not_named_full() -> None:
    """Its mode 5 is standby: nothing has tapered off, so nobody has to check the BMU's SOC."""
    world = charging()
    charger_says_full(world)
    world.run(2)
    assert set(world.raised) == {"stopped_by_itself"}
    assert "not taken for full" in reason_of(world.decision)
    assert world.is_in(S.HELD)


def test_early_depends_on_where_the_policy_ends() -> None:
    policy = replace(
        POLICY, finish=replace(POLICY.finish, target_soc_pct=60), start=replace(POLICY.start, soc_below_pct=55)
    )
    world = World(bay(policy)).charging()
    world.values["soc_pct"] = 59.9
    tapers_off(world)
    charger_says_full(world)
    world.run(2)
    assert "early_full" in world.raised


def test_a_charger_that_is_not_believed_stopped_by_itself() -> None:
    policy = with_full(charger=False)
    world = World(bay(policy), soc_pct=92.0).charging()
    world.values["soc_pct"] = 96.0
    world.run(2)
    charger_says_full(world)
    world.run(2)
    assert set(world.raised) == {"stopped_by_itself"}
    assert world.is_in(S.HELD)


def test_plain_standby_is_not_full() -> None:
    """Mode 5 is both; before the charger has run, it is standby."""
    world = World(soc_pct=85.0)
    world.deaf.add(Action.SET_MODE)
    world.until(S.CHARGING)
    world.run(4)
    assert world.is_in(S.CHARGING)


# --- charged again ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("full_pct", "not_below_pct", "below_pct"), [(100.0, 95.0, 94.9), (96.0, 93.0, 92.9), (85.0, 82.0, 81.9)]
)
def test_a_full_battery_is_charged_again_when_it_has_lost_enough(
    full_pct: float, not_below_pct: float, below_pct: float
) -> None:
    world = World(soc_pct=80.0).charging()
    world.values["soc_pct"] = full_pct
    world.run(2)
    if full_pct < 100:
        tapers_off(world)
        charger_says_full(world)
    world.until(S.FULL, 2)
    world.shows.clear()
    world.values["soc_pct"] = not_below_pct
    world.run(30)
    assert world.is_in(S.FULL)
    told = reason_of(world.decision)
    assert told.startswith("full: SOC 100 %" if full_pct == 100 else "full: the charger reported full (mode 5) (")
    assert f"; SOC {not_below_pct:.0f} % now, charged again below {not_below_pct:g} % (" in told
    assert world.ask(Request.START) == f"nothing to start: FULL: {told}"
    world.values["soc_pct"] = below_pct
    world.until(S.CHARGING, 5)


def test_full_is_never_followed_by_a_charge_on_its_own() -> None:
    """A pack that relaxes and a BMU that rounds are no reason to begin again."""
    world = full()
    for soc_pct in (99.0, 98.0, 97.0, 98.0, 96.0, 95.0):
        world.values["soc_pct"] = soc_pct
        world.run(60)
    assert world.is_in(S.FULL)
    assert len(sessions(world)) == 1


@pytest.mark.parametrize(("soc_pct", "state"), [(98.0, S.IDLE), (97.9, S.CHARGING)])
def test_an_arriving_battery_is_charged_below_the_start_threshold(soc_pct: float, state: State) -> None:
    world = World(soc_pct=soc_pct)
    world.run(10)
    assert world.is_in(state)
    if state is S.IDLE:
        assert reason_of(world.decision) == f"SOC 98 % is not below 98 % ({START_AT})"


def test_another_battery_is_not_judged_by_the_last_one() -> None:
    world = full()
    world.values["soc_pct"] = 96.0
    world.run(10)
    assert world.is_in(S.FULL)
    world.leave()
    world.run(5)
    assert world.is_in(S.IDLE)
    assert reason_of(world.decision) == "no battery"
    world.arrive(soc_pct=96.0)
    world.until(S.CHARGING, 10)


def test_a_boot_that_the_charger_did_not_watch_is_another_battery() -> None:
    world = full()
    world.values["soc_pct"] = 96.0
    world.connected = False
    world.boot()
    world.tick()
    world.connected = True
    world.until(S.CHARGING, 10)


def test_a_swap_while_the_stop_is_verified() -> None:
    world = charging()
    world.deaf.add(Action.STOP)
    world.ask(Request.PAUSE)
    world.boot()
    world.run(2)
    world.deaf.clear()
    world.run(2)
    assert world.ask(Request.START) == ""
    world.until(S.CHARGING, 60)


# --- suspended, and continuing by itself ------------------------------------------------------------------------------


def test_heat_pauses_and_cooling_goes_on_in_the_same_session() -> None:
    world = World(temperature_c=44.0).charging()
    begun_s = world.memory.session.started_s if world.memory.session else 0.0
    world.values["temperature_c"] = 45.0
    world.until(S.SUSPENDED, 2)
    assert "45.0 °C" in reason_of(world.decision)
    world.values["temperature_c"] = 42.0
    world.run(60)
    assert world.is_in(S.SUSPENDED)  # not before it is well below
    world.values["temperature_c"] = 39.9
    world.run(10)
    assert world.is_in(S.SUSPENDED)
    world.until(S.CHARGING, 5)
    assert world.memory.session is not None
    assert world.memory.session.started_s == begun_s
    assert sessions(world) == []


def test_what_was_interrupted_is_brought_to_its_end() -> None:
    """98.5 % is no reason to begin a charge, but one to finish it."""
    world = World(temperature_c=42.0).charging()
    world.values.update(soc_pct=98.5, temperature_c=45.0)
    world.until(S.SUSPENDED, 2)
    world.values["temperature_c"] = 42.0
    world.tick()
    world.values["temperature_c"] = 39.0
    world.until(S.CHARGING, 20)
    world.values["soc_pct"] = 100.0
    world.until(S.FULL, 2)
    assert len(sessions(world)) == 1


def test_the_stricter_of_policy_and_station_counts() -> None:
    the_bay = bay()
    cold = replace(the_bay, limits=replace(the_bay.limits, temperature_c=Range(10, 30)))
    for celsius, begins in ((9.9, False), (10.0, True), (29.9, True), (30.0, False)):
        world = World(cold, temperature_c=celsius)
        world.run(10)
        assert world.is_in(S.CHARGING if begins else S.SUSPENDED)
    volts = replace(the_bay, limits=replace(the_bay.limits, voltage_v=50.0))
    world = World(volts, voltage_v=50.0)
    world.until(S.CHARGING)
    world.values["voltage_v"] = 50.01
    world.until(S.TRIPPED, 2)


# --- operators --------------------------------------------------------------------------------------------------------

#: The result of each request in each state: how the answer begins, and where the bay is ten seconds later.
VERBS: dict[Request, dict[State, tuple[str, State]]] = {
    Request.STOP: {
        S.STARTING: ("", S.HELD),
        S.OFFLINE: ("", S.HELD),
        S.IDLE: ("", S.HELD),
        S.HELD: ("", S.HELD),
        S.QUALIFYING: ("", S.HELD),
        S.PRECHARGE_PULSE: ("", S.HELD),
        S.PRECHARGE_CONTINUOUS: ("", S.HELD),
        S.CHARGING: ("", S.HELD),
        S.FULL: ("", S.HELD),
        S.SUSPENDED: ("", S.HELD),
        S.STOPPING: ("", S.UNCONTROLLABLE),  # it is deaf in this world
        S.TRIPPED: ("", S.TRIPPED),
        S.UNCONTROLLABLE: ("", S.UNCONTROLLABLE),
    },
    Request.PAUSE: {
        S.STARTING: ("", S.SUSPENDED),
        S.OFFLINE: ("", S.SUSPENDED),
        S.IDLE: ("", S.SUSPENDED),
        S.HELD: ("not running: stopped by the operator", S.HELD),
        S.QUALIFYING: ("", S.SUSPENDED),
        S.PRECHARGE_PULSE: ("", S.SUSPENDED),
        S.PRECHARGE_CONTINUOUS: ("", S.SUSPENDED),
        S.CHARGING: ("", S.SUSPENDED),
        S.FULL: ("", S.SUSPENDED),
        S.SUSPENDED: ("", S.SUSPENDED),
        S.STOPPING: ("", S.UNCONTROLLABLE),
        S.TRIPPED: ("not running: internal must be reset first", S.TRIPPED),
        S.UNCONTROLLABLE: ("not running: will_not_stop must be reset first", S.UNCONTROLLABLE),
    },
    Request.START: {
        S.STARTING: ("nothing to start: STARTING: ", S.CHARGING),
        S.OFFLINE: ("nothing to start: OFFLINE: ", S.OFFLINE),
        S.IDLE: ("nothing to start: IDLE: ", S.IDLE),  # 99 %: nothing to do
        S.HELD: ("", S.CHARGING),
        S.QUALIFYING: ("", S.CHARGING),
        S.PRECHARGE_PULSE: ("", S.PRECHARGE_PULSE),
        S.PRECHARGE_CONTINUOUS: ("", S.PRECHARGE_CONTINUOUS),
        S.CHARGING: ("", S.CHARGING),
        S.FULL: ("nothing to start: FULL: ", S.FULL),
        S.SUSPENDED: ("", S.CHARGING),
        S.STOPPING: ("", S.UNCONTROLLABLE),
        S.TRIPPED: ("internal: start is refused before a reset: this is a defect", S.TRIPPED),
        S.UNCONTROLLABLE: ("the charger was not seen to stop: cut its mains", S.UNCONTROLLABLE),
    },
    Request.RESET: {
        S.STARTING: ("nothing to reset: STARTING: ", S.CHARGING),
        S.OFFLINE: ("nothing to reset: OFFLINE: ", S.OFFLINE),
        S.IDLE: ("nothing to reset: IDLE: ", S.IDLE),
        S.HELD: ("nothing to reset: HELD: ", S.HELD),
        S.QUALIFYING: ("nothing to reset: QUALIFYING: ", S.CHARGING),
        S.PRECHARGE_PULSE: ("nothing to reset: PRECHARGE_PULSE: ", S.PRECHARGE_PULSE),
        S.PRECHARGE_CONTINUOUS: ("nothing to reset: PRECHARGE_CONTINUOUS: ", S.PRECHARGE_CONTINUOUS),
        S.CHARGING: ("nothing to reset: CHARGING: ", S.CHARGING),
        S.FULL: ("nothing to reset: FULL: ", S.FULL),
        S.SUSPENDED: ("nothing to reset: SUSPENDED: ", S.SUSPENDED),
        S.STOPPING: ("nothing to reset: STOPPING: ", S.UNCONTROLLABLE),
        S.TRIPPED: ("", S.HELD),
        S.UNCONTROLLABLE: ("the charger was not seen to stop: cut its mains", S.UNCONTROLLABLE),
    },
}


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("request_", Request)
def test_every_verb_in_every_state(request_: Request, state: State) -> None:
    world = IN[state]()
    if state is S.UNCONTROLLABLE:
        world.run(1)  # until it is reported, too
    answer, then = VERBS[request_][state]
    said = world.ask(request_)
    assert said.startswith(answer) if answer else said == ""
    if request_ in (Request.STOP, Request.PAUSE) and state in ENERGISED:
        assert world.decision.command == STOP  # in the same decision
    world.run(10)
    assert world.is_in(then)


def test_a_stop_holds_until_a_start() -> None:
    for begin in (charging, full, suspended, idle):
        world = begin()
        world.ask(Request.STOP)
        world.values["soc_pct"] = 40.0
        world.run(100)
        assert world.is_in(S.HELD)
        assert reason_of(world.decision) == f"{say(STOPPED)}; to go on: orchestrator start bay-1"
        assert world.ask(Request.PAUSE) == f"not running: {say(STOPPED)}"
        world.leave()
        world.run(5)
        world.arrive()
        world.run(20)
        assert world.is_in(S.HELD)  # also for another battery
        assert world.ask(Request.START) == ""
        world.until(S.CHARGING, 10)


def test_a_pause_goes_on_in_the_same_session() -> None:
    world = charging()
    world.ask(Request.PAUSE)
    world.run(3600, dt_s=1.0)
    assert world.is_in(S.SUSPENDED)
    assert reason_of(world.decision) == "paused by the operator; to go on: orchestrator start bay-1"
    world.ask(Request.START)
    world.until(S.CHARGING, 10)
    assert sessions(world) == []


def test_a_stop_while_tripped_is_remembered_over_the_reset() -> None:
    world = tripped()
    world.ask(Request.STOP)
    world.ask(Request.RESET)
    world.run(20)
    assert world.is_in(S.HELD)
    world.ask(Request.START)
    world.until(S.CHARGING, 10)


# --- what is found at the start, what goes and comes back -------------------------------------------------------------


def test_a_charger_that_comes_back_running_is_stopped_and_waits_for_a_person() -> None:
    world = World()
    world.charger_answers = False
    world.until(S.OFFLINE)
    world.deaf.add(Action.STOP)
    world.charger.resting, world.charger.run = False, True
    world.charger_answers = True
    assert world.tick().state is S.STOPPING
    world.deaf.clear()
    world.run(20)
    assert world.is_in(S.HELD)
    assert "found running" in reason_of(world.decision)
    world.ask(Request.START)
    world.until(S.CHARGING, 10)


def test_offline_and_back() -> None:
    world = offline()
    assert reason_of(world.decision).startswith("48.0 V at the charger, but the BMU (node 0x10) does not answer; ")
    world.battery_link = replace(
        world.battery_link, problem=cause("BMU 0x10 on can0 does not answer: no frame of it came")
    )
    assert reason_of(world.tick()) == (
        "48.0 V at the charger, but BMU 0x10 on can0 does not answer: no frame of it came; "
        "the bay goes on by itself once the BMU answers"
    )
    world.battery_answers = True
    world.until(S.CHARGING, 10)


def test_a_charger_without_a_reason_is_named_by_its_port() -> None:
    world = idle()
    world.charger_link = replace(world.charger_link, online=False)
    assert world.tick().state is S.OFFLINE
    assert reason_of(world.decision) == "the charger on /dev/ttyX does not answer"


def test_a_line_that_dies_in_mid_charge_and_comes_back() -> None:
    world = charging()
    world.charger_answers = False
    assert reason_of(world.until(S.STOPPING, 2)).startswith("/dev/ttyX: no answer; check")
    world.until(S.UNCONTROLLABLE, 4)
    assert reason_of(world.decision) == (
        "CUT THE MAINS of this charger (/dev/ttyX) now: nothing has proved for 3 s that it obeyed the stop: /dev/ttyX: "
        "no answer; 14.00 A, last heard 4 s ago; the BMU sees 0.0 A"
    )
    assert not sessions(world)  # its limits continue, too
    world.charger_answers = True
    world.until(S.SUSPENDED, 11)
    assert world.decision.alarm is Alarm.NONE
    world.until(S.CHARGING, 30)
    assert world.decision.session is not None
    assert world.decision.session.charged_ah > 0  # the earlier session's


def test_a_port_that_says_what_is_wrong_is_quoted() -> None:
    world = charging()
    world.charger_link = replace(world.charger_link, online=False, problem=cause("/dev/ttyX: no such port"))
    world.charger_answers = False
    assert "now: nothing has proved for 3 s that it obeyed the stop: /dev/ttyX: no such port; " in reason_of(
        world.until(S.UNCONTROLLABLE, 5)
    )


def test_a_bmu_that_boots_in_mid_charge_is_qualified_anew() -> None:
    world = charging()
    world.boot()
    reason = reason_of(world.tick())
    assert world.is_in(S.STOPPING)
    assert reason.startswith("the BMU booted while charging")  # not that it is silent, though it reports nothing yet
    assert set(world.raised) == {"bmu_rebooted"}
    world.until(S.CHARGING, 30)
    assert len(world.memory.faults["bmu_rebooted"].strikes) == 1


def test_a_new_fault_at_rest_has_the_charger_stopped_and_verified_again() -> None:
    world = idle()
    world.battery_link = replace(world.battery_link, emergency=cause("EMCY 0x1000"))
    assert world.tick().state is S.STOPPING
    assert world.decision.command == STOP
    assert world.tick().state is S.STOPPING  # one reply is not enough
    assert world.tick().state is S.HELD


def test_a_trip_is_verified_again_when_another_fault_comes() -> None:
    world = tripped()
    world.shows["charge_mode"] = ChargeMode.ERROR_STOP
    assert world.tick().state is S.STOPPING
    world.until(S.TRIPPED, 2)


def test_a_tripped_charger_that_runs_is_stopped() -> None:
    world = tripped()
    world.charger.resting, world.charger.run = False, True
    assert world.tick().state is S.STOPPING
    world.until(S.TRIPPED, 2)
    assert {"internal", "rogue_run"} <= set(world.raised)


def test_a_tripped_charger_that_runs_again_is_stopped_again() -> None:
    world = tripped()
    for _ in range(3):
        world.charger.resting, world.charger.run = False, True
        assert world.tick().state is S.STOPPING
        world.until(S.TRIPPED, 2)
    assert "the charger runs though it was not commanded to" in {reason_of(decision) for decision in world.decisions}


def test_a_precharge_that_lost_its_rule_stops() -> None:
    world = pulse()
    world.rules = Rules.of(bay(replace(POLICY, precharge=None)))
    decision = world.tick()
    assert decision.command == STOP
    assert reason_of(decision) == "precharge without a rule for it, or without the pack's voltage"


def test_our_own_exception_trips_with_its_words() -> None:
    world = tripped()
    do = "this is a defect of the software: report it with the journal, then reset"
    assert reason_of(world.decision).startswith(f"{do} – at 1004 s, ZeroDivisionError() in step, line 1; gone since ")
    assert world.decision.faults[0].effect is Effect.TRIP


# --- the session ------------------------------------------------------------------------------------------------------


def test_a_session_counts_time_and_charge() -> None:
    world = charging()
    world.run(1800, dt_s=0.5)
    session = world.decision.session
    assert session is not None
    assert session.charged_ah == pytest.approx(7.0, rel=0.01)
    assert session.charged_wh == pytest.approx(7.0 * 48, rel=0.01)
    assert session.elapsed_s == session.energised_s == world.now_s - session.started_s
    assert session.result is None


def test_a_gap_in_the_readings_counts_no_more_than_a_reading_may_be_old() -> None:
    world = charging()
    before = world.memory.session
    assert before is not None
    world.tick(dt_s=100.0)
    after = world.memory.session or sessions(world)[-1]
    assert after.charged_ah - before.charged_ah == pytest.approx(14.0 * 1.5 / 3600)


def test_a_reading_counts_once() -> None:
    world = charging()
    world.tick()
    before = world.memory.session
    world.port_hangs = True
    for _ in range(4):
        world.tick()
    assert before is not None
    assert world.memory.session is not None
    assert world.memory.session.charged_ah == before.charged_ah


def test_nothing_is_counted_in_standby() -> None:
    """Over days, a measurement offset would be taken for charge and latch the bay."""
    world = suspended()
    before = world.memory.session
    world.leak_a = 0.4
    world.run(24 * 3600, dt_s=10.0)
    after = world.memory.session
    assert before is not None
    assert after is not None
    assert after.charged_ah == before.charged_ah
    assert after.energised_s == before.energised_s
    assert after.elapsed_s == world.now_s - after.started_s


ENDS: tuple[tuple[Callable[[World], object], State, str], ...] = (
    (lambda world: world.ask(Request.STOP), S.HELD, say(STOPPED)),
    (lambda world: world.values.update(soc_pct=100.0), S.FULL, "full: SOC 100 %"),
    (lambda world: setattr(world, "internal", "KeyError()"), S.TRIPPED, "this is a defect of the software"),
    (lambda world: world.leave(), S.IDLE, "the BMU (node 0x10) has stopped answering"),
)


@pytest.mark.parametrize(("end", "state", "result"), ENDS, ids=[str(state) for _, state, _ in ENDS])
def test_a_session_ends_once_with_its_reason(end: Callable[[World], object], state: State, result: str) -> None:
    world = charging()
    end(world)
    world.until(state, 10)
    assert [say(session.result).startswith(result) for session in sessions(world)] == [True]
    world.run(5)
    assert world.decision.session is None
    assert len(sessions(world)) == 1


def test_limits_of_time_and_charge_count_from_charge_to_charge() -> None:
    policy: Policy = replace(POLICY, finish=replace(POLICY.finish, max_ah=1.4))
    world = World(bay(policy)).charging()
    for _ in range(3):
        world.run(250, dt_s=0.5)
        world.values["soc_pct"] = 100.0
        world.until(S.FULL, 2)
        world.values["soc_pct"] = 50.0
        world.charging()
    assert set(world.raised) == {"soc_jump"}


# --- automatic --------------------------------------------------------------------------------------------------------


def test_automatic_mode_ends_when_the_charger_is_full() -> None:
    world = World(bay(control=ControlMode.AUTOMATIC), soc_pct=85.0)
    world.until(S.CHARGING)
    world.values["voltage_v"] = 53.6
    world.run(10)
    charger_says_full(world)
    world.until(S.FULL, 2)
    assert world.charger.resting


def test_a_node_that_falls_silent_is_not_said_to_withhold_a_temperature() -> None:
    """If heartbeat and values go stale in the same decision, the more specific one is the reason."""
    world = charging()
    world.battery_link = replace(world.battery_link, heartbeat_s=0.5, heartbeat_t_s=world.now_s - 0.75)
    world.frozen.update(("temperature_c", "status"))
    reason = reason_of(world.until(S.STOPPING, 3))
    assert {"heartbeat_lost", "stale_reading"} == set(world.raised)
    assert reason.startswith("no heartbeat of the BMU for 2.5 s")


def test_a_node_that_falls_silent_is_said_to_be_silent_whatever_was_read_last() -> None:
    """Its temperature, which is read twice a second, is too old before its voltage, and the bay stops then."""
    world = charging()
    world.frozen.add("temperature_c")
    measured_s = world.now_s
    world.run(0.45)
    world.battery_answers = False
    reason = reason_of(world.until(S.STOPPING, 2))
    assert "bmu_silent" in world.raised and "stale_reading" not in world.raised, reason
    assert world.now_s - measured_s <= FAST_STALE_S + TICK_S


def test_a_node_that_answers_seldom_is_not_taken_for_a_silent_one() -> None:
    world = charging()
    world.frozen.update(("voltage_v", "current_a", "status"))
    assert "no fresh voltage" in reason_of(world.until(S.STOPPING, 2))


def test_a_node_that_answers_may_lose_three_heartbeats_and_a_silent_one_two() -> None:
    for values, lost_s in ({}, 2.5), ({"voltage_v", "temperature_c", "status"}, 1.5):
        world = charging()
        world.battery_link = replace(world.battery_link, heartbeat_s=0.5, heartbeat_t_s=world.now_s)
        world.frozen.update(values)
        world.run(lost_s - 0.25)
        assert not world.raised
        assert [fault.id for fault in world.tick().faults] == ["heartbeat_lost"]
