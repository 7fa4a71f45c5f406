"""The charger's model: the commands it obeys in each mode, and its effect on a battery."""

from itertools import groupby

import pytest

from orchestrator.model import ChargeMode, Connection, ControlMode, Operation, Precharge
from orchestrator.sim.bay import SimulatedBay
from orchestrator.sim.charger import ROGUE_AFTER_S, Push, SimulatedCharger
from orchestrator.sim.pack import Pack


def a_bay(charger: SimulatedCharger, soc: float = 50.0) -> SimulatedBay:
    pack = Pack()
    pack.set_soc(soc)
    return SimulatedBay(charger, pack)


def charging(step: int = 2) -> SimulatedCharger:
    charger = SimulatedCharger()
    start(charger, step, ChargeMode.CHARGE, Precharge.OFF)
    return charger


def start(charger: SimulatedCharger, step: int, mode: ChargeMode, function: Precharge) -> None:
    charger.rest(1)
    charger.push(Push.CURRENT_LIMIT, step)
    charger.push(Push.CHARGE_MODE, mode)
    charger.push(Push.PRECHARGE, function)
    charger.push(Push.OPERATION, 1)


def test_at_power_on_in_manual_it_stands() -> None:
    bay = a_bay(SimulatedCharger())
    bay.advance(5)
    assert (bay.charger.operation, bay.charger.current_a) == (Operation.STOPPED, 0)
    assert bay.charger.charge_mode is ChargeMode.FULL
    assert bay.charger.voltage_v == pytest.approx(48.1)


@pytest.mark.parametrize(("step", "amps"), list(enumerate((2.0, 5.0, 8.0, 11.0, 14.0))))
def test_it_delivers_the_amperes_of_its_step(step: int, amps: float) -> None:
    bay = a_bay(charging(step))
    bay.advance(2)
    assert bay.charger.current_a == bay.pack.current_a == amps
    assert bay.charger.operation is Operation.RUNNING
    assert bay.charger.voltage_v == pytest.approx(bay.pack.voltage_v + amps * bay.charger.lead_ohm)


def test_its_current_rises_gently_and_falls_at_once() -> None:
    bay = a_bay(charging(4))
    bay.advance(0.1)
    assert bay.charger.current_a == pytest.approx(2.0)
    bay.advance(2)
    bay.charger.rest(0)
    assert bay.charger.current_a == 0


def test_values_are_read_back_before_it_runs() -> None:
    charger = SimulatedCharger()
    charger.push(Push.CURRENT_LIMIT, 3)
    charger.push(Push.CHARGE_MODE, 3)
    charger.push(Push.PRECHARGE, 2)
    assert (charger.current_step, charger.charge_mode, charger.precharge) == (3, ChargeMode.PRECHARGE, 2)
    assert charger.operation is Operation.STOPPED


@pytest.mark.parametrize("what", list(Push))
@pytest.mark.parametrize("value", [0, 1, 2, 3, 4, 5, 6, 255])
def test_only_documented_values_are_taken(what: Push, value: int) -> None:
    charger = SimulatedCharger()
    charger.push(what, value)
    taken = {
        Push.OPERATION: int(charger.run),
        Push.CURRENT_LIMIT: charger.current_step,
        Push.CHARGE_MODE: charger.mode,
        Push.PRECHARGE: charger.precharge,
    }[what]
    at_first = {Push.OPERATION: 0, Push.CURRENT_LIMIT: 0, Push.CHARGE_MODE: 5, Push.PRECHARGE: 0}[what]
    allowed = {
        Push.OPERATION: (0, 1),
        Push.CURRENT_LIMIT: (0, 1, 2, 3, 4),
        Push.CHARGE_MODE: (3, 4, 5),
        Push.PRECHARGE: (0, 1, 2),
    }[what]
    assert taken == (value if value in allowed else at_first)


