"""Bays on one supply in the running service: what their chargers really draw, and what the service says of it."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, cast

import pytest

from orchestrator.config.station import Station, SupplyConfig
from orchestrator.core import ledger, order
from orchestrator.core.allocate import allocate
from orchestrator.core.draw import draw_w
from orchestrator.core.states import ENERGISED
from orchestrator.core.supply import Held, Want
from orchestrator.model import Cause, ControlMode, Decision, Snapshot, State
from orchestrator.page import page
from orchestrator.service import supply as supply_module
from orchestrator.service.supply import Feeds
from orchestrator.sim.presets import PACKS
from orchestrator.text.catalogue import say
from orchestrator.text.document import in_language
from tests.core.edges import NOW_S, Edge
from tests.proof.virtual_rig import Nature
from tests.proof.virtual_service import World, station, world
from tests.service.test_status_document import SCHEMA

NAMES = ("bay-1", "bay-2", "bay-3")
#: 30 W in standby, 213 W on the lowest step: enough for two of the three.
LIMIT_W = 460
NOTHING: dict[str, object] = {}


def three(limit_w: float = LIMIT_W) -> Station:
    hall = {"hall": SupplyConfig(limit_w=limit_w, bays=NAMES)}
    return replace(station([ControlMode.MANUAL] * 3), supplies=hall, stagger_s=0.0)


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Turns and waits of seconds."""
    for name, seconds in (("TURN_S", 15.0), ("RAISE_HOLD_S", 1.0), ("RAISE_EVERY_S", 6.0)):
        monkeypatch.setattr(order, name, seconds)


@contextmanager
def metered(the_station: Station, end_s: float) -> Iterator[tuple[World, list[int], list[tuple[State, ...]]]]:
    """A world with a meter on its supply, read with every decision; and the states of the bays."""
    draws, states = draw_w(the_station.bays[0]), list[tuple[State, ...]]()
    with world(the_station, [Nature(PACKS["48v"](), line="perfect") for _ in NAMES], end_s=end_s + 20) as on:
        drawn: list[int] = []

        def look(_bay: object) -> None:
            chargers = [rig.bay.charger for rig in on.rigs]
            drawn.append(sum(draws[one.current_step + 1] if one.running else draws[0] for one in chargers))
            states.append(tuple(bay.decision.state for bay in on.bays if bay.decision is not None))

        on.on_step = look
        on.time.call_later(end_s, on.end)
        yield on, drawn, states


def charged(states: list[tuple[State, ...]]) -> set[int]:
    return {number for one in states for number, state in enumerate(one) if state in ENERGISED}


def test_three_bays_take_turns_on_a_feed_for_two() -> None:
    said: list[str] = []
    with metered(three(), 45.0) as (on, drawn, states):
        on.time.call_later(20.0, lambda: said.extend(say(bay.decision.cause) for bay in on.bays if bay.decision))
        assert on.run() == 0
    assert max(drawn) == 2 * 213 + 30
    assert charged(states) == {0, 1, 2}
    assert any("granted no step yet: supply hall: 456 of 460 W are promised" in text for text in said)


