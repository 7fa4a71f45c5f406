"""What a charge shows of its battery: stretches of rising SOC, changes of the current, and the record of both."""

from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.config.load import load_policy
from orchestrator.model import BatteryReading, Cause, Decision, Measurement, Request, Snapshot, State
from orchestrator.record import change as changing
from orchestrator.record import measured as measuring
from orchestrator.record import stretch as stretching
from orchestrator.record.change import MOST, Changes
from orchestrator.record.lines import restored
from orchestrator.record.look import Look
from orchestrator.record.measured import Measured
from orchestrator.record.stamp import Stamp
from orchestrator.record.stretch import Point, Stretch, Stretches
from orchestrator.sim.pack import Pack
from tests.record.aged_battery import Life
from tests.record.health_lives import charges_of
from tests.record.kept import Kept


def at(
    t_s: float, soc_pct: float | None = 50.0, ah: float = 0.0, amps: float | None = 14.0, volts: float = 50.0
) -> Point:
    return Point(t_s, soc_pct, volts, amps, 20.0, ah, ah)


def stretch(*moments: tuple[float | None, float]) -> Stretch | None:
    """After these values of the SOC and the Ah at each."""
    known = Stretches()
    for t_s, (soc_pct, ah) in enumerate(moments):
        known = stretching.follow(known, at(float(t_s), soc_pct, ah))
    return known.best


def test_a_stretch_runs_from_one_rise_to_another() -> None:
    found = stretch((20, 0.0), (20, 0.1), (21, 0.2), (21, 0.3), (22, 0.4), (21, 0.5), (22, 0.55), (23, 0.6), (23, 0.7))
    assert found is not None
    assert (found.from_pct, found.to_pct, found.lowest_c, found.highest_c) == (21, 23, 20.0, 20.0)
    assert [found.charger_ah, found.bmu_ah] == pytest.approx([0.4, 0.4])
    assert stretch((20, 0.0), (21, 0.2)) is None


@pytest.mark.parametrize(
    "between",
    [(30.0, 2.0), (15.0, 2.0), (None, 2.0)],
    ids=["it jumps", "it falls", "nobody hears it"],
)
def test_the_longest_stretch_between_jumps_counts(between: tuple[float | None, float]) -> None:
    before = [(float(pct), pct / 10) for pct in range(20, 25)]
    after = [(float(pct), pct / 10 + 9) for pct in range(31, 41)]
    found = stretch(*before, between, *after)
    assert found is not None
    assert (found.from_pct, found.to_pct) == (31 if between[0] == 30 else 32, 40)
    found = stretch(*after, between, *before)
    assert found is not None
    assert (found.from_pct, found.to_pct) == (32, 40)


def test_a_soc_that_has_fallen_does_not_go_on_from_where_it_was() -> None:
    found = stretch(*((pct, pct / 10) for pct in (20.0, 21.0, 22.0, 23.0, 21.0, 22.0, 23.0, 24.0, 25.0)))
    assert found is not None
    assert (found.from_pct, found.to_pct) == (22, 25)


def test_what_a_bmu_says_at_the_top_does_not_count() -> None:
    found = stretch((97, 0.0), (98, 0.2), (99, 0.4), (100, 5.0))
    assert found is not None
    assert found.to_pct == 99
    assert found.charger_ah == pytest.approx(0.2)


def test_its_temperatures_are_those_of_the_stretch() -> None:
    known = Stretches()
    for number, celsius in enumerate((10.0, 18.0, 22.0, 16.0, 20.0, 30.0)):
        known = stretching.follow(known, replace(at(number, 20.0 + number), temperature_c=celsius))
    assert known.best is not None
    assert (known.best.lowest_c, known.best.highest_c) == (16.0, 30.0)


def changes(*readings: tuple[float, float, float]) -> Changes:
    """After readings of (time, amperes, volts)."""
    known = Changes()
    for t_s, amps, volts in readings:
        known = changing.follow(known, at(t_s, amps=amps, volts=volts))
    return known


def test_a_change_is_between_two_steady_currents() -> None:
    found = changes((0, 0, 50), (0.5, 0, 50), (1, 5, 50.2), (1.5, 14, 50.7), (2, 14, 50.71), (2.5, 14, 50.72)).all
    assert [(one.before_a, one.after_a, round(one.rise_v, 3)) for one in found] == [(0, 14, 0.71)]
    assert found[0].rise_a == 14


@pytest.mark.parametrize(
    "readings",
    [
        [(0, 0, 50), (0.5, 0, 50), (1, 1, 50.1), (1.5, 1, 50.1)],
        [(0.5 * n, 14 - 0.1 * n, 50) for n in range(60)],
        [(0, 0, 50), (0.5, 0, 50), (7, 14, 51), (7.5, 14, 51)],
        [(0, 0, 50), (0.5, 0, 50), *((1 + 0.5 * n, n, 50) for n in range(14)), (8, 14, 51), (8.5, 14, 51)],
        [(0, 0, 50), (0.5, 0, 50), (1, 14, 50.7), (1, 14, 50.7)],
        [(0, 0, 50), (0.5, 0, 50), (3.5, 14, 50.7), (4, 14, 50.7)],
    ],
    ids=["small", "slow", "a gap", "too long on its way", "one reading twice", "not seen meanwhile"],
)
def test_what_is_no_change(readings: list[tuple[float, float, float]]) -> None:
    assert changes(*readings).all == ()


