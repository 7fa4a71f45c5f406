"""Battery health: the intervals of few simulated lives, what tells nothing, and what people and programs read.

`python -m tests.record.health_lives 1000` measures the coverage of the intervals.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from statistics import median
from typing import Any

import pytest

from orchestrator.model import ChargeMode
from orchestrator.record import health_shown
from orchestrator.record.health import METHOD, health
from orchestrator.record.measured import Measured, follow
from orchestrator.record.met import Trouble
from orchestrator.record.stamp import Stamp
from orchestrator.record.stretch import Point
from orchestrator.record.ulid import CHANCE, after
from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.pack import Pack
from tests.record.health_lives import BATTERY, END_S, live, recorded, records

#: So many short lives, and how many of their intervals hold the true value at least: fewer by chance once in 300 times.
LIVES, CHARGES, LEAST_INSIDE = 40, 12, 0.84


def test_the_true_values_are_in_the_intervals_of_most_lives() -> None:
    lives = [live(seed, CHARGES) for seed in range(LIVES)]
    for verdicts, least_width in ([one[2] for one in lives], 0.01), ([one[3] for one in lives], 0.02):
        said = [one for one in verdicts if one.estimate is not None]
        assert len(said) > LIVES / 2
        assert sum(one.inside for one in said) >= LEAST_INSIDE * len(said)
        assert least_width < median(one.width for one in said) < 0.05


def test_the_emulated_pack_that_has_aged_is_known_by_its_charges() -> None:
    """The same from the emulator's own models of pack and charger, half a second at a time."""
    charges, id_ = [], ""
    for number, celsius in enumerate((16.0, 21.0, 24.0, 28.0, 19.0)):
        pack = Pack(
            capacity_ah=8.0, resistance_ohm=0.06, arrhenius_k=2200.0, polarisation_ohm=0.01,
            soh_pct=80.0 + 0.2 * (4 - number), temperature_c=celsius, ambient_c=celsius,
        )  # fmt: skip
        pack.set_soc(20.0 + 3 * number)
        charger = SimulatedCharger(run=True, mode=ChargeMode.CHARGE, current_step=3)
        measured, t_s, ah = Measured(), 0.0, 0.0
        while charger.running and pack.soc < 0.92:
            on = t_s >= 3.0 and pack.soc < 0.88
            charger.advance(0.5, pack)
            amps = charger.current_a if on else 0.0
            pack.advance(0.5, amps)
            t_s, ah = t_s + 0.5, ah + amps * 0.5 / 3600
            told = pack.readout()
            volts, celsius = round(told.voltage_v, 2), round(told.temperature_c, 1)
            point = Point(t_s, float(round(told.soc_pct)), volts, round(amps, 2), celsius, ah, ah)
            measured = follow(measured, t_s, point, 54.6)
            if not on and t_s > 10.0:
                break
        id_ = after(id_, END_S + 86_400.0 * number, bytes(CHANCE))
        end = Stamp(END_S + 86_400.0 * number, 0, 1e6, "boot")
        charges.append(recorded(id_, end, t_s, measured, Trouble(), (8.0, 54.6, 100.0)))
    found = health(BATTERY, charges)
    assert found.capacity is not None
    assert found.resistance is not None
    assert found.capacity.low < 6.4 < found.capacity.high
    assert found.resistance.mohm.low < 60.0 < found.resistance.mohm.high
    assert found.parts


# --- from the records -------------------------------------------------------------------------------------------------


def changed(charges: list[dict[str, Any]], name: str, value: object) -> Iterator[dict[str, Any]]:
    return ({**record, name: value} for record in charges)


def test_figures_change_only_with_the_version_of_the_method() -> None:
    found = health(BATTERY, records())
    assert found.capacity is not None
    assert found.resistance is not None
    pinned = {1: (39.5519, 40.6103, 47.5444, 49.3076)}
    both = found.capacity, found.resistance.mohm
    now = tuple(round(figure, 4) for one in both for figure in (one.value, one.high))
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
    for soh_pct, parts in (
        (own.value, False),
        (own.high + 0.9, False),
        (own.high + 1.1, True),
        (own.low - 0.9, False),
        (own.low - 1.1, True),
    ):
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
        ("en", ["health by method 1; charges: 12", "capacity: ", "of the rated 40 Ah", "SOH by its BMU: ",
                "mΩ at 25 °C", "coulombic balance: ", "deep discharges: 0 of 12", "faults in its charges: none"]),
        ("ko", ["평가 방식 1; 충전 12회", "용량: ", "정격 40 Ah의", "BMU 기준 SOH: ", "25 °C에서", "전하량 비교: ",
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
    assert fields["soh_pct"]["low"] == pytest.approx(100 * fields["capacity_ah"]["low"] / fields["rated_ah"], abs=0.01)
    assert fields["resistance_mohm"]["charges"] == 12
    assert fields["battery"] == {"id": BATTERY, "source": "typed"}
