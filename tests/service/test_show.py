"""The table printed by `orchestrator status`."""

from collections.abc import Mapping, Sequence
from typing import cast

import pytest

from orchestrator.columns import width_of
from orchestrator.model import Cause
from orchestrator.page import page
from orchestrator.show import figure, head, stands_by, strays, what_to_do
from orchestrator.text.catalogue import fields


def bay(**changes: object) -> dict[str, object]:
    return {
        "name": "bay-1",
        "state": "CHARGING",
        "reason": "step 2 (5.0 A): temperature 8.4 °C in 0 … 10 °C",
        "step": 1,
        "step_current_a": 5.0,
        "charger": {"current_a": 4.98},
        "battery": {"soc_pct": 54.6, "voltage_v": 48.123, "temperature_c": 8.4},
        "faults": [],
        **changes,
    }


def table(bays: Sequence[Mapping[str, object]], language: str = "", width: int = 0) -> str:
    return page({"bays": bays, "language": language}, language, width)


EMPTY = bay(
    name="a-bay-with-a-long-name",
    state="IDLE",
    reason="no battery",
    step=None,
    step_current_a=None,
    charger={"current_a": None},
    battery={"soc_pct": None, "voltage_v": None, "temperature_c": None},
)


def test_a_line_a_bay_with_units() -> None:
    assert table([bay(), EMPTY]) == (
        "BAY                     STATE     SOC   PACK     CURRENT  TEMP    STEP       WHY\n"
        "bay-1                   CHARGING  55 %  48.12 V  4.98 A   8.4 °C  2 (5.0 A)  "
        "step 2 (5.0 A): temperature 8.4 °C in 0 … 10 °C\n"
        "a-bay-with-a-long-name  IDLE      –     –        –        –       –          no battery"
    )


def test_no_bays_is_only_the_head() -> None:
    assert table([]) == "BAY  STATE  SOC  PACK  CURRENT  TEMP  STEP  WHY"


def fault(id_: str, text: str) -> Mapping[str, object]:
    cause = {"id": id_, "key": "", "advice": id_, "params": {"what": None}}
    return {"id": id_, "effect": "WARN", "text": text, "cause": cause, "since": 0.0}


def test_a_fault_that_is_not_the_reason_stands_below() -> None:
    hot, noisy = fault("hot_trip", "too hot"), fault("noisy_line", "a noisy line")
    cause = {"id": "several", "key": "", "advice": "", "params": {"whats": [hot["cause"]]}}
    told = bay(reason="stopped: too hot", cause=cause, faults=[hot, noisy])
    assert table([told]).splitlines()[2:] == ["  WARN: a noisy line"]


def test_a_policy_that_waits_is_told() -> None:
    told = bay(policy={"name": "mine", "sha256": "0123", "waiting_sha256": "4567"})
    assert table([told]).splitlines()[2:] == ["  POLICY: a changed one comes into force when this bay stands by"]
    assert len(table([bay(policy={"waiting_sha256": ""})]).splitlines()) == 2


def test_figures() -> None:
    assert figure(0, "{:.1f} A") == "0.0 A"
    assert figure(None, "{:.1f} A") == "–"


# --- what is old -----------------------------------------------------------------------------------------------------


def test_what_was_not_heard_lately_is_marked_with_what_is_known_instead() -> None:
    told = bay(
        charger={"current_a": 14.0, "age_s": 12.4, "old": True},
        battery={"soc_pct": 54.6, "voltage_v": 48.1, "temperature_c": 8.4, "current_a": 0.04, "age_s": {}, "old": []},
    )
    line, below = table([told]).splitlines()[1:]
    assert "14.00 A (old)" in line
    assert below == "  OLD: the charger's 14.00 A, last heard 12 s ago; the BMU sees 0.0 A"