def test_everything_that_shows_the_status_is_told_of_supplies_and_the_bay_that_waits_of_its_limit() -> None:
    found: list[tuple[dict[str, Any], dict[str, Any]]] = []

    def look(on: World) -> None:
        vars(on.journal)["problem"] = lambda _now_s: None
        ask = on.supervisor._sockets.handler.answer
        whole = cast("dict[str, Any]", ask({"verb": "status"}))
        waiting = whole["supplies"][0]["waiting"][0]
        found.append((whole, cast("dict[str, Any]", ask({"verb": "status", "bay": waiting}))["bays"][0]))

    with metered(three(), 12.0) as (on, _, _):
        on.time.call_later(11.0, lambda: look(on))
        assert on.run() == 0
    ((whole, waiting),) = found
    assert [error.message for error in SCHEMA.iter_errors(json.loads(json.dumps(whole)))] == []
    assert [bay["supply"]["granted"] for bay in whole["bays"] if bay["state"] == "CHARGING"] == [1, 1]
    first, *others = waiting["limits"]
    assert waiting["state"] == "SUSPENDED"
    assert (first["allowed_a"], first["binds"], first["cause"]["key"]) == (0.0, True, "supplies.hall.limit_w")
    assert first["text"] == waiting["supply"]["text"]
    assert first["text"].startswith("supply hall: 456 of 460 W are promised (<station>); waits for bay-")
    assert not any(one["binds"] for one in others)
    korean = in_language({**whole, "bays": [waiting]}, "ko")
    assert "460 W 중 456 W" in korean["bays"][0]["limits"][0]["text"]
    assert "460 W 중 456 W" in korean["supplies"][0]["text"]


def test_a_line_that_is_cut_counts_with_the_most_until_its_charger_is_seen_again() -> None:
    found: dict[str, object] = {}

    def note(on: World) -> None:
        feeds = on.supervisor._feeds
        found["cut"] = sorted(feed.held.granted for feed in feeds.feeds)
        found["promised"] = ledger.used_w(feeds.supplies, [feed.held for feed in feeds.feeds])[0]

    with metered(three(1600), 40.0) as (on, drawn, states):
        on.time.call_later(15.0, lambda: setattr(on.rigs[0].tty, "stalled", True))
        on.time.call_later(18.5, lambda: note(on))
        on.time.call_later(22.0, lambda: setattr(on.rigs[0].tty, "stalled", False))
        on.time.call_later(38.0, lambda: found.update(again=on.supervisor._feeds.feeds[0].held.known))
        assert on.run() == 0
    assert max(drawn) <= 1600
    assert found == {"cut": [0, 0, 1], "promised": 1177 + 213 + 30, "again": True}
    assert charged(states) == {0, 1, 2}


def test_a_failing_allocation_keeps_what_is_verified_and_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    levels: list[list[int]] = []
    faults: list[set[str]] = []

    def fails(*_: object) -> None:
        raise KeyError("hall")

    def note(on: World) -> None:
        levels.append([feed.held.granted for feed in on.supervisor._feeds.feeds])
        faults.append({fault.id for bay in on.bays if bay.decision for fault in bay.decision.faults})

    with metered(three(5000), 33.0) as (on, drawn, _):
        on.time.call_later(12.0, lambda: monkeypatch.setattr(supply_module, "allocate", fails))
        on.time.call_later(13.5, lambda: note(on))
        on.time.call_later(20.0, lambda: note(on))
        on.time.call_later(20.1, lambda: monkeypatch.setattr(supply_module, "allocate", allocate))
        on.time.call_later(32.0, lambda: note(on))
        assert on.run() == 0
        assert any("the supplies cannot be divided" in text for text in on.console.said)
    first, second, last = levels
    assert all(0 < after <= before for before, after in zip(first, second, strict=True))
    assert all(after > before for before, after in zip(second, last, strict=True))
    assert faults[0] == faults[1] == {"supply_failed"}
    assert "supply_failed" not in faults[2]
    assert max(drawn) <= 5000


# --- a feed by itself -------------------------------------------------------------------------------------------------


def feeds(the_station: Station, say: Callable[[object], None] = lambda _: None) -> Feeds:
    return Feeds.of(the_station, say)


