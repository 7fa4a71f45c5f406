"""Who asks, and why, on the real command line: in the reason, the journal, over a restart, and after an estop."""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from orchestrator.service.asker import user_name
from tests.waiting import wait_until
from tests.whole.station import Document, Service, orchestrator, whole_station

ME = user_name(os.getuid())
#: Only root reports for whom it acts.
as_root = pytest.mark.skipif(os.getuid() != 0, reason="needs root")


@pytest.fixture(name="service", scope="module")
def _service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with whole_station(tmp_path_factory.mktemp("who"), 2) as (_, service):
        yield service.start()


def run(service: Service, *words: str, sudo_user: str = "", status: int = 0) -> str:
    environment = {"ORCHESTRATOR_SOCKET": str(service.socket), "LC_ALL": "C.UTF-8", "SUDO_USER": sudo_user}
    done = orchestrator(*words, env=environment)
    assert done.returncode == status, done
    return done.stdout + done.stderr


def records(service: Service, bay: str, request: str) -> list[Document]:
    return [one for one in service.journal(bay, "request") if one["request"] == request]


def written(service: Service, bay: str, request: str, count: int = 1) -> Document:
    wait_until(lambda: len(records(service, bay, request)) >= count, what=f"the record of {request}")
    return records(service, bay, request)[-1]


def test_a_stop_tells_who_and_why_before_and_after_a_restart(service: Service) -> None:
    service.wait("CHARGING")
    run(service, "stop", "bay-1", "--because", "wet\nfloor")
    reason = service.wait("HELD")["bay-1"]["reason"]
    assert re.fullmatch(rf"stopped by {ME} at \d\d:\d\d: wet floor; to go on: orchestrator start bay-1", reason)
    record = written(service, "bay-1", "stop")
    told: dict[str, Any] = {"by": ME, "because": "wet floor", "accepted": True, "answer": "", "uid": os.getuid()}
    assert {name: record[name] for name in told} == told
    refused = run(service, "pause", "bay-1", status=1)
    assert f"not running: stopped by {ME} at " in refused
    assert written(service, "bay-1", "pause")["accepted"] is False
    run(service, "start", "bay-9", status=1)
    nowhere = written(service, "", "start")
    assert (nowhere["bays"], nowhere["cause"]["id"]) == (["bay-9"], "bay_unknown")
    service.kill_all()
    service.start()
    assert service.wait("HELD")["bay-1"]["reason"] == reason


@as_root
def test_a_start_of_all_leaves_another_s_bay_alone(service: Service) -> None:
    run(service, "stop", "bay-1", "--because", "wet floor", sudo_user="kim")
    left = run(service, "start", "--all", sudo_user="lee", status=1)
    assert re.search(r"bay-1: left alone: .*stopped by root for kim at \d\d:\d\d: wet floor; if it may charge: ", left)
    service.wait("CHARGING", ["bay-2"])
    assert service.bay()["state"] == "HELD"
    run(service, "start", "bay-*", "--force", sudo_user="lee")
    service.wait("CHARGING")


def test_a_reload_answers_for_each_bay(service: Service, tmp_path: Path) -> None:
    assert run(service, "reload").count(" is unchanged\n") == 2
    service.edit(lambda document: document["bays"][1]["limits"].update(current_a=14.5))
    said = run(service, "reload", status=1)
    assert "bay-2: reload: the station file has changed here (limits.current_a 15 → 14.5): only a restart" in said
    service.edit(lambda document: document["bays"][1]["limits"].update(current_a=15.0))
    assert written(service, "bay-2", "reload", 2)["accepted"] is False


def test_an_estop_is_named_as_such(service: Service) -> None:
    service.ask("start")
    service.wait("CHARGING", ["bay-1", "bay-2"])
    assert "every charger stands by" in run(service, "estop", str(service.file), "--because", "smoke in hall 2")
    reasons = [bay["reason"] for bay in service.wait("HELD", ["bay-1", "bay-2"]).values()]
    said = re.compile(rf"stopped by estop \({ME}\) at \d\d:\d\d: smoke in hall 2; to go on: ")
    assert all(said.match(reason) for reason in reasons)
    assert written(service, "bay-2", "stop")["means"] == "estop"
