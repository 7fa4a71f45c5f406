"""Unknown means no: a missing, old, non-numeric or undocumented value never lets a charge begin, and stops one."""

from dataclasses import replace
from math import inf, nan

import pytest

from orchestrator.core.states import ENERGISED
from orchestrator.model import STOP, BatteryReading, Measurement, Request, Snapshot, State
from tests.core.bays import charging, idle, qualifying
from tests.core.said import cause, reason_of
from tests.core.world import TICK_S, World

NEEDED = ("voltage_v", "current_a", "status", "temperature_c", "soc_pct", "soh_pct")
FAST = NEEDED[:4]
every_value = pytest.mark.parametrize("name", NEEDED)


class Skewed(World):
    """A world in which single measurements were taken at another time than now."""

    def __init__(self, name: str, late_s: float) -> None:
        super().__init__()
        self.name, self.late_s = name, late_s

    def snapshot(self, request: Request | None, internal: str) -> Snapshot:
        snapshot = super().snapshot(request, internal)
        values = {**self.measured, self.name: replace(self.measured[self.name], t_s=self.now_s - self.late_s)}
        return replace(snapshot, battery=BatteryReading(**values))


def tells(world: World, name: str, unknown: float | None) -> None:
    """The BMU reports this instead of the truth."""
    if name == "current_a" and unknown is not None:
        world.pack_amps = unknown
    else:
        world.values[name] = unknown


def never_starts(world: World, seconds: float = 40) -> None:
    world.run(seconds)
    assert not ENERGISED & {decision.state for decision in world.decisions}
    assert {decision.command for decision in world.decisions} <= {None, STOP}


@every_value
@pytest.mark.parametrize("unknown", [None, nan, inf, -inf])
def test_without_it_no_charge_begins(name: str, unknown: float | None) -> None:
    world = World()
    tells(world, name, unknown)
    never_starts(world)


@every_value
def test_with_an_old_one_no_charge_begins(name: str) -> None:
    limit_s = 1.5 if name in FAST else 3.0
    never_starts(Skewed(name, limit_s + 0.001))
    world = Skewed(name, limit_s - 0.001)
    world.until(State.CHARGING, 10)


@every_value
def test_with_one_from_the_future_no_charge_begins(name: str) -> None:
    never_starts(Skewed(name, -1.51))


@every_value
@pytest.mark.parametrize("unknown", [None, nan, inf])
def test_without_it_a_charge_is_stopped(name: str, unknown: float | None) -> None:
    world = charging()
    tells(world, name, unknown)
    assert world.tick().command == STOP
    assert world.state is State.STOPPING


CHARGER_UNKNOWN = [
    ("voltage_v", nan),
    ("voltage_v", inf),
    ("current_a", nan),
    ("current_a", inf),
    ("control_mode", None),
    ("operation", None),
    ("current_step", None),
    ("charge_mode", None),
    ("precharge", None),
    ("connection", None),
]


@pytest.mark.parametrize(("name", "unknown"), CHARGER_UNKNOWN)
def test_with_such_a_status_no_charge_begins(name: str, unknown: float | None) -> None:
    world = World()
    world.shows[name] = unknown
    if unknown is None:
        world.shows["illegal"] = (f"{name} 77",)  # as the decoder reports it
    never_starts(world)


@pytest.mark.parametrize(("name", "unknown"), CHARGER_UNKNOWN)
def test_with_such_a_status_a_charge_is_stopped(name: str, unknown: float | None) -> None:
    world = charging()
    world.shows[name] = unknown
    if unknown is None:
        world.shows["illegal"] = (f"{name} 77",)
    world.run(2)
    assert State.STOPPING in world.states()
    assert world.is_in(State.STOPPING, State.SUSPENDED)


def test_an_old_or_a_future_status_starts_nothing() -> None:
    for late_s in (1.51, -1.51):
        world = World()
        for _ in range(160):
            world.shows["t_s"] = world.now_s + TICK_S - late_s
            world.tick()
        assert not ENERGISED & {decision.state for decision in world.decisions}


