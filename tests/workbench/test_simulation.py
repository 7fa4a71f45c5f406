"""A scenario reaches the bay as written: batteries come and go, sensors lie, an operator makes requests."""

from itertools import pairwise

import pytest

from orchestrator.config.load import load_policy, load_scenario
from orchestrator.config.scenario import Ask, Defect, Sensor, SensorFault, Visit, Weather
from orchestrator.config.shipped import shipped_names
from orchestrator.core.states import ENERGISED
from orchestrator.model import Request, State
from orchestrator.workbench.simulate.simulation import Run, UnsuitableError, simulate
from tests.workbench.scenarios import battery, scenario

POLICY = load_policy("li-ion-48v")


def states(run: Run) -> list[State]:
    """The lasting states, without consecutive repeats."""
    lasting = [span.state for span in run.trail.spans if span.to_s - span.from_s > 5]
    return [now for before, now in zip([None, *lasting], lasting, strict=False) if now is not before]


@pytest.mark.parametrize("name", shipped_names("configs/scenarios"))
def test_a_shipped_scenario_is_played_to_its_end_and_charges(name: str) -> None:
    what_happens = load_scenario(name)
    run = simulate(POLICY, what_happens)
    assert run.trail.moments[-1].t_s == run.trail.spans[-1].to_s == what_happens.hours * 3600
    assert states(run)[-1] is State.FULL
    assert run.charged_ah > 20
    limits = what_happens.limits
    for m in run.trail.moments:
        assert m.current_a <= limits.current_a
        assert m.voltage_v is None or m.voltage_v <= limits.voltage_v
        if m.current_a > 0 and m.state in ENERGISED and m.temperature_c is not None:
            assert m.temperature_c in limits.temperature_c


def test_the_moments_are_in_order_and_two_minutes_apart_at_most() -> None:
    times = [m.t_s for m in simulate(POLICY, scenario(1.0)).trail.moments]
    assert all(0 < later - earlier <= 120 for earlier, later in pairwise(times))


def test_the_spans_join_without_a_gap() -> None:
    spans = simulate(POLICY, scenario(1.0)).trail.spans
    assert all(before.to_s == after.from_s for before, after in pairwise(spans))


def test_the_binding_rule_is_named_with_its_line() -> None:
    run = simulate(POLICY, scenario(1.0))
    bound = next(span for span in run.trail.spans if span.step == 2)
    assert bound.why == f"SOC 90 % in 90 … 100 allows 8.0 A, {POLICY.source.at('current.soc_pct.rows[1]')}"


def test_batteries_come_and_go_and_keep_their_charge() -> None:
    visits = (
        Visit(battery="pack-1", from_h=0, to_h=0.1, soc_pct=30),
        Visit(battery="pack-2", from_h=0.2, to_h=0.3, soc_pct=60, temperature_c=30),
        Visit(battery="pack-1", from_h=0.4, used_pct=20),
    )
    run = simulate(POLICY, scenario(0.5, visits=visits, batteries={"pack-1": battery(), "pack-2": battery()}))
    moments = run.trail.moments
    left = [m for m in moments if m.t_s <= 360][-1]
    assert left.soc_pct is not None
    assert left.soc_pct > 40
    empty = [m for m in moments if 360 < m.t_s <= 720]
    assert all(m.soc_pct is None and m.current_a == 0 for m in empty)
    second = next(m for m in moments if m.t_s > 720)
    assert second.soc_pct == pytest.approx(60, abs=0.01)
    assert second.temperature_c == pytest.approx(30, abs=0.01)
    back = next(m for m in moments if m.t_s > 1440)
    assert back.soc_pct == pytest.approx(left.soc_pct - 20, abs=0.01)


def test_the_weather_is_straight_between_its_rows() -> None:
    run = simulate(POLICY, scenario(1.0, weather=(Weather(at_h=0, ambient_c=10), Weather(at_h=0.5, ambient_c=20))))
    for m in run.trail.moments:
        assert m.ambient_c == pytest.approx(min(10 + 20 * m.t_s / 3600, 20))


@pytest.mark.parametrize(
    ("defect", "sensor", "by", "fault"),
    [
        (Defect.SILENT, Sensor.VOLTAGE_V, 0.0, "stale_reading"),
        (Defect.SILENT, Sensor.SOC_PCT, 0.0, "stale_reading"),
        (Defect.OFFSET, Sensor.VOLTAGE_V, -3.0, "volts_disagree"),
        (Defect.OFFSET, Sensor.TEMPERATURE_C, 12.0, "temperature_invalid"),
        (Defect.STUCK, Sensor.CURRENT_A, 0.0, "pairing_not_proved"),
        (Defect.DRIFT, Sensor.TEMPERATURE_C, 90.0, "runaway"),
    ],
)
def test_a_sensor_fault_is_seen(defect: Defect, sensor: Sensor, by: float, fault: str) -> None:
    """A current reading stuck at the start of the charge is 0 A."""
    lie = SensorFault(sensor=sensor, defect=defect, by=by, from_h=0.0003 if defect is Defect.STUCK else 0.1)
    run = simulate(POLICY, scenario(0.3, sensors=(lie,)))
    raised = [span for span in run.trail.spans if fault in span.faults]
    assert raised
    assert raised[0].from_s >= lie.from_h * 3600


def test_an_operator_asks_in_time() -> None:
    asks = (Ask(at_h=0.1, request=Request.PAUSE), Ask(at_h=0.2, request=Request.START))
    run = simulate(POLICY, scenario(0.3, operator=asks))
    assert states(run) == [State.CHARGING, State.SUSPENDED, State.CHARGING]
    paused = next(span for span in run.trail.spans if span.state is State.SUSPENDED)
    assert paused.from_s == pytest.approx(360, abs=2)
    assert paused.to_s == pytest.approx(720, abs=1)


def test_a_policy_for_other_cells_is_refused_with_both_lines() -> None:
    with pytest.raises(UnsuitableError) as caught:
        simulate(load_policy("li-ion-24v"), load_scenario("cold-morning"))
    assert str(caught.value) == (
        "policy li-ion-24v is for 7 cells in series (policies/li-ion-24v.yaml:12), "
        "pack-1 has 13 (configs/scenarios/cold-morning.yaml:34)"
    )


def test_it_says_how_far_it_is() -> None:
    shares: list[float] = []
    simulate(POLICY, scenario(4.0), watch=shares.append)
    assert shares == sorted(shares)
    assert shares
    assert 0 < shares[-1] <= 1
