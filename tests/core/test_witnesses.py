"""Charger and BMU compared: what proves standby, which one is believed, whose battery it is."""

from collections.abc import Callable
from dataclasses import replace
from itertools import cycle

import pytest

from orchestrator.config.load import load_policy
from orchestrator.config.policy import CellType, Policy
from orchestrator.core.facts import Facts
from orchestrator.core.safestop import LASTS_S
from orchestrator.core.states import ENERGISED
from orchestrator.core.witnesses import pack as packs
from orchestrator.model import STOP, Action, Alarm, ChargeMode, Measurement, Operation, Request, State
from orchestrator.sim import chemistry
from tests.core.bays import IN, POLICY, charging, idle, stopping
from tests.core.edges import Edge
from tests.core.said import reason_of, say
from tests.core.world import TICK_S, World, bay, fitting_v

AT_REST = {State.IDLE, State.HELD, State.FULL, State.SUSPENDED, State.TRIPPED, State.QUALIFYING}
every_state = pytest.mark.parametrize("state", State)

# --- a standby that does not last -------------------------------------------------------------------------------------


def answers(world: World, pattern: str) -> None:
    """Reply by reply: `0` shows standby, `1` shows that it runs and delivers; until the bay is out of control."""
    end_s = world.now_s + 10.0
    for shown in cycle(pattern):
        world.shows = {"operation": Operation(int(shown)), "current_a": 14.0 if shown == "1" else 0.0}
        world.tick()
        if world.is_in(State.UNCONTROLLABLE) or world.now_s > end_s:
            return


@pytest.mark.parametrize("pattern", ["1", "01", "10", "001", "010", "100", "0001", "000001", "0011", "00000000001"])
def test_a_charger_that_says_now_this_and_now_that_is_out_of_control(pattern: str) -> None:
    world = charging()
    world.pack_amps = 0.0  # the BMU is no help
    world.ask(Request.STOP)
    stopped_s = world.now_s
    answers(world, pattern)
    assert world.is_in(State.UNCONTROLLABLE), world.decision
    assert world.decision.alarm is Alarm.DANGER
    assert world.decision.command == STOP
    # A single reply among others may be a stray measurement; a second one is not.
    most_s = 4.0 if "11" in pattern + pattern[0] or len(pattern) < 3 else 4.0 + 2 * len(pattern) * TICK_S
    assert 3.0 <= world.now_s - stopped_s <= most_s
    assert reason_of(world.decision).startswith("CUT THE MAINS of this charger (/dev/ttyX)")
    for shown in cycle(pattern):  # and it stays so as long as the charger does
        world.shows["operation"] = Operation(int(shown))
        world.tick()
        assert world.is_in(State.UNCONTROLLABLE)
        assert world.decision.alarm is Alarm.DANGER
        if world.now_s > stopped_s + 60:
            break


@pytest.mark.parametrize("after_s", [0.5, 2.75, 5.0, 9.5])
def test_one_that_runs_again_within_ten_seconds_was_never_verified(after_s: float) -> None:
    world = charging()
    world.ask(Request.STOP)
    stopped_s = world.now_s
    world.until(State.HELD, 1.0)
    world.run(after_s)
    assert world.is_in(State.HELD)
    world.shows = {"operation": Operation.RUNNING, "current_a": 14.0}
    world.pack_amps = 14.0
    world.tick()
    while world.is_in(State.STOPPING):
        world.tick()
    assert world.is_in(State.UNCONTROLLABLE)
    assert world.now_s - stopped_s <= max(3.5, after_s + 1.5)


def test_one_that_ran_again_after_a_minute_has_its_three_seconds() -> None:
    world = charging()
    world.ask(Request.STOP)
    world.until(State.HELD, 1.0)
    world.run(60)
    world.shows = {"operation": Operation.RUNNING, "current_a": 14.0}
    world.tick()
    assert world.is_in(State.STOPPING)
    world.run(2.75)
    assert world.is_in(State.STOPPING)
    assert world.tick().state is State.UNCONTROLLABLE