def test_of_many_changes_the_largest_stay() -> None:
    readings = []
    for number in range(MOST + 10):
        amps = 14.0 if number % 2 else 2.0 + number / 10
        readings += [(2 * number + part, amps, 50.0) for part in (0.0, 0.5, 1.0)]
    found = changes(*readings).all
    assert len(found) == MOST
    assert min(abs(one.rise_a) for one in found) == 10.0  # the smallest ten were 9.0 … 9.8


def test_a_reading_is_as_old_as_it_is() -> None:
    fresh, old = Measurement(50.0, 99.5), Measurement(20.0, 90.0)
    reading = BatteryReading(voltage_v=fresh, current_a=fresh, temperature_c=old)
    decision = Decision(State.CHARGING, Cause("x"))
    look = Look(Stamp(1.8e9, 0, 100.0, "boot"), Snapshot(battery=reading), decision, lambda cause: cause)
    assert measuring.seen(look, 1.0, 2.0) == Point(99.5, None, 50.0, 50.0, None, 1.0, 2.0)


def test_time_at_high_voltage_and_temperature_is_counted_up_to_a_gap() -> None:
    measured = Measured()
    for t_s in (0.0, 1.0, 2.0, 1000.0):
        measured = measuring.follow(measured, t_s, replace(at(t_s, volts=53.0), temperature_c=41.0), 54.6)
    assert (measured.high_s, measured.hot_s) == (12.0, 12.0)
    measured = measuring.follow(Measured(t_s=0.0), 5.0, at(5.0, volts=52.9), 54.6)
    assert (measured.high_s, measured.hot_s) == (0.0, 0.0)


class Charging:
    """A charge of the bench with a pack that has a capacity and a resistance, as a small BMU shows it."""

    def __init__(self, directory: Path) -> None:
        self.kept = Kept(directory)
        self.pack = Pack(capacity_ah=0.6, resistance_ohm=0.05, heat_j_per_k=1e6)
        self.pack.set_soc(24.6)

    def step(self) -> State:
        bench, pack = self.kept.bench, self.pack
        pack.advance(0.2, bench.charger.reading.current_a)
        volts = round(pack.voltage_v, 2)
        bench.battery.values |= {"voltage_v": volts, "soc_pct": float(round(100 * pack.soc)), "temperature_c": 20.0}
        bench.charger.reading = replace(bench.charger.reading, voltage_v=volts)
        return bench.step()

    def until(self, soc_pct: float) -> None:
        while 100 * self.pack.soc < soc_pct:
            self.step()


def test_the_service_records_what_a_charge_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    charging = Charging(tmp_path)
    monkeypatch.setattr("orchestrator.service.bay.time", charging.kept.wall)
    charging.until(62.0)
    charging.kept.bench.ask(Request.STOP)
    for _ in range(20):
        charging.step()
    begin, end = charging.kept.records()
    assert begin["measured"] == {"stretch": None, "steps": [], "hot_s": 0.0, "high_s": 0.0}
    found = measuring.from_fields(end)
    assert found.stretch is not None
    assert found.stretch.from_pct in (25, 26)
    assert found.stretch.to_pct in (61, 62)
    ah = 0.6 * found.stretch.rise_pct / 100
    assert found.stretch.charger_ah == pytest.approx(ah, rel=0.02)
    assert found.stretch.bmu_ah == pytest.approx(ah, rel=0.02)
    assert [round(one.rise_a) for one in found.steps][:: len(found.steps) - 1] == [14, -14]
    assert [one.rise_v / one.rise_a for one in found.steps] == pytest.approx([0.05] * len(found.steps), rel=0.12)
    assert end["policy"]["capacity_ah"] == load_policy("li-ion-48v").pack.capacity_ah
    assert end["policy"]["end_v"] == pytest.approx(54.6)
    # what the simulated lives are made of has the same form
    (other,) = (record for number, record in enumerate(charges_of(Life(1))) if number == 0)
    assert other.keys() == end.keys()
    assert other["measured"].keys() == end["measured"].keys()
    assert other["measured"]["stretch"].keys() == end["measured"]["stretch"].keys()
    assert len(other["measured"]["steps"][0]) == len(end["measured"]["steps"][0])
    assert {*other["policy"]} == {*end["policy"]}
    # what is restored from a record is as it was
    assert measuring.as_fields(restored(end, end).measured) == {"measured": end["measured"]}


def test_nothing_is_measured_across_a_restart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    charging = Charging(tmp_path)
    monkeypatch.setattr("orchestrator.service.bay.time", charging.kept.wall)
    charging.until(45.0)
    charging.kept.recorder.turn()
    charging.kept.again(charging.kept.persisted(), 1.0)
    while charging.step() is not State.HELD:
        pass
    charging.kept.bench.ask(Request.START)
    charging.until(58.0)
    charging.kept.bench.ask(Request.STOP)
    for _ in range(20):
        charging.step()
    *_, end = charging.kept.records()
    assert end["type"] == "end"
    assert end["measured"]["stretch"]["from_pct"] >= 45 or end["measured"]["stretch"]["to_pct"] <= 46
    assert end["measured"]["stretch"]["charger_ah"] < 0.6 * 0.22


def test_a_record_of_an_earlier_version_has_nothing_measured_and_goes_on(tmp_path: Path) -> None:
    kept = Kept(tmp_path)
    kept.bench.charging()
    begin = kept.records()[0]
    earlier = {name: value for name, value in begin.items() if name != "measured"}
    assert restored(earlier, earlier).measured == Measured()
    with pytest.raises(ValueError, match="damaged"):
        restored({**begin, "measured": {"stretch": 5}}, {**begin, "measured": {"stretch": 5}})