def test_what_both_said_long_ago_is_no_evidence() -> None:
    ages_s = {"soc_pct": 120.9, "voltage_v": 119.6, "temperature_c": 9000.0, "current_a": 600.0}
    told = bay(
        charger={"current_a": 14.0, "age_s": 601.0, "old": True},
        battery={
            "soc_pct": 54.6, "voltage_v": 48.1, "temperature_c": 8.4, "current_a": 0.0, "age_s": ages_s,
            "old": list(ages_s),
        },
    )  # fmt: skip
    line, below = table([told]).splitlines()[1:]
    assert line.count("(old)") == 4
    assert below == (
        "  OLD: the charger's 14.00 A, last heard 10 min ago; SOC, pack voltage: last heard 2 min ago; "
        "temperature: last heard 2 h ago"
    )


# --- what to do ------------------------------------------------------------------------------------------------------


def test_what_needs_a_person_comes_first() -> None:
    calm, loud = bay(), bay(name="bay-9", state="UNCONTROLLABLE", reason="it runs on", port="/dev/ttyUSB9")
    alarmed = bay(name="bay-5", state="OFFLINE", reason="silent", alarm="danger")
    held = bay(name="bay-7", state="HELD", reason="mode 7", alarm="attention")
    lines = table([calm, held, alarmed, loud]).splitlines()
    assert lines[:2] == [
        "ALARM: CUT THE MAINS of bay-9's charger (/dev/ttyUSB9): UNCONTROLLABLE: it runs on",
        "ALARM: CUT THE MAINS of bay-5's charger (its port is not known): OFFLINE: silent",
    ]
    assert [line[:9].rstrip() for line in lines[2:]] == ["   BAY", "!! bay-9", "!! bay-5", "!  bay-7", "   bay-1"]


def test_what_needs_a_person_is_said_once() -> None:
    faults = [
        {**fault("will_not_stop", "cut the charger's mains now – it still delivers 14.00 A"), "effect": "TRIP"},
        fault("noisy_line", "a noisy line"),
    ]
    reason = "CUT THE MAINS of this charger (/dev/x): it runs"
    text = table([bay(state="UNCONTROLLABLE", reason=reason, cause={"id": "uncontrollable"}, faults=faults)])
    assert text.lower().count("mains") == 1
    assert text.splitlines()[2].endswith("  see ALARM")
    assert text.splitlines()[3:] == ["     WARN: a noisy line"]


STOPPED = bay(
    state="HELD",
    reason="stopped by the operator",
    port="/dev/ttyUSB1",
    command={"order": {"action": None}},
    charger={"online": True, "operation": 0, "current_a": 0.0, "old": False},
    battery={"current_a": 0.0, "old": []},
)
CHARGER, BATTERY = cast("dict[str, object]", STOPPED["charger"]), cast("dict[str, object]", STOPPED["battery"])


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"state": "IDLE"},
        {"state": "TRIPPED"},
        {"state": "TRIPPED", "alarm": "attention"},
        {"alarm": "none"},
        {"state": "SUSPENDED"},
        {"state": "FULL"},
        {"battery": {"current_a": None, "old": []}},
        {"battery": {"current_a": 14.0, "old": ["current_a"]}},
        {"battery": {"current_a": -5.0, "old": []}},
    ],
)
def test_a_charger_that_stands_by(change: dict[str, object]) -> None:
    assert stands_by({**STOPPED, **change})


@pytest.mark.parametrize(
    "change",
    [
        {"state": "STOPPING"},
        {"state": "CHARGING"},
        {"state": "OFFLINE"},
        {"state": "UNCONTROLLABLE"},
        {"alarm": "danger"},
        {"alarm": True},
        {"command": {"order": {"action": "stop"}}},
        {"charger": {**CHARGER, "online": False}},
        {"charger": {**CHARGER, "old": True}},
        {"charger": {**CHARGER, "operation": 1}},
        {"charger": {**CHARGER, "operation": None}},
        {"charger": {**CHARGER, "current_a": 0.6}},
        {"charger": {**CHARGER, "current_a": None}},
        {"battery": {**BATTERY, "current_a": 14.0}},
    ],
)
def test_whatever_speaks_against_it_is_no_standby(change: dict[str, object]) -> None:
    assert not stands_by({**STOPPED, **change})