def test_out_of_control_is_left_only_by_a_standby_of_ten_seconds_without_a_break() -> None:
    world = IN[State.UNCONTROLLABLE]()
    world.run(1)
    world.deaf.clear()
    world.run(LASTS_S)
    assert world.is_in(State.UNCONTROLLABLE)
    assert "unless it stays off: it has stood by for" in reason_of(world.decision)
    world.shows["operation"] = Operation.RUNNING  # one reply
    world.tick()
    world.shows.clear()
    world.run(LASTS_S)
    assert world.is_in(State.UNCONTROLLABLE)
    world.run(2 * TICK_S)
    assert world.is_in(State.TRIPPED)
    assert world.decision.alarm is not Alarm.DANGER


# --- the BMU's report -------------------------------------------------------------------------------------------------


def delivers_and_denies_it(world: World) -> None:
    world.battery_answers = True
    world.pack_amps = 14.0
    world.shows |= {"operation": Operation.STOPPED, "current_a": 0.0, "charge_mode": ChargeMode.FULL}


@every_state
def test_a_charger_that_denies_what_the_bmu_sees_is_out_of_control(state: State) -> None:
    world = IN[state]()
    delivers_and_denies_it(world)
    seen_s = world.now_s
    while not world.is_in(State.UNCONTROLLABLE) if world.decisions else True:
        world.tick()
        assert world.now_s - seen_s <= 6.0, world.decision  # two to believe the BMU, three for the stop, and the ticks
    assert world.decision.alarm is Alarm.DANGER
    before = len(world.decisions)
    world.run(60)
    assert {decision.state for decision in world.decisions[before:]} == {State.UNCONTROLLABLE}
    assert {decision.command for decision in world.decisions[before:]} == {STOP}
    assert not any(decision.closed for decision in world.decisions[before:])
    assert reason_of(world.decision) == (
        "CUT THE MAINS of this charger (/dev/ttyX): it says 0.00 A, the BMU still sees 14.0 A; one of them is wrong. "
        "If the BMU shows it with the mains off too, restart the BMU"
    )
    world.pack_amps = 0.0
    world.run(LASTS_S - 1)
    assert world.is_in(State.UNCONTROLLABLE)
    world.run(2)
    assert world.is_in(State.TRIPPED)
    assert world.decision.alarm is not Alarm.DANGER
    world.run(30)
    assert world.ask(Request.RESET) == ""


@every_state
def test_no_stop_is_verified_while_the_bmu_sees_current(state: State) -> None:
    """Not even briefly: neither at rest with nothing commanded, nor qualified for a charge."""
    world = IN[state]()
    delivers_and_denies_it(world)
    world.run(2.5)
    before = len(world.decisions)
    world.run(30)
    for decision in world.decisions[before:]:
        assert decision.command == STOP
        assert decision.state not in ENERGISED | AT_REST


def test_a_bmu_that_is_not_heard_leaves_the_proof_to_the_charger() -> None:
    world = stopping()
    world.battery_answers = False
    world.run(1.75)
    world.deaf.clear()
    assert world.tick().state is State.STOPPING
    assert world.tick().state in (State.SUSPENDED, State.OFFLINE)


def test_a_value_from_before_the_stop_proves_nothing() -> None:
    """The charger shows standby at once; the BMU's newest current is 0 A, but from before the stop."""
    world = charging()
    world.pack_amps = 0.0
    world.tick()
    world.frozen.add("current_a")
    world.ask(Request.STOP)
    world.run(1.0)
    assert world.is_in(State.STOPPING)
    world.frozen.clear()
    assert world.tick().state is State.HELD


@pytest.mark.parametrize("late_s", [0.25, 0.5, 1.0, 1.5])
def test_a_bmu_that_averages_is_waited_for(late_s: float) -> None:
    """Its current outlasts the charger's for a while: an honest pair is verified within the time of a stop."""
    world = charging()
    world.pack_amps = 14.0
    world.ask(Request.STOP)
    world.run(late_s)
    world.pack_amps = 0.0
    world.until(State.HELD, 2.75 - late_s)
    world.run(30)
    assert not world.raised


