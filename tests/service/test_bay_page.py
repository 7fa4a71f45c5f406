"""What the status tells around and ahead of a bay, and the page made from it."""

import json
from collections.abc import Mapping, Sequence
from time import localtime, strftime
from typing import Any, cast

import pytest

from orchestrator.columns import width_of
from orchestrator.config.load import load_policy
from orchestrator.config.station import BayConfig
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.core.states import BY_PERSON
from orchestrator.model import BatteryStatus, Decision, Request, Snapshot, State
from orchestrator.page import painted
from orchestrator.service.bay_page import bay_blocks
from orchestrator.service.outlook import NEXT, outlook
from orchestrator.service.status import bay_status
from orchestrator.service.wallclock import WallClock
from tests.core import bays
from tests.core.world import World, bay

NOW_S = 1_800_000_000.0
POLICY = load_policy("li-ion-48v")


def document(world: World, **more: Any) -> dict[str, Any]:
    """The bay's part of the status, as a client receives it."""
    clock, snapshot = WallClock(world.now_s, NOW_S), world.snapshot(None, "")
    looked = outlook(world.decision, snapshot, world.memory, world.rules, clock, "en", closely=True)
    status = bay_status("bay-1", snapshot, world.decision, clock.now_s, clock.wall_s, "en")
    policy = {"name": "mine", "file": "mine.yaml", "sha256": "0123", "since": NOW_S - 90_000, "waiting_sha256": ""}
    other = {"port": "/dev/ttyX", "bmu": {"can": "can0", "node_id": 0x10}, "policy": policy, **more}
    found: dict[str, Any] = json.loads(json.dumps({**status, **looked, **other}))
    return found


def page(
    bay: Mapping[str, Any], language: str = "en", width: int = 0, events: Sequence[tuple[str, str]] = ()
) -> list[str]:
    whole = {"bays": [bay], "language": "en"}
    return painted(bay_blocks(whole, events, language, width, NOW_S), colour=False).split("\n")


def line(lines: list[str], label: str) -> str:
    (found,) = [text for text in lines if text.startswith(label)]
    return found.removeprefix(label).strip()


def charging(the_bay: BayConfig | None = None, run_s: float = 60.0, **values: float) -> World:
    world = World(the_bay or bay(POLICY), **values).charging()
    world.run(run_s)
    return world


def test_the_page_names_the_battery_and_tells_what_a_person_has_asked_for() -> None:
    cause = {"id": "identity_typed", "params": {"battery": "B-0042"}}
    identity = {"id": "B-0042", "source": "typed", "cause": cause, "text": "B-0042, typed by an operator"}
    params = {"start_at": "22:00", "who": "kim", "asked_at": "18:10"}
    timed = {"id": "starts_at", "params": params, "text": "starts at 22:00 (asked by kim at 18:10)", "at": NOW_S}
    bay = document(charging(), identity=identity, timed_start=timed)
    assert line(page(bay), "BATTERY") == "B-0042, typed by an operator"
    assert line(page(bay), "NOTES") == "starts at 22:00 (asked by kim at 18:10)"
    assert line(page(bay, "ko"), "배터리") == "B-0042(운영자가 입력)"
    assert line(page(bay, "ko"), "참고") == "22:00에 시작합니다(kim, 18:10 요청)"
    bay["next"] = {**timed, "by_itself": True, "at": NOW_S - NOW_S % 86400 + 22 * 3600}
    assert "(22:00" not in line(page(bay), "NEXT").removeprefix("starts at 22:00 (asked")


# --- limits ----------------------------------------------------------------------------------------------------------


def limits(world: World) -> list[tuple[float | None, str, bool]]:
    return [(one["allowed_a"], one["cause"]["key"], one["binds"]) for one in document(world)["limits"]]


def test_every_limit_is_listed_and_the_one_that_binds_comes_first() -> None:
    assert limits(charging(temperature_c=12.0)) == [
        (6.0, "current.temperature_c.rows[1]", True),
        (14.0, "pack.current_a", False),
        (14.0, "current.soc_pct.rows[0]", False),
        (14.0, "current.soh_pct.rows[1]", False),
        (None, "pack.voltage_v", False),
        (None, "pack.temperature_c", False),
        (None, "finish.max_ah", False),
        (None, "finish.max_hours", False),
    ]


