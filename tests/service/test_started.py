"""A start of a bay that will not charge says why, and what to type."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.model import Request, State
from orchestrator.model.cause import plain
from orchestrator.service import started
from orchestrator.service.asked import Asked
from orchestrator.service.reception import Answer
from orchestrator.service.started import not_charging, with_hint
from orchestrator.text.catalogue import say
from tests.core.said import cause
from tests.service.bench import Bench
from tests.service.control_bench import listening
from tests.service.test_show import STOPPED

TYPE = "to charge it once all the same: orchestrator start bay-1 --to 100"


@pytest.fixture(name="bench")
def _bench(tmp_path: Path) -> Bench:
    bench = Bench(tmp_path)
    bench.battery.values["soc_pct"] = 99.0
    bench.until(State.IDLE)
    bench.step(3)
    return bench


def test_at_99_percent_there_is_nothing_to_do(bench: Bench) -> None:
    asked = Asked(Request.START)
    bench.bay.ask(asked)
    bench.step()
    assert asked.answer is not None
    why = json.loads(json.dumps(plain(asked.answer)))
    refused = cause("refused").with_(bay="bay-1", why=asked.answer)
    said = say(with_hint(asked.answer, why))
    assert said.startswith("nothing to start: IDLE: SOC 99 % is not below 98 % (policies/li-ion-48v.yaml:26); ")
    assert said.endswith(" %; to charge it once all the same: orchestrator start BAY --to 100")
    assert say(with_hint(refused, why)).endswith(f"it charges by itself below 98 %; {TYPE}")
    assert say(with_hint(refused, why), "ko").endswith("그래도 한 번 충전하려면: orchestrator start bay-1 --to 100")


def test_a_full_one_is_charged_again_later(bench: Bench) -> None:
    bench.battery.values["soc_pct"] = 50.0
    bench.charging()
    bench.battery.values["soc_pct"] = 100.0
    bench.until(State.FULL)
    bench.step(3)
    said = say(with_hint(cause("x"), json.loads(json.dumps(bench.bay.status()["cause"]))))
    assert said == "x; nothing to do: it charges again by itself below 95 %"


@pytest.mark.parametrize("why", [None, "x", {}, {"id": "soc_not_below"}, {"id": "several", "params": {"whats": [1]}}])
def test_any_other_reason_stays_as_it_is(why: object) -> None:
    assert with_hint(cause("x"), why) == cause("x")


class Service:
    """Accepts a start; its bay is then in these states, one after another."""

    def __init__(self, *states: str) -> None:
        self.states: Iterator[str] = iter(states)
        self.state = ""

    def __call__(self, request: Mapping[str, object]) -> Answer:
        if request["verb"] == "start":
            return {"language": "en", "results": {"bay-1": ""}, "causes": {}}
        self.state = next(self.states, self.state)
        reason = {"reason": "it is as it is", "cause": plain(cause("it is as it is"))}
        return {"language": "en", "bays": [{**STOPPED, "name": "bay-1", "state": self.state, **reason}], "strays": []}


@pytest.mark.parametrize(
    ("states", "more"),
    [
        (("HELD", "IDLE", "QUALIFYING"), ""),
        (("HELD", "OFFLINE"), "bay-1: does not charge: OFFLINE: it is as it is\n"),
    ],
)
def test_an_accepted_start_is_watched_until_it_is_decided(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    states: tuple[str, ...],
    more: str,
) -> None:
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    monkeypatch.setattr(started, "DECIDED_S", 0.3)
    path = tmp_path / "control.sock"
    with listening(path, Service(*states)):
        assert main(["start", "bay-1", "--socket", str(path)]) == 0
    assert capsys.readouterr().out == f"bay-1: start accepted\n{more}"


def test_a_service_that_has_gone_is_not_asked_twice(tmp_path: Path) -> None:
    assert not_charging(tmp_path / "control.sock", ["bay-1"], "en") == []