def test_a_blip_of_the_bmu_at_rest_is_no_current() -> None:
    world = idle()
    for _ in range(20):
        world.pack_amps = 14.0
        world.run(0.5)
        world.pack_amps = 0.0
        world.run(9.5)
    assert world.is_in(State.IDLE)
    assert not world.raised


def test_a_current_that_comes_and_goes_at_rest_is_found() -> None:
    """One second in every two."""
    world = idle()
    for _ in range(6):
        world.pack_amps = 14.0
        world.run(1.0)
        if world.raised:
            break
        world.pack_amps = 0.0
        world.run(1.0)
    assert "current_without_order" in world.raised


@pytest.mark.parametrize("seconds", [3.0, 60.0, 3600.0])
def test_a_current_that_has_ended_is_forgotten_within_half_a_minute(seconds: float) -> None:
    world = idle()
    world.pack_amps = 14.0
    world.run(seconds, dt_s=0.25 if seconds < 60 else 1.0)
    world.pack_amps = 0.0
    world.until(State.TRIPPED, 30.0)
    world.run(30)
    assert world.is_in(State.TRIPPED)
    assert world.ask(Request.RESET) == ""
    world.run(5)
    assert world.is_in(State.HELD)


# --- whose battery it is ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("moves", ["", "bay-2"])
def test_the_first_amperes_must_show_on_the_bays_own_bmu(moves: str) -> None:
    world = World()
    world.shunt = 0.0
    world.ours = {"moves": moves}
    world.until(State.CHARGING)
    world.until(State.STOPPING, 8.0)
    reason = reason_of(world.decision)
    if moves:
        assert reason.startswith("the charger of bay-1 moves the BMU of bay-2: it has begun with 14.00 A")
    assert "sees 0.00 A of it" in reason
    world.until(State.HELD)
    world.run(600, dt_s=1.0)
    assert world.is_in(State.HELD)  # it waits for a person
    assert "pairing_not_proved" in world.raised


def test_a_bmu_that_sees_another_bays_current_is_not_the_one() -> None:
    """Crossed, while the other bay charges: the current that this BMU sees was there before."""
    world = World()
    world.pack_amps = 0.9
    world.until(State.CHARGING)
    world.amps = 1.5
    world.until(State.STOPPING, 8.0)
    assert "pairing_not_proved" in world.raised


def test_a_load_in_the_vehicle_does_not_hide_the_first_amperes() -> None:
    world = World(current_a=-0.4)
    world.pack_amps = -0.4
    world.until(State.QUALIFYING)
    world.until(State.CHARGING)
    while not world.charger.running:
        world.tick()
    world.pack_amps = 13.6
    world.run(60)
    assert world.is_in(State.CHARGING)
    assert not world.raised


# --- which battery it is ----------------------------------------------------------------------------------------------


def said(policy: Policy, volts: float, soc_pct: float, state: State = State.IDLE) -> str | None:
    bmu: dict[str, float | None] = {"voltage_v": volts, "soc_pct": soc_pct}
    cause = packs.another_pack(Edge(packs.another_pack, None, state=state, policy=policy, bmu=bmu).facts)
    return say(cause) if cause is not None else None


OTHERS: tuple[tuple[str, str, float, float, str], ...] = (
    ("10S NMC, nearly full", "li-ion-48v", 40.0, 90.0, "3.08 V a cell, where at least"),
    ("36 V at 90 %", "li-ion-48v", 36.0, 90.0, "2.77 V a cell, where at least"),
    ("7S NMC, half full", "li-ion-48v", 24.6, 50.0, "1.89 V a cell, where at least"),
    ("15S LFP, half full", "li-ion-48v", 49.4, 95.0, "3.80 V a cell, where at least"),
    ("14S NMC, half full", "li-ion-48v", 51.8, 40.0, "3.98 V a cell, where at most"),
    ("13S NMC, a quarter full", "lfp-48v", 45.5, 30.0, "a cell, where at least"),
    ("12S LFP, half full", "lfp-48v", 39.5, 60.0, "a cell, where at least"),
    ("13S under the 24 V policy", "li-ion-24v", 48.0, 50.0, "6.86 V a cell, where at most"),
)


