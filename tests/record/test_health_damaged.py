"""Whatever stands in a record: health passes it over, or tells what the others show."""

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.record import health_shown
from orchestrator.record.health import health
from tests.record.health_lives import BATTERY, records

#: They are made once for the many that are damaged.
BYTES = json.dumps(records(count=5))
ODD: st.SearchStrategy[object] = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3) | st.just([]) | st.just({"id": []})
)


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_no_damage_to_a_record_is_too_much(data: st.DataObject) -> None:
    charges = json.loads(BYTES)
    for record in charges[: data.draw(st.integers(1, 4))]:
        place = record
        while True:
            name = data.draw(st.sampled_from(sorted(place) if isinstance(place, dict) else range(len(place))))
            if not isinstance(place[name], dict | list) or not place[name] or data.draw(st.booleans()):
                place[name] = data.draw(ODD)
                break
            place = place[name]
    found = health(BATTERY, charges)
    assert len(charges) - 4 <= found.charges <= len(charges)
    assert health_shown.health_lines(found, "ko")
    assert json.dumps(health_shown.as_fields(found), allow_nan=False)


STRETCH = {"from_pct": 20.0, "to_pct": 80.0, "charger_ah": 12.0, "bmu_ah": 12.0, "lowest_c": 20.0, "highest_c": 21.0}


@pytest.mark.parametrize(
    "damage",
    [
        {"faults": [{"id": [], "effect": "WARN", "times": 1, "cause": {}}]},
        {"faults": [{"id": "x", "effect": {}, "times": 1, "cause": {}}]},
        {"faults": [5]},
        {"rules": [5]},
        {"battery": {"id": BATTERY, "source": []}},
        *(
            {"measured": {"stretch": None, "steps": [step], "hot_s": 0, "high_s": 0}}
            for step in ([0, 0, 0, 50, 20], [0, 1e300, 1, 50, 20], [0, 14, 1e-300, 50, 20], [0, 14, 1e300, 50, 20])
        ),
        *(
            {"measured": {"stretch": {**STRETCH, **odd}, "steps": [], "hot_s": 0, "high_s": 0}}
            for odd in (
                {"charger_ah": 1e308},
                {"bmu_ah": 1e308},
                {"charger_ah": 5e-324, "bmu_ah": 0},
                {"to_pct": 1e300},
            )
        ),
        {"policy": {"capacity_ah": 5e-324}},
        {"policy": {"capacity_ah": -20.0}},
        {"measured": {"stretch": None, "steps": [], "hot_s": 1e300, "high_s": -5}},
        {"end": {"unix_s": 1e300, "offset_min": 1, "mono_s": 0, "boot": ""}},
    ],
    ids=str,
)
def test_figures_that_cannot_be_break_nothing(damage: dict[str, Any]) -> None:
    charges = json.loads(BYTES)
    found = health(BATTERY, [*charges[:-1], {**charges[-1], **damage}])
    assert health_shown.health_lines(found, "en")
    json.dumps(health_shown.as_fields(found), allow_nan=False)
