"""The fit behind each interval of health, and the capacity and the resistance that are made with it."""

import math
from statistics import mean, stdev

import pytest

from orchestrator.record.capacity import LEAST, Aged, balance, capacity
from orchestrator.record.change import Change
from orchestrator.record.fit import Fit, Row, fitted, half_width, inverted, t95, within
from orchestrator.record.resistance import LEAST as LEAST_STEPS
from orchestrator.record.resistance import Steps, resistance, usable
from orchestrator.record.stretch import Stretch


@pytest.mark.parametrize(
    ("dof", "expected"), [(1, 12.706), (2, 4.303), (7, 2.365), (12, 2.179), (40, 2.021), (1e9, 1.960)]
)
def test_the_quantiles_are_those_of_students_t(dof: float, expected: float) -> None:
    assert t95(dof) == pytest.approx(expected, abs=0.01)


def test_without_slopes_it_is_the_mean_and_its_standard_error() -> None:
    values = [1.0, 2.0, 4.0, 8.0]
    fit = fitted([Row(value, 5.0, ()) for value in values], (), 0.0)
    assert fit is not None
    assert fit.value == pytest.approx(mean(values))
    assert fit.uncertainty == pytest.approx(stdev(values) / 2)
    assert fit.dof == pytest.approx(3)


def test_a_row_counts_by_its_expected_uncertainty() -> None:
    fit = fitted([Row(1.0, 0.1, ()), Row(2.0, 0.2, ()), Row(2.0, 0.2, ())], (), 0.0)
    assert fit is not None
    assert fit.value == pytest.approx((4 * 1 + 2 + 2) / 6)


def test_a_slope_is_believed_as_far_as_the_rows_show_it() -> None:
    few = [Row(3.0 - 2.0 * x, 0.5, (float(x),)) for x in (-2, -1, 0)]
    many = [Row(3.0 - 2.0 * x + 0.1 * (-1) ** x, 0.5, (float(x),)) for x in range(-20, 1)]
    found = fitted(many, ((0.0, 0.5),), 0.0)
    assert found is not None
    assert found.value == pytest.approx(3.0, abs=0.1)
    assert fitted(few[:2], ((0.0, 1e3),), 0.0) is None  # two rows cannot tell a value, a slope and a scatter
    stiff = fitted(few, ((0.0, 1e-6),), 0.0)
    assert stiff is not None
    assert stiff.value == pytest.approx(5.0)  # their mean: no slope is believed


def test_what_is_not_seen_in_the_scatter_widens_the_interval() -> None:
    fit = Fit(0.0, 0.01, 4.0)
    assert half_width(fit, 0.0) == pytest.approx(t95(4.0) * 0.01)
    assert half_width(fit, 1.0) == pytest.approx(1.96, rel=0.001)
    assert within(0.0196) == pytest.approx(0.01)
    assert within(0.0196, 0.0196) == pytest.approx(0.01 * 2**0.5)


def test_an_inverse_is_one() -> None:
    matrix = [[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 2.0]]
    inverse = inverted(matrix)
    product = [[sum(a * inverse[k][j] for k, a in enumerate(row)) for j in range(3)] for row in matrix]
    assert [value for row in product for value in row] == pytest.approx([1, 0, 0, 0, 1, 0, 0, 0, 1])


# --- capacity and resistance ------------------------------------------------------------------------------------------


def stretches(count: int, ah_each: float = 0.2, fade: float = 0.0, bmu: float = 1.0) -> list[Aged]:
    """Of a battery of 20 Ah today, a week apart, each a little off."""
    found = []
    for number in range(count):
        years = number / 52
        ah = 60 * ah_each * (1 + fade * years) * (1.004 if number % 2 else 0.996)
        found.append(Aged(Stretch(20.0, 80.0, ah, ah * bmu, 20.0, 25.0), years))
    return found


def test_the_capacity_is_that_of_today() -> None:
    found = capacity(stretches(52, fade=0.2))
    assert found is not None
    assert found.low < 20.0 < found.high
    assert found.value == pytest.approx(20.0, rel=0.01)
    assert found.charges == 52


def test_an_interval_is_wider_with_fewer_charges_and_with_witnesses_that_part() -> None:
    few, many, apart = capacity(stretches(4)), capacity(stretches(40)), capacity(stretches(40, bmu=0.92))
    assert few is not None
    assert many is not None
    assert apart is not None
    assert few.high - few.low > many.high - many.low
    assert many.high - many.low > 0.02 * many.value  # what no scatter shows
    assert apart.low < 20.0 * 0.92
    assert apart.high > 20.0
    assert balance([one.stretch for one in stretches(9, bmu=0.92)]) == pytest.approx(0.92)
    assert balance([one.stretch for one in stretches(9, bmu=0.0)]) is None


def test_without_the_bmus_current_the_charger_alone_tells() -> None:
    found, both = capacity(stretches(40, bmu=0.0)), capacity(stretches(40))
    assert found is not None
    assert both is not None
    assert found.value == pytest.approx(20.0, rel=0.01)
    assert found.high - found.low > both.high - both.low


def test_too_few_charges_tell_nothing() -> None:
    assert capacity(stretches(LEAST - 1)) is None
    assert resistance([steps(25.0)] * (LEAST_STEPS - 1)) is None


def steps(celsius: float, ohm: float = 0.05, years: float = 0.0) -> Steps:
    warm = 1 / (celsius + 273.15) - 1 / 298.15
    rise_v = 14 * ohm * math.exp(3200 * warm)
    return Steps((Change(0.0, 14.0, rise_v, 50.0, celsius), Change(14.0, 0.0, -rise_v, 70.0, celsius)), years)


@pytest.mark.parametrize(("soc_pct", "celsius", "counts"), [
    (20.0, 5.0, True), (90.0, 45.0, True), (19.0, 20.0, False), (91.0, 20.0, False), (50.0, 4.9, False),
    (50.0, 45.1, False),
])  # fmt: skip
def test_nearly_empty_nearly_full_frost_and_heat_tell_no_resistance(
    soc_pct: float, celsius: float, counts: bool
) -> None:
    change = Change(0.0, 14.0, 0.7, soc_pct, celsius)
    assert usable([change]) == ((change,) if counts else ())


def test_a_resistance_is_brought_to_25_degrees() -> None:
    found = resistance([steps(celsius) for celsius in range(10, 40)])
    assert found is not None
    assert found.mohm.value == pytest.approx(50.0, rel=0.005)
    assert (found.changes, found.lowest_c, found.highest_c) == (60, 10, 39)


def test_a_battery_that_was_only_cold_has_a_wide_interval() -> None:
    cold, warm = resistance([steps(8.0)] * 9), resistance([steps(25.0)] * 9)
    assert cold is not None
    assert warm is not None
    assert cold.mohm.low < 50.0 < cold.mohm.high
    assert cold.mohm.high - cold.mohm.low > 3 * (warm.mohm.high - warm.mohm.low)