@pytest.mark.parametrize(("name", "policy", "volts", "soc_pct", "words"), OTHERS, ids=[row[0] for row in OTHERS])
def test_another_kind_of_pack_is_refused(name: str, policy: str, volts: float, soc_pct: float, words: str) -> None:
    text = said(load_policy(policy), volts, soc_pct)
    assert text is not None, name
    assert f"the pack has {volts:.2f} V at SOC {soc_pct:.0f} %" in text
    assert words in text


def lto() -> Policy:
    pack = replace(
        POLICY.pack,
        chemistry=CellType.LTO,
        cells_in_series=20,
        voltage_v=replace(POLICY.pack.voltage_v, low=36.0, high=55.0),
    )
    return replace(POLICY, pack=pack)


#: Cells from text books, which differ from the product's own table.
LTO_CELL = chemistry.Chemistry(
    ocv=((0.0, 1.9), (0.1, 2.12), (0.5, 2.27), (0.9, 2.42), (1.0, 2.65)), deep=((-1.0, 1.5), (0.0, 1.9)),
    high_cell_v=2.8, low_cell_v=1.6,
)  # fmt: skip
HEALTHY = (
    ("li-ion-48v", load_policy("li-ion-48v"), chemistry.NMC),
    ("li-ion-24v", load_policy("li-ion-24v"), chemistry.NMC),
    ("long-life-48v", load_policy("long-life-48v"), chemistry.NMC),
    ("lfp-48v", load_policy("lfp-48v"), chemistry.LFP),
    ("lto", lto(), LTO_CELL),
)


@pytest.mark.parametrize("error_pct", [-10.0, -5.0, 0.0, 5.0, 10.0])
@pytest.mark.parametrize("sag_v", [-0.08, -0.04, 0.0, 0.04, 0.08], ids=lambda sag_v: f"{sag_v:+}V")
@pytest.mark.parametrize(("name", "policy", "cell"), HEALTHY, ids=[row[0] for row in HEALTHY])
def test_a_healthy_pack_is_never_another_one(
    name: str, policy: Policy, cell: chemistry.Chemistry, sag_v: float, error_pct: float
) -> None:
    """Over the whole state of charge, under charge and just after a load, with a gauge that is off by ten per cent."""
    for true_pct in range(101):
        soc_pct = min(max(true_pct + error_pct, 0.0), 100.0)
        volts = (chemistry.interpolate(cell.ocv, true_pct / 100) + sag_v) * policy.pack.cells_in_series
        for state in (State.IDLE, State.CHARGING):
            assert said(policy, volts, soc_pct, state) is None, (name, true_pct)


@pytest.mark.parametrize("cells_v", [2.0, 2.3, 2.6, 2.9])
def test_a_deeply_discharged_pack_is_not_another_one(cells_v: float) -> None:
    for soc_pct in (0.0, 5.0, 19.0):
        assert said(POLICY, 13 * cells_v, soc_pct) is None


def test_a_pack_that_is_refused_is_charged_neither_before_nor_after_somebody_says_start() -> None:
    world = World(voltage_v=36.0, soc_pct=90.0)
    for _ in range(3):
        world.run(60)
        assert world.ask(Request.START).startswith("nothing to start: SUSPENDED: the pack has 36.00 V at SOC 90 %")
    assert not any(decision.state in ENERGISED for decision in world.decisions)
    assert "36.00 V at SOC 90 %: with 13 NMC/NCA cells" in reason_of(world.decision)


def test_a_soc_that_is_corrected_in_mid_charge_ends_it_without_a_latch() -> None:
    world = charging()
    world.values |= {"soc_pct": 90.0, "voltage_v": 47.9}
    world.until(State.HELD, 8.0)
    assert set(world.raised) >= {"another_pack"}
    world.values |= {"soc_pct": 52.0, "voltage_v": 48.0}
    world.run(10)
    assert world.ask(Request.START) == ""
    world.until(State.CHARGING, 10)