@pytest.mark.parametrize(
    ("change", "first"),
    [
        ({"state": "UNCONTROLLABLE"}, "CUT THE MAINS of bay-1's charger (/dev/ttyUSB1): UNCONTROLLABLE: "),
        ({"state": "STOPPING"}, "CUT THE MAINS of bay-1's charger (/dev/ttyUSB1): STOPPING: "),
        ({"state": "OFFLINE", "alarm": "danger"}, "CUT THE MAINS of bay-1's charger (/dev/ttyUSB1): OFFLINE: "),
        ({"state": "OFFLINE"}, "LOOK at bay-1's charger (/dev/ttyUSB1), nobody has seen that it stands by: OFFLINE: "),
    ],
)
def test_what_to_do_is_said_before_why(change: dict[str, object], first: str) -> None:
    assert what_to_do({**STOPPED, **change}) == f"{first}stopped by the operator"


def test_advice_that_the_reason_begins_with_is_not_said_twice() -> None:
    reason = "CUT THE MAINS of this charger (/dev/x): it runs on"
    told = bay(state="UNCONTROLLABLE", reason=reason, cause={"id": "uncontrollable"})
    assert what_to_do(told) == "bay-1: CUT THE MAINS of this charger (/dev/x): it runs on"


def test_the_page_begins_with_chargers_that_are_no_bays_any_more_and_with_what_is_wrong_with_the_station() -> None:
    stray = {"bay": "bay-7", "port": "/dev/old", "state": "STOPPING", "verified": False, "problem": "no such port"}
    document = {
        "bays": [],
        "journal": {"problem": "disk full"},
        "persisted": {"problem": "its disk hangs"},
        "strays": [stray, {**stray, "port": "/dev/other", "verified": True}],
    }
    assert page(document).splitlines() == [
        "ALARM: CUT THE MAINS of the charger on /dev/old, which was bay-7's: it may be running, nobody has seen that "
        "it stands by: no such port",
        "WARNING: disk full",
        "WARNING: its disk hangs",
        "BAY  STATE  SOC  PACK  CURRENT  TEMP  STEP  WHY",
    ]
    assert strays({}) == []
    assert page({"bays": [], "journal": {"problem": ""}}) == "BAY  STATE  SOC  PACK  CURRENT  TEMP  STEP  WHY"


def test_the_columns_stand_below_each_other_in_every_language() -> None:
    assert (width_of("48.10 V (old)"), width_of("48.10 V (이전 값)")) == (13, 17)
    stale = bay(charger={"current_a": 14.0, "old": True, "age_s": 46.0})
    for language in ("en", "ko"):
        lines = table([stale, bay(name="bay-2")], language).splitlines()
        steps = [width_of(line[: line.index("2 (5.0 A)  ")]) for line in lines if line.startswith("bay-")]
        assert len(steps) == 2
        assert len(set(steps)) == 1, language


def test_the_page_is_in_the_readers_language() -> None:
    cause = fields(Cause.of("stopped_first"))
    told = bay(state="OFFLINE", alarm="danger", cause=cause, reason="the charger is being stopped", port="/dev/x")
    document = {"bays": [told], "strays": [{"bay": "bay-7", "port": "/dev/old", "problem": "", "state": "STOPPING",
                                            "verified": False}]}  # fmt: skip
    lines = page(document, "ko").splitlines()
    assert lines[0].startswith("경보: bay-7의 것이었던 /dev/old의 충전기의 주전원을 차단하십시오")
    assert lines[1] == (
        "경보: bay-1의 충전기(/dev/x)의 주전원을 차단하십시오: OFFLINE: 다른 무엇보다 먼저 충전기를 정지하고 있습니다"
    )
    assert "the charger is being stopped" in page(document)
    assert "the charger is being stopped before anything else" in page(document, "en")


