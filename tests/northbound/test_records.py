"""The record as the page reads it: charges, batteries and events of files as the service writes them."""

import gzip
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.record.lines import encoded
from orchestrator.record.utc import utc
from tests.northbound.bench import Browser, page
from tests.record.made import EVERY_S, WALL_S, end, id_of

HEAD = "elapsed_s,state,step,soc_pct,soh_pct,pack_v,pack_a,temperature_c,charger_v,charger_a,charger_ah\r\n"
POINTS = "0.0,CHARGING,5,20,97,48,14,20,48.2,14,0\r\n10.0,CHARGING,5,21,97,48.5,14,,48.7,14,0.04\r\n"


@pytest.fixture(name="browser", scope="module")
def _browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Three charges at two bays, the first with a curve, and two events."""
    directory = tmp_path_factory.mktemp("records")
    folder = directory / "journal" / "sessions"
    (folder / "curves").mkdir(parents=True)
    records = [end(1, 1, 10.0), end(2, 1, 20.0, bay="bay-2", battery="B/2"), end(3, 1, 30.0)]
    (folder / "2026-11.jsonl").write_bytes(b"".join(map(encoded, records)))
    (folder / "curves" / f"{id_of(1)}.csv.gz").write_bytes(gzip.compress((HEAD + POINTS).encode()))
    stopped = Cause.of("stopped_by", who="kim", asked_at="21:09", because="wet floor")
    events = [
        {"t": 1.0, "wall": utc(WALL_S), "bay": "", "kind": "run", "version": 5, "boot": "b", "run": "b/1.0/1"},
        {"t": 2.0, "wall": utc(WALL_S + 1), "bay": "bay-1", "kind": "transition", "from": "CHARGING", "to": "STOPPING",
         "reason": "-", "cause": plain(stopped)},
    ]  # fmt: skip
    lines = "".join(f"{json.dumps(event, separators=(',', ':'))}\n" for event in events)
    (directory / "journal" / "events.jsonl").write_text(lines, encoding="utf-8")
    with page(directory, controller=False) as (browser, _):
        yield browser


def listed(browser: Browser, query: str = "") -> list[str]:
    return [one["id"] for one in browser.get(f"/api/sessions{query}").json["sessions"]]


def test_charges_are_listed_newest_first_and_by_pages(browser: Browser) -> None:
    assert listed(browser) == [id_of(3), id_of(2), id_of(1)]
    assert listed(browser, "?limit=1") == [id_of(3)]
    assert listed(browser, f"?limit=1&before={id_of(3)}") == [id_of(2)]
    assert listed(browser, "?bay=bay-1") == [id_of(3), id_of(1)]
    assert listed(browser, "?battery=B%2F2") == [id_of(2)]
    assert listed(browser, f"?since={WALL_S + 2 * EVERY_S}") == [id_of(3), id_of(2)]
    assert listed(browser, f"?until={WALL_S + 3 * EVERY_S}&bay=") == [id_of(2), id_of(1)]


@pytest.mark.parametrize("query", ["limit=-1", "limit=501", "limit=x", "since=yesterday", "until=1e9", "bay=a%0Ab"])
def test_what_cannot_be_asked_is_said(browser: Browser, query: str) -> None:
    answer = browser.get(f"/api/sessions?{query}")
    assert (answer.status, answer.error) == (400, "field_wrong")


def test_a_charge_has_its_curve_and_its_sentences(browser: Browser) -> None:
    found = browser.get(f"/api/sessions/{id_of(1)}?language=ko").json
    assert found["session"]["id"] == id_of(1)
    assert "100 %" in found["session"]["result_text"]
    first, second = found["points"]
    assert (first["elapsed_s"], first["state"], first["pack_v"], first["temperature_c"]) == (0.0, "CHARGING", 48.0, 20)
    assert "temperature_c" not in second, "nobody knew it"
    assert any("depot" in line for line in found["lines"])
    assert browser.get(f"/api/sessions/{id_of(3)}").json["points"] == []
    assert (browser.get("/api/sessions/ZZZ").status, browser.get("/api/sessions/ZZZ").error) == (404, "charge_unknown")


def test_the_list_is_a_spreadsheet(browser: Browser) -> None:
    answer = browser.get("/api/sessions.csv?bay=bay-1")
    assert answer.headers["Content-Type"] == "text/csv; charset=utf-8"
    head, *rows = answer.body.decode("utf-8-sig").splitlines()
    assert head.startswith("id,station,bay,battery")
    assert [row.partition(",")[0] for row in rows] == [id_of(3), id_of(1)]


def test_each_battery_has_a_life(browser: Browser) -> None:
    found = {one["id"]: one for one in browser.get("/api/batteries").json["batteries"]}
    assert found["B-1"]["charges"] == 2
    assert found["B-1"]["last_unix_s"] == WALL_S + 3 * EVERY_S
    life = browser.get("/api/batteries/B%2F2").json
    assert (life["battery"], [one["id"] for one in life["sessions"]]) == ("B/2", [id_of(2)])
    assert life["lines"]
    assert browser.get("/api/batteries/B-9").error == "battery_unknown"


def test_what_happened_is_told_in_sentences(browser: Browser) -> None:
    (event,) = browser.get("/api/events?bay=bay-1").json["events"]
    assert event["text"] == "CHARGING → STOPPING: stopped by kim at 21:09: wet floor"
    assert event["unix_s"] == WALL_S + 1
    assert browser.get("/api/events?bay=bay-7").json["events"] == []
    assert browser.get("/api/events").error == "field_wrong"


def test_records_that_are_not_there_are_none(tmp_path: Path) -> None:
    with page(tmp_path, controller=False) as (browser, _):
        assert browser.get("/api/sessions").json == {"sessions": []}
        assert browser.get("/api/batteries").json == {"batteries": []}
        events = browser.get("/api/events?bay=bay-1")
        assert (events.status, events.error) == (503, "no_journal")