# --- a pack that fails ------------------------------------------------------------------------------------------------


def test_a_pack_that_collapses_is_stopped_at_once_and_for_good() -> None:
    world = World(voltage_v=45.0, soc_pct=22.0).charging()
    world.values["voltage_v"] = 31.0
    world.tick()
    assert world.is_in(State.STOPPING)
    assert world.raised["pack_collapsed"].startswith("keep people away")
    world.until(State.TRIPPED, 2.0)
    world.run(60)
    told = world.raised["pack_collapsed"]
    assert "the pack has 31.00 V, below 39 V" in told
    assert "gone since" not in told
    refused = world.ask(Request.RESET)
    assert refused.startswith("pack_collapsed: reset is refused while it lasts: ")
    world.values["voltage_v"] = 45.0
    world.run(1)
    assert world.ask(Request.RESET) == ""


def test_a_collapsed_pack_can_be_exchanged() -> None:
    world = World(voltage_v=45.0, soc_pct=22.0).charging()
    world.values["voltage_v"] = 31.0
    world.until(State.TRIPPED, 2.0)
    world.leave()
    world.run(5)
    assert world.ask(Request.RESET) == ""


def test_the_fall_at_the_end_of_a_current_is_no_collapse() -> None:
    world = World(voltage_v=50.0, soc_pct=60.0).charging()
    world.run(15)
    world.values["voltage_v"] = 47.4  # a pack with high resistance
    world.amps = 2.0
    world.run(20)
    assert world.is_in(State.CHARGING)


def test_a_fall_that_only_the_bmu_sees_is_not_the_packs() -> None:
    world = charging()
    world.volts = 48.0
    world.values["voltage_v"] = 45.5
    world.run(1)
    assert "pack_collapsed" not in world.raised


# --- what a charger does with its settings ----------------------------------------------------------------------------


def goes_back(world: World, after: int) -> Callable[[], None]:
    """The charger shows each new limit for this many replies, and then the highest again."""
    shown = {"told": -1, "replies": 0}

    def tick() -> None:
        told = world.charger.limit
        shown["replies"] = shown["replies"] + 1 if told == shown["told"] else 0
        shown["told"] = told
        if shown["replies"] >= after:
            world.charger.limit, shown["told"] = 4, -1
        world.tick()

    return tick


@pytest.mark.parametrize("after", [1, 2, 4, 8])
def test_a_limit_that_goes_back_is_found_out(after: int) -> None:
    """9 A on average where 2 A are allowed, while the status is right most of the time."""
    world = World(temperature_c=5.0)
    world.until(State.CHARGING)
    begun_s, charged_as, tick = world.now_s, 0.0, goes_back(world, after)
    while world.is_in(State.CHARGING):
        tick()
        charged_as += world.reading.current_a * TICK_S if world.reading else 0.0
        assert world.now_s - begun_s < 15.0, world.decision
    assert {"limit_reverted", "above_step"} & set(world.raised)
    world.shows.clear()
    world.until(State.TRIPPED, 4.0)


def test_a_limit_that_went_back_once_is_set_again() -> None:
    world = World(temperature_c=5.0).charging()
    for _ in range(3):
        world.charger.limit = 4
        world.run(62)
        assert world.charger.limit == 0
    assert world.is_in(State.CHARGING)
    assert not world.raised


def test_a_step_that_is_told_anew_is_not_one_that_went_back() -> None:
    world = charging()
    for celsius in (5.0, 20.0, 5.0, 20.0, 5.0, 20.0):
        world.values["temperature_c"] = celsius
        world.run(61)
    assert "limit_reverted" not in world.raised
    assert world.memory.charger.reverts == ()


# --- mode 5 -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("soc_pct", [80.0, 85.0, 99.0])
def test_a_charger_that_somebody_stopped_is_not_full(soc_pct: float) -> None:
    """Its own stop key also leaves mode 5 and operation 0 behind."""
    world = charging()
    world.values["soc_pct"] = soc_pct
    world.run(20)
    world.shows.update(charge_mode=ChargeMode.FULL, operation=Operation.STOPPED, current_a=0.0)
    world.until(State.HELD, 3.0)
    assert set(world.raised) - {"soc_jump"} == {"stopped_by_itself"}
    assert world.memory.battery.full_pct is None
    world.shows.clear()
    world.run(600, dt_s=1.0)
    assert world.is_in(State.HELD)  # it does not charge again by itself


