"""One bay looked at closely, as the page's view of it does."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from orchestrator.errors import RequestError
from orchestrator.model import Cause
from tests.northbound import bench

LIMIT = {"allowed_a": 2.0, "binds": True, "cause": {**bench.HOT, "advice": ""}, "text": "it is hot"}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """The bays that the service was asked about, one by one. It knows `bay-1`."""
    found: list[object] = []

    def answer(self: bench.Controller, request: Mapping[str, object]) -> Mapping[str, object]:
        if (name := request.get("bay")) is None:
            return self.document
        found.append(name)
        if name != "bay-1":
            raise RequestError(Cause.of("bay_unknown", bay=name, bays=("bay-1",)))
        return {**self.document, "bays": [{**bench.bay("bay-1"), "limits": [LIMIT]}]}

    monkeypatch.setattr(bench.Controller, "_answer", answer)
    return found


@pytest.fixture
def browser(tmp_path: Path, asked: list[object]) -> Iterator[bench.Browser]:
    with bench.page(tmp_path) as (found, _):
        yield found


def test_it_has_its_limits_in_the_readers_language(browser: bench.Browser) -> None:
    bay: dict[str, Any] = browser.get("/api/bay?bay=bay-1&language=ko").json
    (limit,) = bay["limits"]
    assert (bay["name"], limit["allowed_a"], limit["binds"]) == ("bay-1", 2.0, True)
    assert "상한은 45 °C" in limit["text"]


def test_however_many_look_the_service_is_asked_once_a_second(browser: bench.Browser, asked: list[object]) -> None:
    answers = [browser.get("/api/bay?bay=bay-1") for _ in range(5)]
    assert {one.status for one in answers} == {200}
    assert asked == ["bay-1"]


def test_a_bay_that_is_not_there_is_told_so(browser: bench.Browser) -> None:
    assert (browser.get("/api/bay?bay=bay-7").status, browser.get("/api/bay").status) == (404, 400)


def test_without_the_service_nothing_is_told(tmp_path: Path, asked: list[object]) -> None:
    with bench.page(tmp_path, controller=False) as (browser, _):
        answer = browser.get("/api/bay?bay=bay-1")
    assert (answer.status, answer.error) == (503, "no_journal")