def test_nothing_binds_on_the_highest_step() -> None:
    assert not any(binds for *_, binds in limits(charging()))


def test_a_station_limit_a_fault_and_precharge_bind() -> None:
    assert limits(charging(bay(POLICY, current_a=9.0)))[0] == (8.0, "limits.current_a", True)
    warned = charging()
    warned.values["status"] = float(1 << BatteryStatus.LOW_TEMPERATURE)
    warned.run(5)
    assert limits(warned)[0] == (2.0, "fault status_limit", True)
    precharged = World(bay(POLICY), voltage_v=33.0).charging(State.PRECHARGE_PULSE)
    assert limits(precharged)[0] == (2.0, "precharge", True)


def test_at_rest_it_is_told_what_would_bind() -> None:
    world = World(bay(POLICY), soc_pct=99.0)
    world.until(State.IDLE)
    assert limits(world)[0] == (8.0, "current.soc_pct.rows[1]", True)


def test_the_stricter_of_station_and_policy_is_named() -> None:
    world = charging()
    keys = [one["cause"]["key"] for one in document(world)["limits"]]
    assert "pack.voltage_v" in keys and "limits.voltage_v" not in keys


# --- what comes next -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", State)
def test_every_state_says_what_comes_next_and_whether_by_itself(state: State) -> None:
    decision = Decision(state, Memory().cause)
    looked = outlook(decision, Snapshot(), None, Rules.of(bay(POLICY)), WallClock(0.0, NOW_S), "en", closely=True)
    coming = cast("dict[str, Any]", looked["next"])
    assert state in NEXT or state is State.CHARGING
    assert coming["text"] and "{" not in coming["text"]
    assert coming["by_itself"] is (state not in BY_PERSON)
    assert looked.keys() == {"since", "next", "target"} and looked["since"] is None


def test_what_costs_most_is_told_of_a_bay_that_is_asked_for_by_name() -> None:
    world = charging()
    clock, snapshot = WallClock(world.now_s, NOW_S), world.snapshot(None, "")
    looked = outlook(world.decision, snapshot, world.memory, world.rules, clock, "en", closely=False)
    assert looked.keys() == {"since", "next", "target"}
    assert document(world).keys() >= {"since", "next", "limits", "forecast"}


def test_an_operators_pause_waits_for_a_person() -> None:
    world = charging()
    world.ask(Request.PAUSE)
    world.until(State.SUSPENDED)
    coming = document(world)["next"]
    assert (coming["text"], coming["by_itself"]) == ("to go on: orchestrator start bay-1", False)
    lines = page(document(world))
    assert line(lines, "WHY") == "paused by the operator"
    assert line(lines, "NEXT") == "waits for a person: to go on: orchestrator start bay-1"


def test_a_hot_pack_goes_on_by_itself_and_it_is_said_when() -> None:
    world = charging(temperature_c=44.7)
    world.values["temperature_c"] = 45.2
    world.until(State.SUSPENDED)
    assert document(world)["next"]["text"].startswith("goes on by itself 10 s after it is gone")
    for tenth in range(452, 390, -2):
        world.values["temperature_c"] = tenth / 10
        world.run(1)
    coming = document(world)["next"]
    assert coming["by_itself"] is True
    assert 0 < coming["at"] - NOW_S < 10
    at = strftime("%H:%M:%S", localtime(coming["at"]))
    assert line(page(document(world)), "NEXT").endswith(f"({at})")


def test_a_full_battery_says_below_which_soc_it_is_charged_again() -> None:
    lines = page(document(bays.full()))
    assert line(lines, "NEXT").startswith("SOC 100 % now, charged again below ")
    assert "charged again" not in line(lines, "WHY")


# --- the page --------------------------------------------------------------------------------------------------------