@pytest.mark.parametrize("what", [0, 3, 0x0F, 0x10])
def test_combined_and_unknown_pushes_do_nothing(what: int) -> None:
    charger = SimulatedCharger()
    charger.push(what, 1)
    assert charger == SimulatedCharger()


def test_in_automatic_nothing_but_rest_is_obeyed() -> None:
    charger = SimulatedCharger(ControlMode.AUTOMATIC)
    for what in Push:
        charger.push(what, 3 if what is Push.CHARGE_MODE else 0)
    assert charger == SimulatedCharger(ControlMode.AUTOMATIC)
    charger.rest(0)
    assert charger.operation is Operation.STOPPED


def test_standby_ignores_run_until_it_ends() -> None:
    bay = a_bay(SimulatedCharger())
    bay.charger.rest(0)
    bay.charger.push(Push.CHARGE_MODE, 4)
    bay.charger.push(Push.OPERATION, 1)
    bay.advance(2)
    assert (bay.charger.operation, bay.charger.charge_mode) == (Operation.STOPPED, ChargeMode.FULL)
    bay.charger.rest(1)
    bay.advance(2)
    assert (bay.charger.operation, bay.charger.charge_mode) == (Operation.STOPPED, ChargeMode.CHARGE)
    bay.charger.push(Push.OPERATION, 1)
    assert bay.charger.operation is Operation.RUNNING


def test_a_stop_without_operation_0_is_undone_by_a_resume() -> None:
    charger = charging()
    charger.rest(0)
    assert not charger.running
    charger.rest(1)
    assert charger.operation is Operation.RUNNING, "this is the danger that the second stop frame is for"


def test_a_stop_with_operation_0_is_not() -> None:
    charger = charging()
    charger.rest(0)
    charger.push(Push.OPERATION, 0)
    charger.rest(1)
    assert charger.operation is Operation.STOPPED


def test_pulses_are_a_second_on_and_a_second_off() -> None:
    charger = SimulatedCharger()
    start(charger, 0, ChargeMode.PRECHARGE, Precharge.PULSE)
    bay = a_bay(charger, -50)
    amps = []
    for _ in range(40):
        bay.advance(0.1)
        amps.append(charger.current_a)
        assert charger.operation is Operation.RUNNING
    assert set(amps) == {0.0, charger.precharge_a}
    lengths = [len(list(run)) for _, run in groupby(amps)]
    assert all(9 <= length <= 11 for length in lengths[:-1])
    assert bay.pack.charge_ah - -0.2 == pytest.approx(2 * charger.precharge_a / 3600, rel=0.06)


def test_continuous_precharge_is_small_and_steady_and_off_is_nothing() -> None:
    charger = SimulatedCharger()
    start(charger, 4, ChargeMode.PRECHARGE, Precharge.CONTINUOUS)
    bay = a_bay(charger, -50)
    bay.advance(3)
    assert charger.current_a == charger.precharge_a
    charger.push(Push.PRECHARGE, Precharge.OFF)
    bay.advance(1)
    assert charger.current_a == 0


def test_constant_voltage_then_full() -> None:
    bay = a_bay(charging(4), 90)
    seen_a, seen_v = [], []
    while not bay.charger.full:
        bay.advance(10)
        seen_a.append(bay.charger.current_a)
        seen_v.append(bay.pack.voltage_v)
        assert len(seen_a) < 2000
    falling = [a for a in seen_a if a < 14]
    assert max(seen_v) <= bay.charger.cv_v
    assert len(falling) > 20
    assert falling == sorted(falling, reverse=True)
    assert (bay.charger.charge_mode, bay.charger.operation) == (ChargeMode.FULL, Operation.STOPPED)
    bay.advance(60)
    assert bay.charger.current_a == 0
    bay.charger.push(Push.OPERATION, 1)
    assert bay.charger.operation is Operation.RUNNING


