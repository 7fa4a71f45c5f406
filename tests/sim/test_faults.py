"""Every fault does what its description says, on the lines or in the model, and healing removes it."""

import asyncio
import termios
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fcntl import LOCK_EX, LOCK_NB, flock
from itertools import count
from pathlib import Path

import can
import pytest

from orchestrator.model import BatteryStatus, ChargeMode, Connection, ControlMode, Operation
from orchestrator.sim.bay import SimulatedBay
from orchestrator.sim.can_wire import CanWire
from orchestrator.sim.charger import ROGUE_AFTER_S, Push, SimulatedCharger
from orchestrator.sim.charger_frames import Kind
from orchestrator.sim.faults import FAULTS
from orchestrator.sim.presets import pack_48v
from orchestrator.sim.rig import Rig, Setup
from tests.waiting import wait_until

CHANNELS = count()


@dataclass
class Scene:
    """A rig charging at step 2 (8 A), in a loop that does not run: time is passed in."""

    rig: Rig

    def inject(self, name: str, value: float | None = None) -> None:
        self.rig.inject(lambda rig: FAULTS[name].happen(rig, value))


@pytest.fixture(name="scene")
def _scene(tmp_path: Path) -> Iterator[Scene]:
    charger = SimulatedCharger()
    for what, value in ((Push.CURRENT_LIMIT, 2), (Push.CHARGE_MODE, 4), (Push.OPERATION, 1)):
        charger.push(what, value)
    bay = SimulatedBay(charger, pack_48v())
    bay.advance(2)
    loop = asyncio.new_event_loop()
    bus = can.Bus(interface="virtual", channel=f"faults-{next(CHANNELS)}")
    wire = CanWire(loop, bus)
    rig = Rig(loop, wire, bay, Setup(node_id=0x10, link=tmp_path / "bay-1"))
    yield Scene(rig)
    rig.close()
    wire.close()
    bus.shutdown()
    loop.close()


def after(seconds: float, seen: Callable[[Rig], object]) -> Callable[[Rig], object]:
    def look(rig: Rig) -> object:
        rig.bay.advance(seconds)
        return seen(rig)

    return look


def heating(rig: Rig) -> bool:
    """2 K at once, then 3 K/s, then it stays."""
    first_c = rig.bay.readout().temperature_c
    rig.bay.advance(1)
    second_c = rig.bay.readout().temperature_c
    rig.bay.advance(20)
    return 22 <= first_c < 22.1 and second_c == pytest.approx(first_c + 3) and rig.bay.readout().temperature_c == 48


def gap_v(rig: Rig) -> float:
    return rig.bay.charger.voltage_v - rig.bay.readout().voltage_v


def rogue(rig: Rig) -> bool:
    rig.bay.charger.rest(0)
    rig.bay.advance(ROGUE_AFTER_S + 1)
    return rig.bay.charger.operation is Operation.RUNNING


def ignores_a_limit(rig: Rig) -> bool:
    rig.bay.charger.push(Push.CURRENT_LIMIT, 4)
    return rig.bay.charger.current_step == 0


def ignores_a_stop(rig: Rig) -> bool:
    rig.bay.charger.rest(0)
    rig.bay.charger.push(Push.OPERATION, 0)
    rig.bay.advance(1)
    return rig.bay.charger.current_a == 8.0


def does_not_rise(rig: Rig) -> bool:
    before_v = rig.bay.pack.ocv_v
    rig.bay.advance(60)
    return rig.bay.pack.ocv_v == before_v


def back_at_its_highest(rig: Rig) -> bool:
    rig.bay.charger.push(Push.CURRENT_LIMIT, 0)
    rig.bay.advance(0.3)
    return rig.bay.charger.current_step == 4


def runs_again(rig: Rig) -> bool:
    return all(stopped_for(rig, 4.0) is Operation.RUNNING for _ in range(2))


def obeys_once(rig: Rig) -> bool:
    first = stopped_for(rig, 1.0)
    rig.bay.charger.rest(1)
    rig.bay.charger.push(Push.OPERATION, 1)
    return (first, stopped_for(rig, 1.0)) == (Operation.STOPPED, Operation.RUNNING)


def stopped_for(rig: Rig, seconds: float) -> Operation:
    rig.bay.charger.rest(0)
    rig.bay.advance(seconds)
    return rig.bay.charger.operation