# --- frozen values ----------------------------------------------------------------------------------------------------


def test_a_bmu_that_stands_still_is_found_by_what_goes_in() -> None:
    """Volts on a flat part of the curve: only the ampere hours tell."""
    world = charging()
    world.counts = False
    world.until(State.STOPPING, 300.0)
    assert "the BMU has said the same in every word for" in reason_of(world.decision)
    assert "Ah went in" in reason_of(world.decision)


def test_a_frozen_bmu_is_no_witness_of_the_current_that_it_goes_on_telling() -> None:
    world = charging()
    world.counts, world.pack_amps = False, 14.0
    world.until(State.STOPPING, 300.0)
    assert "every word" in reason_of(world.decision)
    world.run(60)
    assert world.is_in(State.SUSPENDED), "the charger stands by, and nobody else can tell"
    assert "bmu_frozen" in world.raised, "for as long as its words stand still"
    world.counts, world.pack_amps = True, None
    world.values["temperature_c"] = 20.1
    world.run(30)
    assert "bmu_frozen" not in world.raised


def test_a_bmu_that_moves_in_one_word_is_not_frozen() -> None:
    world = charging()
    world.counts = False
    for tenth in range(40):
        world.values["temperature_c"] = 20.0 + tenth / 10
        world.run(50, dt_s=1.0)
    assert world.is_in(State.CHARGING)


def test_both_that_change_one_after_the_other_are_not_frozen() -> None:
    """After minutes of the same digits the charger's volts fall, and the BMU's follow two seconds later."""
    world = charging()
    world.counts = False
    world.run(100)
    world.volts = 47.7
    world.run(2)
    world.values["voltage_v"] = 47.7
    world.volts = None
    world.run(5)
    assert world.is_in(State.CHARGING)
    assert not world.raised


def test_facts_without_a_reading_have_no_witness() -> None:
    """A BMU value from the future, or one that is not a number, counts as none."""
    for value in (Measurement(14.0, 1e9), Measurement(float("nan"), 0.0)):
        world = idle()
        snapshot = world.snapshot(None, "")
        battery = replace(snapshot.battery, current_a=value)
        f = Facts.of(world.now_s, replace(snapshot, battery=battery), world.memory, world.rules)
        assert f.pack_a is None
        assert not f.unordered


def test_the_voltages_of_the_tests_fit() -> None:
    """What the other tests rely on."""
    rules = bay().policy.pack
    for soc_pct in range(101):
        assert said(POLICY, fitting_v(rules, soc_pct, 48.0), soc_pct) is None


# --- a charge that somebody stops before a reply has shown it ---------------------------------------------------------


def begun() -> World:
    """Told to run, and no reply shows it yet."""
    world = World(voltage_v=48.0)
    world.deaf = {Action.RUN}
    world.until(State.CHARGING)
    world.run(2.0)
    assert world.decision.command is not None
    assert world.decision.command.action is Action.RUN
    return world


def test_a_charger_that_is_in_standby_again_is_not_started_over_whoever_stopped_it() -> None:
    world = begun()
    world.charger.resting = True
    world.run(2.0)
    assert world.raised.keys() & {"stopped_by_itself", "early_full"}, "both wait for a person"
    world.deaf = set()
    world.run(60.0)
    assert world.is_in(State.HELD)
    assert not world.charger.running


def test_a_current_that_only_the_bmu_has_seen_was_a_charge() -> None:
    world = begun()
    world.pack_amps = 6.0
    world.run(0.5)
    world.pack_amps = 0.0
    world.deaf = set()
    world.run(60.0)
    assert world.is_in(State.HELD)
    assert not world.charger.running
    assert Action.RUN not in {command.action for command in world.commands[-1:] if command is not None}
