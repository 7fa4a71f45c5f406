"""The status on a terminal: its head line, its marks, and what is left out where there is no room."""

from collections.abc import Mapping

import pytest

from orchestrator.columns import cut, width_of
from orchestrator.gist import COUNTED, gist
from orchestrator.model import State
from orchestrator.page import COLOURS, Block, blocks, fitted, needs_a_person, page, painted
from orchestrator.text.catalogue import say

CLOCK = "21:16:04"


def bay(number: int = 1, state: str = "CHARGING", **changes: object) -> dict[str, object]:
    return {
        "name": f"bay-{number}",
        "state": state,
        "reason": "step 5 (14.0 A): the highest step, nothing limits it",
        "step": 4,
        "step_current_a": 14.0,
        "charger": {"current_a": 14.0, "voltage_v": 50.0, "old": False},
        "battery": {"soc_pct": 54.6, "voltage_v": 48.123, "temperature_c": 8.4, "old": []},
        "faults": [],
        "alarm": "none",
        **changes,
    }


def head(*bays: Mapping[str, object], language: str = "en") -> str:
    return say(gist(bays, CLOCK), language)


TRIPPED = bay(2, "TRIPPED", alarm="attention")
LOOSE = bay(3, "UNCONTROLLABLE", alarm="danger")


def test_the_head_line_counts_what_people_care_about() -> None:
    full = bay(4, "FULL", charger={"current_a": 0.0, "voltage_v": 54.0, "old": False})
    station = [*[bay(number) for number in range(5, 66)], TRIPPED, LOOSE, full]
    assert head(*station) == f"64 bays: 61 charging, 2 need you, 1 full; 882 A, 44 kW · {CLOCK}"
    assert head(*station, language="ko") == (
        f"베이 64개: 충전 중 61, 조치 필요 2, 충전 완료 1 · 882 A, 44 kW · {CLOCK}"
    )
    assert head(TRIPPED) == f"1 bay: 1 needs you; 14 A, 0.7 kW · {CLOCK}"
    assert head(TRIPPED, LOOSE).startswith("2 bays: 2 need you; 28 A, 1.4 kW")


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_state_is_counted(state: State, language: str) -> None:
    assert state.value in COUNTED or state is State.UNCONTROLLABLE
    told = head(bay(state=state.value), bay(2, state.value), language=language)
    assert "2" in told.partition(":")[2].partition(",")[0]
    assert "another" not in told and "기타" not in told


def test_a_state_of_tomorrow_is_counted_too() -> None:
    assert head(bay(state="RESTING")).startswith("1 bay: 1 in another state;")


@pytest.mark.parametrize(
    "charger",
    [
        {"current_a": 14.0, "voltage_v": 50.0, "old": True},
        {"current_a": None, "voltage_v": 50.0, "old": False},
        {"current_a": 14.0, "voltage_v": None, "old": False},
    ],
)
def test_only_what_is_present_and_not_old_is_summed(charger: dict[str, object]) -> None:
    assert head(bay(charger=charger)) == f"1 bay: 1 charging · {CLOCK}"
    assert head(bay(), bay(2, charger=charger)) == f"2 bays: 2 charging; 14 A, 0.7 kW · {CLOCK}"


def test_sums_are_no_more_exact_than_people_read_them() -> None:
    def flow(amps: float) -> str:
        return head(bay(charger={"current_a": amps, "voltage_v": 50.0, "old": False})).partition("; ")[2]

    assert flow(0.0) == f"0 A, 0 kW · {CLOCK}"
    assert flow(4.98) == f"5.0 A, 0.2 kW · {CLOCK}"
    assert flow(240.0) == f"240 A, 12 kW · {CLOCK}"


# --- marks -----------------------------------------------------------------------------------------------------------


def test_what_needs_a_person_is_marked_at_the_beginning_of_its_line() -> None:
    lines = page({"bays": [bay(1), TRIPPED, LOOSE]}, clock=CLOCK).splitlines()
    assert [line[:8] for line in lines[2:]] == ["   BAY  ", "!! bay-3", "!  bay-2", "   bay-1"]
    assert lines[0].startswith("3 bays: 1 charging, 2 need you; ") and lines[1].startswith("ALARM: CUT THE MAINS of ")
    assert page({"bays": [bay(1)]}).splitlines()[1].startswith("bay-1")  # nothing to mark


def test_colour_is_only_for_what_needs_a_person() -> None:
    found = blocks({"bays": [bay(1), TRIPPED, LOOSE], "journal": {"problem": "full"}}, width=60, clock=CLOCK)
    coloured = painted(found, colour=True).split("\n")
    begun = {"": (), "danger": ("ALARM: ", "!! bay-3"), "attention": ("WARNING: ", "!  bay-2")}
    for level, begins in begun.items():
        colour = COLOURS.get(level, "")
        assert all(any(line.startswith(colour + begin) for line in coloured) for begin in begins)
    assert all(line.endswith("\x1b[0m") == line.startswith("\x1b[") for line in coloured)
    assert not any("\x1b" in line for line in coloured if "bay-1" in line)
    assert "\x1b" not in painted(found, colour=False)