def test_a_resume_of_a_charger_that_does_not_rest_changes_nothing() -> None:
    charger = charging()
    charger.full = True
    charger.rest(1)
    assert charger.operation is Operation.STOPPED


def test_commanded_standby_delivers_nothing() -> None:
    bay = a_bay(charging())
    bay.advance(1)
    bay.charger.push(Push.CHARGE_MODE, ChargeMode.FULL)
    bay.advance(0.1)
    assert (bay.charger.operation, bay.charger.current_a) == (Operation.STOPPED, 0)


def test_reversed_and_halted_chargers_say_so_and_deliver_nothing() -> None:
    bay = a_bay(charging())
    bay.charger.reversed = True
    bay.advance(1)
    assert (bay.charger.charge_mode, bay.charger.connection) == (ChargeMode.REVERSED, Connection.REVERSED)
    assert bay.charger.current_a == 0
    bay = a_bay(charging())
    bay.charger.halted = ChargeMode.ERROR_STOP
    bay.advance(1)
    assert (bay.charger.charge_mode, bay.charger.operation) == (ChargeMode.ERROR_STOP, Operation.STOPPED)


def test_without_a_battery_it_searches() -> None:
    bay = a_bay(charging())
    bay.connected = False
    bay.advance(1)
    assert (bay.charger.charge_mode, bay.charger.voltage_v) == (ChargeMode.BATTERY_SEARCH, 0)
    assert bay.charger.current_a == bay.pack.current_a == 0


def test_automatic_wakes_charges_ends_and_begins_again() -> None:
    pack = Pack(capacity_ah=0.5, deep_ah=0.01)
    pack.set_soc(-100)
    bay = SimulatedBay(SimulatedCharger(ControlMode.AUTOMATIC), pack)
    modes = [bay.charger.charge_mode]
    for _ in range(6000):
        bay.advance(0.1)
        if bay.charger.charge_mode is not modes[-1]:
            modes.append(bay.charger.charge_mode)
    assert modes == [
        ChargeMode.BATTERY_SEARCH,
        ChargeMode.BATTERY_RECOVERY,
        ChargeMode.PRECHARGE,
        ChargeMode.CHARGE,
        ChargeMode.FULL,
    ]
    pack.set_soc(60)
    bay.advance(0.1)
    assert bay.charger.mode is ChargeMode.BATTERY_SEARCH
    bay.charger.rest(0)
    bay.advance(5)
    assert (bay.charger.charge_mode, bay.charger.current_a) == (ChargeMode.FULL, 0)
    bay.charger.rest(1)
    bay.advance(5)
    assert int(bay.charger.mode) == ChargeMode.CHARGE
    bay.connected = False
    bay.advance(1)
    assert int(bay.charger.mode) == ChargeMode.BATTERY_SEARCH


def test_a_charger_that_ignores_stop_goes_on() -> None:
    bay = a_bay(charging())
    bay.charger.ignores_stop = True
    bay.charger.rest(0)
    bay.charger.push(Push.OPERATION, 0)
    bay.advance(1)
    assert (bay.charger.operation, bay.charger.current_a) == (Operation.RUNNING, 8.0)


def test_a_rogue_starts_by_itself_once_and_obeys_a_stop() -> None:
    bay = a_bay(charging())
    bay.charger.rogue = True
    bay.advance(5)
    bay.charger.rest(0)
    bay.advance(ROGUE_AFTER_S + 0.2)
    assert (bay.charger.operation, bay.charger.charge_mode) == (Operation.RUNNING, ChargeMode.CHARGE)
    bay.charger.rest(0)
    bay.charger.push(Push.OPERATION, 0)
    bay.advance(60)
    assert bay.charger.operation is Operation.STOPPED


def test_a_deaf_charger_keeps_its_value() -> None:
    charger = charging(2)
    charger.deaf_to.add(Push.CURRENT_LIMIT)
    charger.push(Push.CURRENT_LIMIT, 4)
    assert charger.current_step == 2
