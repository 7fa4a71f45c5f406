"""The same battery, or another: what was found full stays full while its BMU sleeps, and not a moment longer."""

from dataclasses import replace

import pytest

from orchestrator.core.checks.state_of_charge import EXCHANGE_NEWS_S
from orchestrator.core.persisted import Persisted
from orchestrator.model import Request, State
from tests.core.said import reason_of
from tests.core.test_next_transition import charger_says_full, tapers_off
from tests.core.world import World

S = State
#: Where its BMU says that it is when the charger has filled it, below the SOC at which a new battery is charged.
FULL_PCT = 90.0
ASLEEP_S, AWAKE_S = 60.0, 30.0


def full() -> World:
    """A pack whose BMU says 90 % when it is full."""
    world = World().charging()
    world.values["soc_pct"] = FULL_PCT
    tapers_off(world)
    charger_says_full(world)
    world.until(S.FULL, 3)
    world.shows.clear()
    assert world.rules.policy.start.soc_below_pct > FULL_PCT
    world.run(AWAKE_S)
    assert world.is_in(S.FULL)
    return world


def sleeps(world: World, seconds: float = ASLEEP_S) -> None:
    world.battery_answers = False
    world.run(seconds)
    assert world.is_in(S.OFFLINE)


def wakes(world: World, seconds: float = AWAKE_S) -> None:
    world.battery_answers = True
    world.run(seconds)


def test_a_full_pack_whose_bmu_sleeps_is_not_charged_again() -> None:
    world = full()
    for _ in range(3):
        sleeps(world)
        wakes(world)
        assert world.is_in(S.FULL), reason_of(world.decision)
    assert S.CHARGING not in world.states(3 * (ASLEEP_S + AWAKE_S))


def test_a_bmu_that_boots_when_it_wakes_is_that_of_the_same_battery() -> None:
    world = full()
    sleeps(world)
    world.boot()
    wakes(world)
    assert world.is_in(S.FULL), reason_of(world.decision)


def test_a_full_pack_that_has_lost_enough_in_its_sleep_is_charged_again() -> None:
    world = full()
    sleeps(world, 600)
    world.values["soc_pct"] = FULL_PCT - 3.1
    wakes(world)
    assert world.is_in(S.CHARGING)


def test_a_pack_may_relax_while_nobody_but_the_charger_looks() -> None:
    """By more in all than two packs may differ, but slowly."""
    world = full()
    sleeps(world)
    start_v = world.values["voltage_v"]
    assert start_v is not None
    for share in (0.97, 0.94, 0.92):
        world.volts = share * start_v
        world.run(10)
    world.values["voltage_v"] = world.volts
    wakes(world)
    assert world.is_in(S.FULL), reason_of(world.decision)


def test_a_battery_that_was_seen_to_leave_is_another_when_it_returns() -> None:
    world = full()
    world.leave()
    world.until(S.IDLE)
    world.arrive()
    world.run(AWAKE_S)
    assert world.is_in(S.CHARGING)


@pytest.mark.parametrize("share", [0.94, 1.06])
def test_other_volts_at_the_charger_are_another_battery(share: float) -> None:
    world = full()
    sleeps(world)
    volts = world.values["voltage_v"]
    assert volts is not None
    world.volts = share * volts
    world.run(1)
    world.volts = None
    wakes(world)
    assert world.is_in(S.CHARGING)


@pytest.mark.parametrize(("blind_s", "state"), [(8.0, S.FULL), (12.0, S.CHARGING)])
def test_what_nobody_has_seen_for_a_while_may_be_another_battery(blind_s: float, state: State) -> None:
    world = full()
    sleeps(world)
    world.charger_answers = False
    world.run(blind_s)
    world.charger_answers = True
    world.run(5)
    wakes(world)
    assert world.is_in(state), reason_of(world.decision)


def test_behind_an_open_contactor_nobody_sees_the_pack() -> None:
    world = full()
    world.connected = False
    sleeps(world, 90)
    world.connected = True
    wakes(world)
    assert world.is_in(S.CHARGING)


def test_a_restart_while_the_bmu_sleeps_forgets_nothing() -> None:
    world = full()
    sleeps(world)
    world.memory = Persisted.of(world.memory, world.now_s).memory(world.now_s)
    world.run(ASLEEP_S)
    wakes(world)
    assert world.is_in(S.FULL), reason_of(world.decision)


def test_a_restart_does_not_know_a_battery_that_nobody_sees_afterwards() -> None:
    world = full()
    sleeps(world)
    world.memory = Persisted.of(world.memory, world.now_s).memory(world.now_s)
    world.charger_answers = False
    world.run(90)
    world.charger_answers = True
    world.run(5)
    wakes(world)
    assert world.is_in(S.CHARGING)