def all_frozen(rig: Rig) -> bool:
    before, volts = rig.bay.readout(), rig.bay.charger.voltage_v
    rig.bay.advance(60)
    return rig.bay.readout() == before and rig.bay.charger.voltage_v > volts


def at_115200(rig: Rig) -> bool:
    with Path(rig.wire.path).open("rb", buffering=0) as port:
        return bool(termios.tcgetattr(port.fileno())[5] == termios.B115200)


def locked(rig: Rig) -> bool:
    with Path(rig.wire.path).open("rb", buffering=0) as port:
        try:
            flock(port, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            return True
    return False


SEEN: dict[str, Callable[[Rig], object]] = {
    "reverse_polarity": lambda rig: (
        rig.bay.charger.connection is Connection.REVERSED and rig.bay.charger.charge_mode is ChargeMode.REVERSED
    ),
    "error_stop": lambda rig: rig.bay.charger.charge_mode is ChargeMode.ERROR_STOP and rig.bay.pack.current_a == 0,
    "system_stop": lambda rig: rig.bay.charger.charge_mode is ChargeMode.SYSTEM_STOP and rig.bay.pack.current_a == 0,
    "charger_silent": lambda rig: rig.wire.mute_tx and not rig.wire.mute_rx,
    "charger_cut_off": lambda rig: rig.wire.mute_tx and rig.wire.mute_rx,
    "charger_error_frames": lambda rig: rig.wire.complains,
    "bmu_silent": lambda rig: rig.bmu.port.faults.mute,
    "sdo_abort": lambda rig: rig.bmu.port.faults.aborts == {0x6004: 0x0602_0000},
    "wrong_size": lambda rig: rig.bmu.port.faults.short == {0x6004},
    "implausible_soc": lambda rig: rig.bay.readout().soc_pct == 140,
    "stale_reading": lambda rig: rig.bmu.port.faults.delay_s == 2.0,
    "temperature_jump": lambda rig: rig.bay.readout().temperature_c > 34,
    "frozen_temperature": after(60, lambda rig: rig.bay.readout().temperature_c < 20.01 < rig.bay.pack.temperature_c),
    "over_temperature": heating,
    "under_temperature": after(20, lambda rig: rig.bay.readout().temperature_c == -5),
    "over_voltage": lambda rig: (
        rig.bay.readout().voltage_v > 58.5
        and rig.bay.charger.voltage_v > 58.5
        and rig.bay.readout().status == 1 << BatteryStatus.OVER_VOLTAGE
    ),
    "over_current": lambda rig: rig.bay.charger.current_a == rig.bay.readout().current_a == 12.0,
    "volts_disagree": lambda rig: 3.0 < gap_v(rig) < 3.5,
    "amps_disagree": lambda rig: rig.bay.readout().current_a == rig.bay.charger.current_a + 3,
    "status_bits": lambda rig: rig.bay.readout().status == 1 << BatteryStatus.BMU_ERROR,
    "emergency": lambda _: True,
    "rogue_run": rogue,
    "command_ignored": ignores_a_limit,
    "precharge_no_rise": does_not_rise,
    "illegal_value": lambda rig: rig.wire.lies == {Kind.CHARGE_MODE: 9},
    "polarity_contradicts": lambda rig: rig.wire.lies == {Kind.CHARGE_MODE: 6} and rig.bay.charger.connection == 1,
    "frozen_charger": after(
        60,
        lambda rig: (
            rig.wire.lies.get(Kind.CURRENT) == 800 and rig.bay.charger.voltage_v > rig.wire.lies[Kind.VOLTAGE] / 100
        ),
    ),
    "soc_jump": lambda rig: rig.bay.readout().soc_pct < 36,
    "battery_exchanged": lambda rig: rig.bmu.port.faults.mute and rig.bay.readout().soc_pct < 26,
    "mode_taken_over": lambda rig: rig.bay.charger.control_mode is ControlMode.AUTOMATIC,
    "battery_removed": lambda rig: rig.bay.charger.voltage_v == 0 and rig.bmu.port.faults.mute,
    "ignore_stop": ignores_a_stop,
    "bmu_reboot": lambda _: True,
    "port_gone": lambda rig: not rig.wire.is_open,
    "line_taken_over": at_115200,
    "port_locked": locked,
    "says_standby": lambda rig: (
        rig.wire.lies == {Kind.OPERATION: 0, Kind.CURRENT: 0} and rig.bay.charger.current_a == 8.0
    ),
    "says_standby_now_and_then": lambda rig: (
        [rig.wire.liars[Kind.CURRENT].is_told() for _ in range(4)] == [False, True, False, True]
        if rig.wire.liars
        else False
    ),
    "limit_reverts": back_at_its_highest,
    "runs_again": runs_again,
    "obeys_once": obeys_once,
    "stopped_elsewhere": lambda rig: rig.bay.charger.charge_mode is ChargeMode.FULL,
    "bmu_frozen": all_frozen,
    "pack_collapsed": lambda rig: rig.bay.readout().voltage_v < 32 and rig.bay.charger.voltage_v < 32,
    "another_pack": lambda rig: 36 < rig.bay.readout().voltage_v < 40,
    "heal": lambda _: True,
}
#: They show in a single frame: test_bmu.py and test_plant.py wait for it.
ON_THE_BUS = {"emergency", "bmu_reboot", "heal"}


def test_every_fault_is_looked_at() -> None:
    assert SEEN.keys() == FAULTS.keys()
    assert all(fault.about for fault in FAULTS.values())


@pytest.mark.parametrize("name", sorted(FAULTS.keys() - ON_THE_BUS))
def test_without_the_fault_nothing_of_it_is_to_be_seen(name: str, scene: Scene) -> None:
    assert not SEEN[name](scene.rig)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_shows_and_can_be_healed(name: str, scene: Scene) -> None:
    rig = scene.rig
    scene.inject(name)
    assert SEEN[name](rig), FAULTS[name].about
    scene.inject("heal")
    rig.bay.advance(60)
    charger, told = rig.bay.charger, rig.bay.readout()
    assert (charger.connection, charger.halted, charger.control_mode) == (1, None, ControlMode.MANUAL)
    assert abs(gap_v(rig)) < 0.1
    assert told.current_a == charger.current_a
    assert (told.status, rig.wire.lies) == (0, {})
    assert told.soc_pct == pytest.approx(50, abs=2)
    assert told.temperature_c == pytest.approx(20, abs=0.5)
    assert not (rig.wire.mute_rx or rig.wire.mute_tx or rig.wire.complains or rig.bmu.port.faults.mute)
    assert rig.wire.is_open
    assert not charger.deaf_to


def test_a_battery_can_live_faster_than_the_clock(tmp_path: Path) -> None:
    loop = asyncio.new_event_loop()
    bus = can.Bus(interface="virtual", channel=f"faults-{next(CHANNELS)}")
    wire = CanWire(loop, bus)
    charger = SimulatedCharger(run=True, mode=ChargeMode.CHARGE, current_step=2)
    rig = Rig(loop, wire, SimulatedBay(charger, pack_48v()), Setup(node_id=0x10, speed=1000.0))

    def soc_pct() -> float:
        rig.catch_up()
        return rig.bay.pack.soc * 100

    began_s = loop.time()
    wait_until(lambda: soc_pct() > 51.0)
    assert loop.time() - began_s < 5.0, "8 A need 90 s for 1 % of 20 Ah"
    rig.close()
    wire.close()
    bus.shutdown()
    loop.close()


STRENGTHS: tuple[tuple[str, float, Callable[[Rig], bool]], ...] = (
    ("over_temperature", 22.0, lambda rig: rig.bay.pack.temperature_c == 22),
    ("over_voltage", 56.0, lambda rig: 56 <= rig.bay.readout().voltage_v < 56.1),
    ("over_current", 1.25, lambda rig: rig.bay.charger.current_a == 10),
    ("implausible_soc", 101.0, lambda rig: rig.bay.readout().soc_pct == 101),
    ("stale_reading", 0.35, lambda rig: rig.bmu.port.faults.delay_s == 0.35),
    ("sdo_abort", 0x0800_0020, lambda rig: rig.bmu.port.faults.aborts == {0x6004: 0x0800_0020}),
    ("status_bits", 0x05, lambda rig: rig.bay.readout().status == 5),
    ("volts_disagree", 0.9, lambda rig: -0.9 < gap_v(rig) < -0.8),
    ("illegal_value", 77.0, lambda rig: rig.wire.lies == {Kind.CHARGE_MODE: 77}),
)


@pytest.mark.parametrize(("name", "value", "seen"), STRENGTHS, ids=[name for name, _, _ in STRENGTHS])
def test_strengths_can_be_chosen(name: str, value: float, seen: Callable[[Rig], bool], scene: Scene) -> None:
    scene.inject(name, value)
    assert seen(scene.rig)
