"""The bays in groups: whose turn it is comes first, and 64 of them fit into a window of 80 × 30."""

from collections.abc import Sequence
from typing import Any

import pytest

from orchestrator.columns import width_of
from orchestrator.model import State
from orchestrator.page import painted
from orchestrator.service.group_page import IN_WORDS, group_blocks
from tests.service.test_page import CLOCK, bay

HOT = (
    "keep people away until it has cooled down; inspect the pack, then reset – the pack has 56.1 °C, at or above 55 °C"
)
COUNTS = (1, 2, IN_WORDS, IN_WORDS + 1, 64)


def page(bays: Sequence[dict[str, Any]], width: int = 80, language: str = "en", **more: Any) -> list[str]:
    found = group_blocks({"bays": bays, "language": "en"}, language, width, CLOCK, **more)
    return painted(found, colour=False).split("\n")


def station(needing: int, level: str = "attention", bays: int = 64) -> list[dict[str, Any]]:
    states = [state.value for state in State if state.value not in ("TRIPPED", "UNCONTROLLABLE")]
    tripped = {"state": "TRIPPED", "alarm": level, "reason": HOT}
    return [
        bay(number, **(tripped if number <= needing else {"state": states[number % 7]}))
        for number in range(1, bays + 1)
    ]


def test_what_needs_a_person_comes_first_in_words_and_the_others_by_name() -> None:
    calm = [bay(2), bay(3), bay(4, "FULL", battery={"soc_pct": None, "old": []})]
    lines = page([*calm, bay(1, "TRIPPED", alarm="attention", reason=HOT)])
    assert lines[0].startswith("4 bays: 2 charging, 1 needs you, 1 full; ")
    assert lines[1:] == [
        "1 needs you",
        "!  bay-1  TRIPPED  keep people away until it has cooled down; inspect the pack,…",
        "2 charging   bay-2 55 %  bay-3 55 %",
        "1 full       bay-4 –",
    ]
    assert page(calm, problems=True)[1:] == ["no bay needs a person"]
    assert "조치 필요 1" in page([bay(1, "TRIPPED", alarm="attention")], language="ko")


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("level", ["attention", "danger"])
@pytest.mark.parametrize("needing", [0, *COUNTS])
def test_64_bays_fit_into_a_window(needing: int, level: str, language: str) -> None:
    lines = page(station(needing, level), language=language)
    assert len(lines) <= 29  # and the prompt
    assert max(map(width_of, lines)) <= 80
    shown = " ".join(lines)
    assert all(f"bay-{number} " in shown for number in range(1, 65))


@pytest.mark.parametrize("width", [0, 20, 39, 60, 200])
def test_lines_fit_any_terminal(width: int) -> None:
    lines = page([*station(5), bay(70, name="b" * 64)], width)
    assert max(map(width_of, lines[1:])) <= (width or 100)


def test_of_many_alarms_the_first_are_told_at_length_and_all_are_marked() -> None:
    lines = page(station(20, "danger"))
    assert sum(line.startswith("ALARM: ") for line in lines) == 2
    assert "… and 18 more" in lines
    assert sum("!!bay-" in line for line in lines) >= 3
