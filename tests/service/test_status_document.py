"""Every status document fits the published schema, and the schema knows every name in it."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator

from orchestrator.cli import main
from orchestrator.config.load import load_station
from orchestrator.config.shipped import shipped_dir
from orchestrator.config.station import ContactorConfig
from orchestrator.model import Alarm, Cause, Request, State
from orchestrator.model.bay_document import Stray
from orchestrator.model.document_schema import status_schema
from orchestrator.service.asked import Asked
from orchestrator.service.asker import Asker
from orchestrator.service.contactor import Contactor
from orchestrator.service.status import station_status
from orchestrator.text.catalogue import as_told
from tests.service.bench import Bench, the_bay

KIM = Asker(0, "kim", "wet floor", "page, kim")


def strict(schema: Any) -> Any:
    """The schema, which now refuses names that it does not know."""
    if isinstance(schema, list):
        return [strict(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    more = {"additionalProperties": False} if "properties" in schema else {}
    return {**{name: strict(part) for name, part in schema.items()}, **more}


SCHEMA = Draft7Validator(strict(status_schema()))


class Line:
    """A contactor's output that works."""

    def drive(self, *, closed: bool) -> None:
        """It does."""

    def close(self) -> None:
        """It may."""


def unheard(bench: Bench) -> None:
    """Nothing is decided yet."""


def charging(bench: Bench) -> None:
    bench.charging()


def precharging(bench: Bench) -> None:
    bench.battery.values["voltage_v"], bench.battery.values["soc_pct"] = 34.0, 0.0
    bench.charger.reading = replace(bench.charger.reading, voltage_v=34.0)
    bench.until(State.PRECHARGE_PULSE)
    bench.step(5)


def held(bench: Bench) -> None:
    bench.charging()
    bench.bay.ask(Asked(Request.STOP, KIM))
    bench.until(State.HELD)


def tripped(bench: Bench) -> None:
    bench.charging()
    bench.battery.values["temperature_c"] = 75.0
    bench.until(State.TRIPPED)
    bench.battery.values["temperature_c"] = 20.0
    bench.step(30)


def uncontrollable(bench: Bench) -> None:
    bench.charging()
    bench.charger.deaf = True
    bench.bay.ask(Asked(Request.STOP, KIM))
    bench.until(State.UNCONTROLLABLE)


def silent(bench: Bench) -> None:
    bench.charging()
    bench.charger.link = replace(bench.charger.link, online=False, problem=Cause.of("port_silent", misses=5))
    bench.step(20)


def waiting(bench: Bench) -> None:
    """For a start with a target of its own."""
    held(bench)
    bench.bay.ask(Asked(Request.START, KIM, target_pct=80.0, start_unix_s=time.time() + 3600))
    bench.step(3)


def targeted(bench: Bench) -> None:
    held(bench)
    bench.bay.ask(Asked(Request.START, KIM, target_pct=80.0))
    bench.charging()


def named(bench: Bench) -> None:
    bench.charging()
    bench.bay.identified.name("pack-7")
    bench.step(3)


def broken(bench: Bench) -> None:
    """A defect of our own."""
    bench.charging()
    vars(bench.bay)["_look"] = lambda *_: [].pop()
    bench.step()


@pytest.fixture(name="bench", params=[False, True], ids=["plain", "contactor"])
def _bench(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    fitted = ContactorConfig(chip="/dev/gpiochip0", line=17)
    bay = replace(the_bay(), contactor=fitted) if request.param else the_bay()
    yield Bench(tmp_path, bay=bay, contactor=Contactor(Line) if request.param else None)


STORIES: tuple[Callable[[Bench], None], ...] = (
    unheard, charging, precharging, held, tripped, uncontrollable, silent, waiting, targeted, named, broken,
)  # fmt: skip


@pytest.mark.parametrize("story", STORIES, ids=lambda story: story.__name__)
def test_what_a_bay_tells_fits_the_schema(bench: Bench, story: Callable[[Bench], None]) -> None:
    story(bench)
    station = load_station(shipped_dir() / Path("configs/stations/one-bay.yaml"))
    trouble = Cause.of("journal_dead")
    stray: Stray = {
        "bay": "bay-9", "port": "/dev/x", "state": "HELD", "verified": True, "problem": "", "cause": as_told(trouble),
    }  # fmt: skip
    for closely in (False, True):
        bays = [bench.bay.status(closely=closely)]
        status = station_status(station, Alarm.DANGER, bays, trouble, None, [stray], 1.8e9)
        found = [f"{error.json_path}: {error.message}" for error in SCHEMA.iter_errors(json.loads(json.dumps(status)))]
        assert found == []


def test_the_stories_reach_what_may_be_null(tmp_path: Path) -> None:
    seen: dict[str, object] = {}
    for number, story in enumerate(STORIES):
        (tmp_path / str(number)).mkdir()
        bench = Bench(tmp_path / str(number))
        story(bench)
        status = bench.bay.status(closely=True)
        seen |= {name: value for name, value in status.items() if value not in (None, [], "")}
    assert {"session", "faults", "timed_start", "target", "limits", "forecast", "step_cause", "since"} <= seen.keys()


def test_the_schema_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "status"]) == 0
    schema = json.loads(capsys.readouterr().out)
    Draft7Validator.check_schema(schema)
    assert schema == status_schema()
    wrong = {"version": 1, "bays": [{"state": "FLYING"}]}
    assert len(list(Draft7Validator(schema).iter_errors(wrong))) > 10