def test_a_failure_lowers_to_what_is_verified(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[object] = []
    hall = feeds(three(), said.append)
    for feed, shown, known in zip(hall.feeds, (1, None, 4), (True, True, False), strict=True):
        feed.held, feed.shown, feed.told_s = Held(5, 2, known=known), shown, 1000.0
    monkeypatch.setattr(supply_module, "allocate", lambda *_: NOTHING["hall"])
    assert hall.turn(1000.0) == [1, 2, 0]  # the most lowered first
    assert hall.turn(1000.5) == []
    assert [feed.held.granted for feed in hall.feeds] == [1, 0, 0]
    assert said == [Cause.of("supply_failed", error="KeyError('hall')")]
    assert {(feed.why.id, feed.why.key) for feed in hall.feeds if feed.why} == {
        ("supply_failed", "supplies.hall.limit_w")
    }


def test_without_supplies_nothing_changes() -> None:
    none = feeds(replace(three(), supplies=None))
    snapshot = Snapshot()
    assert all(feed.into(snapshot) is snapshot for feed in none.feeds)
    assert none.turn(1000.0) == []
    assert none.status("en") == {}


def test_at_a_start_every_charger_counts_with_the_most() -> None:
    hall = feeds(replace(three(), supplies={"hall": SupplyConfig(limit_w=9000, bays=NAMES[:2])}))
    assert hall.turn(1000.0) == []
    (shown,) = cast("list[dict[str, Any]]", hall.status("en")["supplies"])
    assert (shown["name"], shown["limit_w"], shown["promised_w"], shown["waiting"]) == ("hall", 9000, 2 * 1177, [])
    assert shown["text"] == "supply hall: 2,354 of 9,000 W are promised"
    snapshot = hall.feeds[0].into(Snapshot())
    assert (snapshot.granted, snapshot.supply_problem) == (0, None)
    assert hall.feeds[2].into(Snapshot()).granted is None


def test_who_waits_is_on_the_page_in_the_readers_language() -> None:
    hall = feeds(three())
    hall.feeds[1].want = Want(5)
    document = {"language": "en", "bays": [], **hall.status("en")}
    assert page(document).splitlines()[-1] == "supply hall: 3,531 of 460 W are promised; waiting for it: bay-2"
    assert page(document, "ko").splitlines()[-1] == "전원 hall: 460 W 중 3,531 W 배정. 기다리는 베이: bay-2"


def test_a_bay_that_tells_nothing_any_more_is_not_in_hand() -> None:
    hall = feeds(three())
    feed = hall.feeds[0]
    feed.held, feed.told_s = replace(feed.held, counted=0, known=True), 1000.0
    hall.turn(1002.0)
    assert feed.held.known
    hall.turn(1003.5)
    assert not feed.held.known
    assert feed.held.counted == 5


def test_a_status_from_before_the_interlock_held_the_level_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supply_module, "monotonic", lambda: NOW_S)
    feed = feeds(three()).feeds[0]
    feed.held = replace(feed.held, granted=1, counted=5, known=True)
    edge = Edge(lambda _: None, None, charger={"current_step": 0, "current_a": 2.0}, bmu={"current_a": 2.0})

    def tells(reading_s: float, granted: int) -> int:
        f = replace(edge, charger={**edge.charger, "t_s": reading_s}, snapshot={"granted": granted}).facts
        feed.decided(NOW_S + 0.2, f.snapshot, f.memory, Decision(State.CHARGING, Cause("charging")), f.rules)
        return feed.held.counted

    assert tells(NOW_S, granted=3) == 5  # made before the level was lowered
    assert tells(NOW_S, granted=1) == 5  # hands the lower level to the interlock
    assert tells(NOW_S, granted=1) == 5  # a status that was requested before that
    assert tells(NOW_S + 0.001, granted=1) == 5  # that is rounded
    assert tells(NOW_S + 0.1, granted=1) == 5  # the first one
    assert tells(NOW_S + 0.1, granted=1) == 5  # the same one again
    assert tells(NOW_S + 0.3, granted=1) == 1


def test_it_is_divided_twice_a_second() -> None:
    hall = feeds(three())
    hall.turn(1000.0)
    hall.turn(1000.4)
    assert hall.last_s == 1000.0
    hall.turn(1000.5)
    assert hall.last_s == 1000.5