@every_value
def test_one_sample_is_not_enough(name: str) -> None:
    """It takes a second reading, requested after the first was there."""
    world = idle()
    world.values["soc_pct"] = 50.0
    world.until(State.QUALIFYING)
    world.tick()
    world.frozen.add(name)
    world.run(30)
    assert not ENERGISED & {decision.state for decision in world.decisions}
    world.frozen.clear()
    world.until(State.CHARGING, 10)


def test_a_start_takes_two_seconds_of_everything() -> None:
    world = qualifying()
    world.run(1)
    world.values["soh_pct"] = None
    world.tick()
    assert reason_of(world.decision) == "waiting for fresh values: SOH"
    world.values["soh_pct"] = 100.0
    world.run(2)
    assert world.is_in(State.QUALIFYING)
    world.tick()
    assert world.is_in(State.CHARGING)


def test_what_is_waited_for_is_named() -> None:
    world = qualifying()
    world.port_hangs = True
    reasons = {reason_of(world.tick()) for _ in range(5)}
    assert reasons == {"checking charger and battery before a charge"}


@pytest.mark.parametrize("unknown", [None, nan])
def test_the_soc_is_waited_for(unknown: float | None) -> None:
    world = World()
    world.values["soc_pct"] = unknown
    world.run(5)
    assert world.is_in(State.IDLE)
    assert reason_of(world.decision) == "a battery is there; its SOC is not known yet"


# --- a BMU that has just booted ---------------------------------------------------------------------------------------


def arrival(world: World, **said: float) -> None:
    """For 0.75 s after its boot the BMU reports what its memory held; then what it measures."""
    true = {name: world.values[name] for name in said}
    world.boot()
    world.values.update(said)
    world.run(0.75)
    world.values.update(true)
    world.tick()


@pytest.mark.parametrize("said", [0.0, -40.0, 99.0])
def test_what_a_bmu_says_right_after_its_boot_is_nothing(said: float) -> None:
    """0 °C, then 22 °C half a second later, is not a jump; 99 °C is no fire; 0 V and 0 % are no empty pack."""
    world = idle()
    world.values.update(soc_pct=50.0, temperature_c=22.0, voltage_v=48.0)
    world.volts = 48.0
    arrival(world, temperature_c=said, voltage_v=abs(said), soc_pct=abs(said))
    world.until(State.CHARGING, 10)
    assert all(decision.faults == () for decision in world.decisions)


def test_an_implausible_word_right_after_a_boot_is_no_fault() -> None:
    world = idle()
    world.values.update(soc_pct=50.0)
    world.boot()
    world.battery_link = replace(
        world.battery_link, implausible={"soc_pct": cause("SOC 255 %"), "temperature_c": cause("3276 °C")}
    )
    world.run(2.25)
    assert not world.raised
    world.tick()
    assert {"implausible", "temperature_invalid"} <= set(world.raised)  # it has had its time


def test_nobody_charges_by_what_was_said_before_the_boot() -> None:
    world = qualifying()
    world.run(1.75)
    world.boot()
    world.tick()
    assert world.is_in(State.OFFLINE)
    assert reason_of(world.decision).startswith("48.0 V at the charger, but the BMU (node 0x10) has just booted; ")
    world.run(1)
    assert not ENERGISED & {decision.state for decision in world.decisions}
    world.until(State.CHARGING, 10)


def test_measurements_are_compared_within_one_battery_only() -> None:
    """A cold battery leaves, a warm one comes: no jump, no runaway."""
    world = World(temperature_c=6.0, soc_pct=99.0)
    world.run(200, dt_s=1.0)
    world.leave()
    world.run(3)
    world.arrive(temperature_c=26.0, soc_pct=50.0)
    world.until(State.CHARGING, 20)
    world.run(200, dt_s=1.0)
    assert all(decision.faults == () for decision in world.decisions)


def test_a_value_of_this_very_moment_is_fresh() -> None:
    """A TPDO may arrive while the decision is being made."""
    world = Skewed("temperature_c", -0.001)
    world.until(State.CHARGING, 10)
    assert world.measured["temperature_c"] == Measurement(20.0, world.now_s)