WHY = (
    "inspect the pack, then reset – at 21:02:14, the pack had 55.3 °C, at or above 55 °C (policy.yaml:12); 39.8 °C "
    "now; gone since 21:03:10: orchestrator reset bay-1, then orchestrator start bay-1"
)


def test_a_long_reason_stays_in_its_column() -> None:
    told = bay(state="TRIPPED", reason=WHY, faults=[fault("noisy_line", "a noisy line " * 9)])
    head, *lines = table([told], width=120).splitlines()
    column = head.index("WHY")
    assert all(len(line) <= 120 for line in lines)
    warned = next(number for number, line in enumerate(lines) if line.startswith("  WARN: a noisy line"))
    assert {line[:column].strip() for line in lines[1:warned]} == {""}
    assert " ".join(line[column:].strip() for line in lines[:warned]) == WHY
    assert lines[warned + 1].startswith("    ")
    assert table([told], width=0).splitlines()[1].endswith(WHY)


def test_on_a_narrow_screen_the_reason_stands_below_and_commands_stay_whole() -> None:
    head, cells, *lines = table([bay(state="TRIPPED", reason=WHY)], width=60).splitlines()
    assert (head.split()[-1], cells.split()[0]) == ("STEP", "bay-1")
    assert all(len(line) <= 60 for line in (head, *lines))
    assert " ".join(line.strip() for line in lines) == WHY
    assert any("orchestrator reset bay-1" in line for line in lines)
    assert any("39.8 °C" in line for line in lines)


def test_korean_is_as_wide_as_a_terminal_shows_it() -> None:
    told = table([bay(reason="팩 온도가 높습니다 " * 9)], width=60)
    assert max(len(line) for line in told.splitlines()[2:]) < 45


@pytest.mark.parametrize("old", [["soc_pct"], ["soc_pct", "voltage_v"], ["soc_pct", "voltage_v", "temperature_c"]])
def test_a_wide_letter_before_a_reason_takes_nothing_out_of_it(old: list[str]) -> None:
    reason = " ".join(["전압이 47.0 V가 아니라 47.9 V이므로 기다립니다"] * 3)
    battery = {"soc_pct": 54.6, "voltage_v": 48.1, "temperature_c": 8.4, "age_s": {}, "old": old}
    for width in range(130, 221):
        head, *lines = table([bay(reason=reason, battery=battery)], "ko", width).splitlines()
        first, *more = lines[:-1]
        column = width_of(head[: head.index("이유")])
        start = next(number for number in range(len(first)) if width_of(first[:number]) == column)
        assert " ".join([first[start:], *map(str.strip, more)]) == reason, width


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("width", [60, 70, 80])
def test_old_values_make_no_line_wider_than_the_screen(width: int, language: str) -> None:
    battery = {"soc_pct": 54.6, "voltage_v": 48.1, "temperature_c": 8.4, "age_s": {}, "old": ["soc_pct", "voltage_v"]}
    told = bay(charger={"current_a": 14.0, "old": True, "age_s": 46.0}, battery=battery)
    lines = table([told, bay(name="bay-2")], language, width).splitlines()
    assert max(map(width_of, lines)) <= width
    *heads, _ = head(language)
    assert " ".join(lines[:2]).split()[: len(heads)] == heads
    marks = (heads[-1], "2 (5.0 A)  ")
    steps = [width_of(line[: line.index(mark)]) for line in lines for mark in marks if mark in line]
    assert len(set(steps)) == 1


def test_alarms_are_folded_too() -> None:
    alarming = bay(state="UNCONTROLLABLE", alarm="danger", reason="why " * 30, command={"order": {"action": "stop"}})
    assert all(len(line) <= 80 for line in page({"bays": [alarming]}, width=80).splitlines()[:3])