# --- by its serial number ---------------------------------------------------------------------------------------------


def tells(world: World, serial: int | None) -> None:
    """The BMU is heard anew, and has told this since."""
    world.battery_link = replace(world.battery_link, serial=serial)


def known_full() -> World:
    world = full()
    tells(world, 4711)
    world.run(1)
    assert world.memory.battery.serial == 4711
    return world


def hidden(world: World, seconds: float = 90) -> None:
    """Nobody sees the pack, and the BMU will be heard anew."""
    tells(world, None)
    world.charger_answers = False
    sleeps(world, seconds)
    world.charger_answers = True
    world.run(2)


def test_the_same_serial_number_is_the_same_battery_though_nobody_saw_it() -> None:
    world = known_full()
    hidden(world)
    wakes(world)
    assert world.is_in(S.FULL), "it is not known yet whether it is another one"
    tells(world, 4711)
    world.run(10)
    assert world.is_in(S.FULL)


@pytest.mark.parametrize("serial", [4712, 0])
def test_another_serial_number_or_none_is_another_battery(serial: int) -> None:
    world = known_full()
    hidden(world)
    wakes(world)
    tells(world, serial)
    world.tick()
    assert world.memory.battery.another
    world.run(10)
    assert not world.memory.battery.another
    assert world.is_in(S.CHARGING)
    assert world.memory.battery.serial == (serial or None)
    assert "battery_exchanged" not in world.raised, "nothing was charging, so nothing is to be ended"


def test_a_first_serial_number_changes_nothing() -> None:
    world = full()
    tells(world, 4711)
    world.run(10)
    assert world.is_in(S.FULL)


def test_another_battery_has_not_been_charged_all_the_way_by_the_last_one() -> None:
    world = known_full()
    before_s = world.memory.battery.full_s
    hidden(world)
    tells(world, 4712)
    wakes(world, 5)
    assert before_s is not None
    assert world.memory.battery.full_s == pytest.approx(world.now_s - 5, abs=1)


def silent_in_mid_charge() -> World:
    """A charge of battery 4711 whose BMU has been silent for 5 s and is about to speak again."""
    world = World().charging()
    tells(world, 4711)
    world.run(1)
    tells(world, None)
    world.battery_answers = False
    world.run(5)
    world.battery_answers = True
    return world


def test_a_battery_exchanged_in_mid_charge_ends_the_charge() -> None:
    world = silent_in_mid_charge()
    world.run(1)
    assert world.memory.session is not None
    tells(world, 4712)
    world.until(S.HELD, 5)
    assert world.raised["battery_exchanged"] == (
        "the BMU's serial number is 4712, and was 4711: this is another battery; "
        "look which battery is in the bay, then start"
    )
    assert world.memory.session is None
    world.run(EXCHANGE_NEWS_S)
    assert world.ask(Request.START) == ""
    world.until(S.CHARGING, 30)


def test_the_same_battery_goes_on_with_its_charge() -> None:
    world = silent_in_mid_charge()
    tells(world, 4711)
    world.run(5)
    assert "battery_exchanged" not in world.raised
    assert world.memory.session is not None


def test_an_exchange_across_a_restart_is_one() -> None:
    world = World().charging()
    tells(world, 4711)
    world.run(1)
    world.memory = Persisted.of(world.memory, world.now_s).memory(world.now_s)
    tells(world, 4712)
    world.run(2)
    assert "battery_exchanged" in world.raised


# --- whether it may be another one ------------------------------------------------------------------------------------


def test_a_battery_that_leaves_may_be_another_until_one_is_heard() -> None:
    world = World().charging()
    assert not world.memory.battery.another
    world.leave()
    world.until(S.IDLE)
    assert world.memory.battery.another
    world.run(60)
    assert world.memory.battery.another
    world.arrive()
    world.run(1)
    assert not world.memory.battery.another


def test_an_exchange_that_only_the_soc_tells_is_another_battery() -> None:
    world = full()
    sleeps(world)
    world.values["soc_pct"] = 60.0
    world.battery_answers = True
    found = 0
    for _ in range(20):
        world.tick()
        found += world.memory.battery.another
    assert found == 1
    assert world.memory.battery.full_pct is None


def test_a_sleeping_battery_is_not_another() -> None:
    world = full()
    sleeps(world)
    assert not world.memory.battery.another
    wakes(world)
    assert not world.memory.battery.another
