"""A start or a reset from the page is never carried out late; a stop always is."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from orchestrator.northbound import asking
from orchestrator.northbound.asking import Asking
from orchestrator.northbound.pulse import AFTER_S, GAP_S, Pulse
from tests.northbound.bench import Browser, Controller, bay, page
from tests.waiting import wait_until

Pair = tuple[Browser, Controller]
SINCE_S = 1_764_000_000.123


@pytest.fixture(name="pair", scope="module")
def _pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    with page(tmp_path_factory.mktemp("late")) as pair:
        pair[1].document = {**pair[1].document, "bays": [{**bay("bay-1"), "since": SINCE_S}, bay("bay-2")]}
        yield pair


@pytest.fixture(autouse=True)
def _nothing_asked(pair: Pair) -> None:
    pair[1].asked.clear()


def press(pair: Pair, action: str, **more: object) -> tuple[int, str]:
    answer = pair[0].post("/api/request", {"action": action, "bay": "bay-1", **more})
    return answer.status, answer.json.get("error", "")


@pytest.mark.parametrize("action", ["start", "reset"])
def test_a_bay_that_has_changed_since_is_not_set_going(pair: Pair, action: str) -> None:
    assert press(pair, action, since=SINCE_S - 1) == (409, "bay_changed")
    assert press(pair, action, since=SINCE_S + 1) == (409, "bay_changed")
    assert pair[1].asked == []
    assert press(pair, action, since=SINCE_S) == (200, "")
    assert press(pair, action, since=SINCE_S + 0.002) == (200, ""), "as its rounding may differ"
    assert press(pair, action) == (200, "")
    assert [asked["verb"] for asked in pair[1].asked] == [action] * 3


@pytest.mark.parametrize("since", ["x", True, float("nan"), float("inf"), [], 10**400])
def test_a_since_that_is_no_moment_is_refused(pair: Pair, since: object) -> None:
    assert press(pair, "start", since=since) == (400, "field_wrong")
    assert pair[1].asked == []


def test_a_stop_is_passed_on_whatever_has_changed_or_stood_still(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Pulse, "stood_still", True)
    assert [press(pair, action, since=1) for action in ("stop", "pause")] == [(200, "")] * 2
    assert [press(pair, action) for action in ("start", "reset")] == [(503, "page_stood_still")] * 2
    assert [asked["verb"] for asked in pair[1].asked] == ["stop", "pause"]


def test_what_has_waited_here_is_not_set_going(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asking, "LATE_S", -1.0)
    assert press(pair, "start") == (503, "page_stood_still")
    assert press(pair, "stop") == (200, "")
    assert [asked["verb"] for asked in pair[1].asked] == ["stop"]


@pytest.mark.parametrize("action", ["start", "reset"])
def test_who_has_left_sets_nothing_going_but_may_stop(pair: Pair, action: str, monkeypatch: pytest.MonkeyPatch) -> None:
    handled, request = list[object](), Asking.request

    async def noting(self: Asking, asked: Mapping[str, object], *more: Any) -> dict[str, Any]:
        try:
            return await request(self, asked, *more)
        finally:
            handled.append(asked["action"])

    monkeypatch.setattr(Asking, "request", noting)
    leave(pair, action)
    leave(pair, "stop")
    wait_until(lambda: len(handled) == 2)
    assert sorted(map(str, handled)) == sorted([action, "stop"])
    assert [one["verb"] for one in pair[1].asked] == ["stop"]


def leave(pair: Pair, action: str) -> None:
    """Send a request, and be gone."""
    body = json.dumps({"action": action, "bay": "bay-1"}).encode()
    with pair[0].connected() as connection:
        head = f"POST /api/request HTTP/1.1\r\nHost: localhost\r\nContent-Length: {len(body)}\r\n"
        connection.sendall(f"{head}Content-Type: application/json\r\n\r\n".encode() + body)


def test_a_gap_in_the_pulse_counts_before_the_next_beat_and_for_a_while_after_it() -> None:
    now_s = [0.0]
    pulse = Pulse(lambda: now_s[0])
    now_s[0] = GAP_S
    assert not pulse.stood_still
    pulse.beat()
    assert not pulse.stood_still
    now_s[0] += GAP_S + 0.1
    assert pulse.stood_still, "before the first beat"
    pulse.beat()
    assert pulse.stood_still
    now_s[0] += AFTER_S - 0.1
    pulse.beat()
    assert pulse.stood_still
    now_s[0] += 0.1
    pulse.beat()
    assert not pulse.stood_still
