"""Battery health: the intervals of few simulated lives, what tells nothing, and what people and programs read.

`python -m tests.record.health_lives 1000` measures the coverage of the intervals.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from statistics import mean, median, stdev
from typing import Any

import pytest

from orchestrator.record import health_shown
from orchestrator.record.capacity import LEAST, Aged, balance, capacity
from orchestrator.record.change import Change
from orchestrator.record.fit import Fit, Row, fitted, half_width, inverted, t95, within
from orchestrator.record.health import METHOD, health
from orchestrator.record.resistance import LEAST as LEAST_STEPS
from orchestrator.record.resistance import Steps, resistance
from orchestrator.record.stretch import Stretch
from tests.record.health_lives import BATTERY, END_S, Life, live

#: So many short lives, and how many of their intervals hold the true value at least: fewer by chance once in 300 times.
LIVES, CHARGES, LEAST_INSIDE = 40, 12, 0.84


def test_the_true_values_are_in_the_intervals_of_most_lives() -> None:
    lives = [live(seed, CHARGES) for seed in range(LIVES)]
    for verdicts, least_width in ([one[2] for one in lives], 0.01), ([one[3] for one in lives], 0.02):
        said = [one for one in verdicts if one.estimate is not None]
        assert len(said) > LIVES / 2
        assert sum(one.inside for one in said) >= LEAST_INSIDE * len(said)
        assert least_width < median(one.width for one in said) < 0.05


# --- the fit ----------------------------------------------------------------------------------------------------------


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
    rise_v = 14 * ohm * 2.718281828 ** (3200 * warm)
    return Steps((Change(0.0, 14.0, rise_v, 50.0, celsius), Change(14.0, 0.0, -rise_v, 70.0, celsius)), years)


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


# --- from the records -------------------------------------------------------------------------------------------------


def records(seed: int = 8, count: int = 12) -> list[dict[str, Any]]:
    """Charges of a simulated battery, as JSON has them."""
    life = Life(seed)
    life.count, life.hall_c, life.season_k, life.deepest_pct = count, 25.0, 0.0, 10.0
    return [json.loads(json.dumps(record)) for record in life.charges()]


def changed(charges: list[dict[str, Any]], name: str, value: object) -> Iterator[dict[str, Any]]:
    return ({**record, name: value} for record in charges)


def test_figures_change_only_with_the_version_of_the_method() -> None:
    found = health(BATTERY, records())
    assert found.capacity is not None
    assert found.resistance is not None
    pinned = {1: (39.5519, 47.5444)}
    now = (round(found.capacity.value, 4), round(found.resistance.mohm.value, 4))
    assert now == pinned[found.method], "another method: give METHOD the next number, and pin its figures here"


def test_the_order_of_records_and_what_is_no_record_change_nothing() -> None:
    charges = records()
    found = health(BATTERY, charges)
    odd: list[Any] = [
        {}, {"type": "end"}, {**charges[0], "policy": None}, {**charges[1], "measured": {"stretch": 3}},
        {**charges[2], "faults": [{"id": "x"}]}, {**charges[3], "end": None}, {**charges[4], "rules": [{"id": None}]},
        {**charges[5], "type": "checkpoint"}, {**charges[6], "battery": {**charges[6]["battery"], "id": "B-0043"}},
    ]  # fmt: skip
    assert health(BATTERY, [*odd, *reversed(charges)]) == found
    assert found.charges == len(charges)


def test_a_charge_that_tells_no_capacity_is_left_out() -> None:
    charges = records()
    usable = health(BATTERY, charges).usable[0]
    assert usable > 6
    for name, value in (("highest_c", 35.1), ("lowest_c", 14.9), ("to_pct", 31.0), ("bmu_ah", 0.5)):
        told = next(one for one in charges if one["measured"]["stretch"] and one["measured"]["stretch"]["from_pct"] > 2)
        bad = {**told["measured"], "stretch": {**told["measured"]["stretch"], name: value}}
        rest = [one for one in charges if one is not told]
        assert health(BATTERY, [*rest, {**told, "measured": bad}]).usable[0] < usable, name
    doubted = list(changed(charges, "faults", [{"id": "soc_jump", "effect": "WARN", "times": 2, "cause": {}}]))
    found = health(BATTERY, doubted)
    assert (found.capacity, found.usable[0]) == (None, 0)
    assert found.faults == (("soc_jump", "WARN", 2 * len(charges)),)
    assert found.resistance is not None


def test_records_of_an_earlier_version_have_no_figures() -> None:
    old = [{name: value for name, value in one.items() if name != "measured"} for one in records()]
    found = health(BATTERY, old)
    assert (found.charges, found.capacity, found.resistance, found.balance) == (len(old), None, None, None)
    assert any("there are 0" in line for line in health_shown.health_lines(found, "en"))


def test_only_the_last_year_counts() -> None:
    charges = records()
    for one in charges[:-2]:
        one["end"]["unix_s"] = END_S - 367 * 86_400
    found = health(BATTERY, charges)
    assert found.charges == len(charges)
    assert max(found.usable) <= 2
    assert found.capacity is None


def test_a_bmu_that_parts_from_its_charges_is_warned_of() -> None:
    found = health(BATTERY, records())
    own = found.soh_pct
    assert own is not None
    for soh_pct, parts in ((own.value, False), (own.high + 0.9, False), (own.high + 1.1, True), (own.low - 1.1, True)):
        told = replace(found, bmu_soh_pct=soh_pct)
        assert told.parts is parts
        assert (health_shown.warning(told) is not None) is parts
        assert health_shown.as_fields(told)["parts"] is parts
    assert not replace(found, bmu_soh_pct=None).parts
    assert not replace(found, rated_ah=None).parts


def test_the_weakest_source_of_its_identity_is_said() -> None:
    charges = records()
    assert health(BATTERY, charges).source == "typed"
    charges[3]["battery"]["source"] = "assumed"
    found = health(BATTERY, charges)
    assert found.source == "assumed"
    assert any("other batteries may have been there" in line for line in health_shown.health_lines(found, "en"))


def test_precharges_and_the_voltage_at_rest_are_counted() -> None:
    charges = records()
    charges[0]["rules"] = [{"id": "precharging_pulse", "key": "precharge.pulse", "place": "p:1", "s": 9.0, "ah": 0.1}]
    begins = {"pack_v": 47.5, "pack_a": 0.02, "soc_pct": 30.0}
    charges[5]["values"] |= {
        name: dict.fromkeys(("begin", "end", "lowest", "highest"), one) for name, one in begins.items()
    }
    found = health(BATTERY, charges)
    assert found.deep_discharges == 1
    assert found.rest is not None
    assert (found.rest.pack_v, found.rest.soc_pct) == (47.5, 30.0)
    charges[5]["values"]["pack_a"]["begin"] = 2.0
    assert health(BATTERY, charges).rest is None


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("en", ["battery B-0042, typed by an operator", "capacity: ", "of the rated 40 Ah", "SOH by its BMU: ",
                "mΩ at 25 °C", "coulombic balance: ", "deep discharges: 0 of 12", "faults in its charges: none"]),
        ("ko", ["배터리 B-0042", "용량: ", "정격 40 Ah의", "BMU 기준 SOH: ", "25 °C에서", "전하량 비교: ",
                "과방전: 충전 12회 중 0회", "장애: 없음"]),
    ],
)  # fmt: skip
def test_people_read_each_figure(language: str, words: list[str]) -> None:
    lines = health_shown.health_lines(health(BATTERY, records()), language)
    for word in words:
        assert [line for line in lines if word in line], (word, lines)


def test_nothing_on_record_is_said() -> None:
    found = health(BATTERY, [])
    assert health_shown.health_lines(found, "en") == ["battery B-0042: no charge of it on record has ended"]
    assert json.loads(json.dumps(health_shown.as_fields(found)))["capacity_ah"] is None


def test_programs_read_the_interval_and_the_method() -> None:
    found = health(BATTERY, records())
    fields = json.loads(json.dumps(health_shown.as_fields(found)))
    assert fields["method"] == METHOD
    assert fields["capacity_ah"]["low"] < fields["capacity_ah"]["value"] < fields["capacity_ah"]["high"]
    assert fields["resistance_mohm"]["charges"] == 12
    assert fields["battery"] == {"id": BATTERY, "source": "typed"}
