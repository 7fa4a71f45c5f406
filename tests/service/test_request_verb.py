"""Requests from the command line to services that do not do as the present one does."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.errors import RequestError
from orchestrator.model import Cause
from orchestrator.service.reception import Answer
from tests.service.control_bench import listening
from tests.service.test_show import STOPPED

LONG = [f"{'베이' * 30}-{number}" for number in range(128)]


class OfYesterday:
    """A service not restarted since an update: it refuses a request in which it does not know every name."""

    def __init__(self, *known: str, fails_for: str = "") -> None:
        self.known, self.fails_for = known, fails_for
        self.stopped: list[str] = []

    def __call__(self, request: Mapping[str, object]) -> Answer:
        if request["verb"] == "status":
            bays = [{**STOPPED, "name": name} for name in self.known]
            return {"language": "en", "bays": bays, "strays": []}
        names = request["bays"]
        assert isinstance(names, list)
        for name in names:
            if name not in self.known:
                raise RequestError(Cause.of("bay_unknown", bay=name, bays=self.known))
        if self.fails_for in names:
            raise RequestError(Cause("too_many_requests"))
        self.stopped += names
        return {"language": "en", "results": dict.fromkeys(names, ""), "causes": {}}


def run(tmp_path: Path, service: OfYesterday, *words: str) -> int:
    path = tmp_path / "control.sock"
    with listening(path, service):
        return main([*words, "--socket", str(path)])


@pytest.fixture(autouse=True)
def _english(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LC_ALL", "C.UTF-8")


def test_a_service_of_yesterday_stops_what_it_knows_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    service = OfYesterday("bay-1", "bay-2")
    assert run(tmp_path, service, "stop", "bay-2", "bay-9") == 1
    assert service.stopped == ["bay-2"]
    said = capsys.readouterr()
    assert said.out == "bay-2: stop accepted; stands by, verified\n"
    assert said.err == "no bay 'bay-9' here: bay-1, bay-2\n"


def test_what_it_does_not_know_at_all_stops_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    service = OfYesterday("bay-1", "bay-2")
    assert run(tmp_path, service, "stop", "bay-9") == 1
    assert service.stopped == []
    assert (
        capsys.readouterr().err == "orchestrator: no bay 'bay-9' here: bay-1, bay-2; stop was carried out at no bay\n"
    )
    assert run(tmp_path, service, "start", "bay-1", "bay-9") == 1
    assert service.stopped == []


def test_more_names_than_fit_into_a_request_are_several(tmp_path: Path) -> None:
    service = OfYesterday(*LONG)
    assert run(tmp_path, service, "stop", "베이*") == 0
    assert service.stopped == LONG
    again = OfYesterday(*LONG)
    assert run(tmp_path, again, "start", *LONG) == 0
    assert again.stopped == LONG


def test_a_request_that_is_refused_leaves_no_later_stop_undone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    service = OfYesterday(*LONG, fails_for=LONG[0])
    assert run(tmp_path, service, "stop", "*") == 1
    assert LONG[-1] in service.stopped and LONG[0] not in service.stopped
    assert capsys.readouterr().err == "orchestrator: too many requests at once: ask again\n"
    other = OfYesterday(*LONG, fails_for=LONG[0])
    assert run(tmp_path, other, "start", "*") == 1
    assert other.stopped == []
