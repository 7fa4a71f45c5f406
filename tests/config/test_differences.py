"""Which keys differ between two versions of a policy or a bay."""

from dataclasses import replace

import pytest

from orchestrator.config.differences import MOST_SHOWN, differences
from orchestrator.config.load import load_policy
from orchestrator.keys import Range, Source
from tests.service.bench import the_bay


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({}, []),
        ({"finish.target_soc_pct": "99"}, ["finish.target_soc_pct 100 → 99"]),
        ({"about": "x"}, ["about 13S NMC/NCA, 40 Ah, full charge → x"]),
        ({"pack.capacity_ah": "50", "finish.hold_min": "30"}, ["pack.capacity_ah 40 → 50", "finish.hold_min 0 → 30"]),
        ({"current.soc_pct.rows[1].max_a": "5.0"}, ["current.soc_pct.rows[1].max_a 8 → 5"]),
    ],
)
def test_a_key_has_its_values_before_and_after(changes: dict[str, str], found: list[str]) -> None:
    before, after = load_policy("li-ion-48v"), load_policy("li-ion-48v", changes=changes)
    after = replace(after, source=Source("elsewhere"))
    assert [f"{key} {old} → {new}" for key, old, new in differences(before, after)] == found


def test_what_is_only_in_one_of_them_is_shown_as_a_whole() -> None:
    policy = load_policy("li-ion-48v")
    fewer = replace(policy, precharge=None, current=replace(policy.current, where=policy.current.where[:-1]))
    (precharge, row) = differences(policy, fewer)
    assert (precharge.key, precharge.after) == ("precharge", "–")
    assert precharge.before.startswith("{below_v: 39") and len(precharge.before) == MOST_SHOWN
    assert row.key.startswith("current.where[") and row.after == "–"


def test_of_a_bay_too_and_only_what_is_in_the_file() -> None:
    bay = the_bay()
    moved = replace(bay, charger=replace(bay.charger, port="/dev/ttyY", steps_a=(1.0, *bay.charger.steps_a[1:])))
    assert [tuple(one) for one in differences(bay, moved)] == [
        ("charger.port", "/dev/ttyX", "/dev/ttyY"), ("charger.steps_a[0]", "2", "1"),
    ]  # fmt: skip
    (limit,) = differences(bay, replace(bay, limits=replace(bay.limits, temperature_c=Range(0, 44))))
    assert tuple(limit) == ("limits.temperature_c", "0 … 45", "0 … 44"), "a range is one value"
    assert list(differences({"a": {"b": 1}}, {"a": {"c": True}})) == [("a.b", "1", "–"), ("a.c", "–", "true")]
