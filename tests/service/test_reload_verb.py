"""`orchestrator reload`: each bay's answer, from the files to the command line."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import pytest

from orchestrator.cli import main
from orchestrator.config.load import load_station
from orchestrator.model import Request
from orchestrator.service import request_handler
from orchestrator.service.reception import Answer
from orchestrator.service.request_handler import RequestHandler
from orchestrator.service.station_status import StationStatus
from orchestrator.service.strays import Strays
from orchestrator.service.supply import Feeds
from tests.service.bench import fields_of
from tests.service.control_bench import listening
from tests.service.test_reload import Site

ASK = {"verb": "reload", "uid": 0, "sudo_user": "kim", "because": "new packs"}


class Asking:
    """A handler for the bay of a site; `ask` runs the bay until there is an answer."""

    def __init__(self, site: Site) -> None:
        self.site, bench = site, site.bench
        site.reload.start()
        station = load_station(site.station_file)
        strays = cast("Strays", None)
        feeds = Feeds.of(station, lambda _: None)
        shown = StationStatus(
            station, [bench.bay], bench.journal, bench.store, strays, feeds, lambda: bench.now_s, lambda: 1.8e9
        )
        self.handler = RequestHandler(
            shown, [bench.bay], bench.journal, bench.store, strays, site.reload,
            lambda: bench.now_s, lambda: 1.8e9, lambda _: None,
        )  # fmt: skip

    def ask(self, request: Mapping[str, object] = ASK) -> dict[str, Any]:
        later = cast("Callable[[], Any]", self.handler.answer(request))
        while (answer := later()) is None:
            self.site.bench.step()
            self.site.bench.bay.status()
            self.site.pause()
        return dict(answer)

    def records(self) -> list[Mapping[str, object]]:
        waiting = self.site.bench.journal._waiting[False]
        return [{**fields_of(line), "bay": bay} for _, _, bay, line in waiting if line[0] == "request"]


@pytest.fixture(name="asking")
def _asking(tmp_path: Path) -> Asking:
    site = Site(tmp_path)
    site.bench.charging()
    return Asking(site)


def test_a_bay_that_charges_waits_and_one_at_rest_has_it(asking: Asking) -> None:
    asking.site.edit_finish(read=False)
    waits = asking.ask()
    assert waits["results"] == {"bay-1": ""}
    assert waits["notes"]["bay-1"].endswith(": finish.target_soc_pct 100 → 99; comes into force when the bay stands by")
    assert waits["note_causes"]["bay-1"]["id"] == "policy_offered"
    asking.site.bench.ask(Request.PAUSE)
    asking.site.bench.step(20)
    assert asking.ask()["notes"]["bay-1"].endswith(" is unchanged")
    asking.site.edit(asking.site.policy_file, "target_soc_pct: 99 ", "target_soc_pct: 100 ", read=False)
    assert asking.ask()["notes"]["bay-1"].endswith(": finish.target_soc_pct 99 → 100; in force")
    first, *_ = asking.records()
    assert (first["bay"], first["request"], first["by"], first["because"]) == (
        "bay-1", "reload", "root for kim", "new packs",
    )  # fmt: skip
    assert first["accepted"] is True and str(first["note"]).endswith("when the bay stands by")


def test_what_needs_a_restart_is_refused_for_that_bay(asking: Asking) -> None:
    asking.site.edit(asking.site.station_file, "current_a: 15.0", "current_a: 8.0", read=False)
    answer = asking.ask()
    assert answer["results"]["bay-1"].startswith("the station file has changed here (limits.current_a 15 → 8): ")
    assert answer["causes"]["bay-1"]["id"] == "needs_restart"
    assert [one["accepted"] for one in asking.records()] == [False]


def test_a_file_with_an_error_is_refused_as_a_whole(asking: Asking) -> None:
    asking.site.edit(asking.site.policy_file, "target_soc_pct: 100 ", "target_soc_pct: 101 ", read=False)
    answer = asking.ask()
    assert answer["ok"] is False and "mine.yaml:" in answer["error"]
    assert answer["error"].endswith("reload refused, every policy stays as it is")
    (record,) = asking.records()
    assert (record["bay"], record["accepted"]) == ("", False)


def test_a_disk_that_hangs_is_no_answer(asking: Asking, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request_handler, "READ_S", 0.5)
    monkeypatch.setattr(asking.site.reload, "_taken", lambda: ())
    answer = asking.ask()
    assert answer["error"] == "the files have not been read within 0.5 s; the service's log will tell the result"


@pytest.mark.parametrize(
    ("language", "out", "err"),
    [
        (
            "C.UTF-8",
            "bay-1: reload: as it was\n",
            "bay-2: reload: the station file has changed here (this bay is new in it): ",
        ),
        (
            "ko_KR.UTF-8",
            "bay-1: 다시 읽기: as it was\n",
            "bay-2: 다시 읽기: 스테이션 파일이 바뀌었습니다(이 베이가 추가됨): ",
        ),
    ],
)
def test_the_command_line_says_it_bay_by_bay(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    language: str,
    out: str,
    err: str,
) -> None:
    monkeypatch.setenv("LC_ALL", language)
    new = {"id": "needs_restart", "params": {"changes": [{"id": "bay_new", "params": {}}]}}
    refused = {"results": {"bay-1": "", "bay-2": "?"}, "causes": {"bay-2": new}}
    notes = {"notes": {"bay-1": "as it was", "bay-2": "?"}, "note_causes": {"bay-2": new}}
    answers: Iterator[Answer] = iter(
        [{"language": "en", **refused, **notes}, {"language": "en", "results": {"bay-1": ""}, "causes": {}}]
    )
    path = tmp_path / "control.sock"
    with listening(path, lambda _: next(answers)):
        assert main(["reload", "--socket", str(path), "--because", "x"]) == 1
        told = capsys.readouterr()
        assert told.out == out and told.err.startswith(err)
        assert main(["reload", "--socket", str(path)]) == 0