def test_the_page_of_a_charge() -> None:
    world = charging(run_s=90, soc_pct=40.0, time_to_full_min=83.0)
    lines = page(document(world), events=[("21:02:14", "it began")])
    begun = strftime("%H:%M:%S", localtime(NOW_S))
    assert lines[0] == f"bay-1 · {begun}"
    assert line(lines, "STATE").startswith("CHARGING since ") and line(lines, "STATE").endswith(" s)")
    assert line(lines, "WHY") == "step 5 (14.0 A): the highest step, nothing limits it"
    assert line(lines, "SESSION").endswith("; SOC 40 % → 40 %")
    assert line(lines, "FORECAST").startswith("until it is full: by the BMU: in 1 h 23 min, at ")
    assert "; by our own estimate: in 1 h 55 min, at " in line(lines, "FORECAST")
    assert line(lines, "BATTERY") == "SOC 40 %, SOH 100 %, 48.00 V, 14.00 A, 20.0 °C, BMU 0x10 on can0"
    assert line(lines, "CHARGER") == "48.0 V, 14.00 A, STEP 5 (14.0 A), /dev/ttyX"
    since = strftime("%Y-%m-%d %H:%M", localtime(NOW_S - 90_000))
    assert line(lines, "POLICY") == f"mine (mine.yaml, sha256 0123), in force since {since}"
    assert line(lines, "EVENTS") == "21:02:14  it began"


def test_a_target_below_full_is_named_and_no_estimate_is_said_as_such() -> None:
    world = charging(bay(load_policy("long-life-48v")))
    forecast = line(page(document(world)), "FORECAST")
    assert forecast.startswith("to SOC 80 % (policies/long-life-48v.yaml:")
    assert ": by our own estimate: in " in forecast
    begun = line(page(document(charging(run_s=1))), "FORECAST")
    assert begun == "until it is full: nothing sensible can be said now"


def test_what_is_old_is_marked_and_an_alarm_comes_first() -> None:
    world = charging()
    known = document(world)
    lost = {**known, "state": "OFFLINE", "alarm": "danger", "charger": {**known["charger"], "old": True, "age_s": 46.0}}
    lines = page({**lost, "battery": {**known["battery"], "old": ["soc_pct"]}})
    assert lines[1].startswith("ALARM: CUT THE MAINS of bay-1's charger (/dev/ttyX): OFFLINE: ")
    assert line(lines, "CHARGER").startswith("48.0 V (old), 14.00 A (old), ")
    assert line(lines, "BATTERY").startswith("SOC 50 % (old), SOH 100 %, ")
    assert line(lines, "NOTES").startswith("OLD: the charger's 14.00 A, last heard 46 s ago; the BMU sees 14.0 A")


def test_an_older_service_has_a_page_too() -> None:
    known = {name: value for name, value in document(charging()).items() if name not in ("since", "next", "limits")}
    lines = page({**known, "forecast": None, "bmu": None, "session": None, "cause": None, "reason": "it charges"})
    assert line(lines, "STATE") == "CHARGING" and line(lines, "WHY") == "it charges"
    assert not any(text.startswith(("NEXT", "LIMITS", "SESSION", "FORECAST")) for text in lines)


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("width", [20, 60, 200])
def test_no_line_is_wider_than_the_terminal(width: int, language: str) -> None:
    event = "CHARGING → STOPPING: the pack has 56.5 °C, at or above 55 °C (policies/li-ion-48v.yaml:87)"
    for world in (charging(temperature_c=12.0), bays.full(), World(None)):
        if not world.decisions:
            world.tick()
        lines = page(document(world), language, width, events=[("21:02:14", event)])
        assert max(map(width_of, lines)) <= width
        if language == "ko" and width > 20:
            assert any(text.startswith("이유 ") for text in lines)
            assert not any(text.startswith("WHY") for text in lines)


def test_the_limits_are_said_in_the_readers_language() -> None:
    lines = page(document(charging(temperature_c=12.0)), "ko")
    assert line(lines, "제한").startswith("6.0 A  현재 적용: 온도 12.0 °C(")
    assert line(lines, "다음") == "완전히 충전되거나 목표에 이를 때까지 스스로 계속합니다"