def test_only_problems() -> None:
    document = {"bays": [bay(1), TRIPPED, bay(4)]}
    lines = [block.text for block in blocks(document, clock=CLOCK, problems=True)]
    assert lines[0].startswith("3 bays: 2 charging, 1 needs you")
    assert [line[:8] for line in lines[1:]] == ["   BAY  ", "!  bay-2"]
    calm = [block.text for block in blocks({"bays": [bay(1)]}, clock=CLOCK, problems=True)]
    assert calm == [f"1 bay: 1 charging; 14 A, 0.7 kW · {CLOCK}", "no bay needs a person"]
    korean = blocks({"bays": [bay(1)], "language": "ko"}, problems=True)
    assert [block.text for block in korean] == ["조치가 필요한 베이가 없습니다"]


STRAY = {"bay": "bay-7", "port": "/dev/old", "state": "STOPPING", "verified": False, "problem": ""}


@pytest.mark.parametrize(
    ("document", "needs"),
    [
        ({"bays": [bay()]}, False),
        ({"bays": [bay(), TRIPPED]}, True),
        ({"bays": [bay(alarm=True)]}, True),
        ({"bays": [bay(), LOOSE]}, True),
        ({"bays": [bay(state="HELD")]}, False),
        ({"bays": [bay()], "strays": [STRAY]}, True),
        ({"bays": [bay()], "strays": [{**STRAY, "verified": True}]}, False),
        ({"bays": [bay()], "journal": {"problem": "disk full"}}, True),
        ({"bays": [bay()], "journal": {"problem": ""}, "persisted": {"problem": ""}}, False),
    ],
)
def test_whether_somebody_must_look(document: dict[str, object], needs: bool) -> None:
    assert needs_a_person(document) is needs
    assert any(block.level for block in blocks(document)) is needs  # as the page shows


# --- room ------------------------------------------------------------------------------------------------------------

PATH = "/dev/serial/by-path/platform-fd500000.pcie-pci-0000:01:00.0-usb-0:1.7:1.0-port0"
OLD = {"current_a": 14.0, "voltage_v": 50.0, "old": True, "age_s": 46.0}
WIDE = [
    bay(1, reason=f"{PATH}: no such port"),
    bay(2, "OFFLINE", port=PATH, alarm="danger", charger=OLD),
    bay(3, "PRECHARGE_CONTINUOUS", reason="팩 전압이 39 V 아래입니다: 연속 프리차지(policies/li-ion-48v.yaml:31)"),
    bay(4, name="a" * 64),
    bay(5, name="베이" * 32),
]  # fmt: skip


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("width", [20, 40, 60, 80, 120, 200])
def test_no_line_is_wider_than_the_terminal(width: int, language: str) -> None:
    text = page({"bays": WIDE, "strays": [{**STRAY, "port": PATH}]}, language, width, CLOCK)
    assert max(map(width_of, text.splitlines())) <= width
    assert PATH in text.replace("\n", "").replace(" ", "")


def test_a_word_longer_than_the_screen_is_cut() -> None:
    assert list(cut("abcdefg", 3)) == ["abc", "def", "g"]
    assert list(cut("가나다", 3)) == ["가", "나", "다"]
    assert list(cut("abc", 3)) == list(cut("abc", 0)) == ["abc"]
    assert list(cut("", 3)) == [""]
    assert list(cut("/dev/serial/by-path/usb-0", 14)) == ["/dev/serial/", "by-path/usb-0"]
    assert list(cut("/abcdefghijk", 8)) == ["/abcdefg", "hijk"]


def test_columns_move_together_where_that_makes_them_fit() -> None:
    lines = page({"bays": [bay(1), TRIPPED]}, width=60).splitlines()
    assert lines[0].split() == ["BAY", "STATE", "SOC", "PACK", "CURRENT", "TEMP", "STEP"]
    assert lines[1] == "!  bay-2 TRIPPED  55 % 48.12 V 14.00 A 8.4 °C 5 (14.0 A)"


@pytest.mark.parametrize("height", range(1, 12))
def test_never_more_lines_than_the_terminal_has(height: int) -> None:
    found = blocks({"bays": [bay(1), TRIPPED, LOOSE, *(bay(number) for number in range(4, 65))]}, "en", 60, CLOCK)
    lines = painted(fitted(found, height), colour=False).split("\n")
    assert len(lines) <= height
    shown = sum(line[3:7] == "bay-" for line in lines)
    assert lines[-1] == f"… and {64 - shown} more"
    if height > 5:
        assert lines[1].startswith("ALARM: CUT THE MAINS of bay-3")


def test_what_fits_is_left_as_it_is() -> None:
    found = blocks({"bays": [bay(1), TRIPPED]}, "en", 200, CLOCK)
    assert fitted(found, 4) == found
    assert [block.text for block in fitted(found, 3, "ko")] == [found[0].text, "… 외 2개"]  # no head without a table
    assert [block.text for block in fitted(found[:3], 3)] == [block.text for block in found[:3]]
    assert fitted([Block("one\ntwo\nthree")], 2) == [Block("one")]
    assert fitted([], 5) == []
