"""A whole station with a contactor: without its chip nothing charges, without the library nothing starts."""

import json
import os
import signal
import socket
import sys
from pathlib import Path

import pytest

from orchestrator.service import controller
from tests.sim.wires import udp_keys
from tests.whole.station import Document, station_document, whole_station


def on_no_chip(document: Document) -> None:
    document["bays"][1]["contactor"] = {"chip": "./gpiochip9", "line": 17}


def test_without_its_chip_a_bay_does_not_charge_and_says_why(tmp_path: Path) -> None:
    with whole_station(tmp_path, 2, "--soc", "50", change=on_no_chip) as (plant, service):
        service.start()
        service.wait("CHARGING", ["bay-1"])
        bay = service.bay("bay-2")
        assert bay["contactor"]["closed"] is False
        assert "gpiochip9 line 17: no such GPIO chip: check the name in the station file" in bay["contactor"]["problem"]
        assert [fault["id"] for fault in bay["faults"]] == ["contactor_lost"]
        assert bay["faults"][0]["text"].startswith(bay["contactor"]["problem"])
        assert service.bay("bay-1")["contactor"] is None
        assert plant.state(2)["current_a"] == 0
        service.signal(signal.SIGTERM)
        assert service.ended() == 0
    lines = [json.loads(line) for line in (tmp_path / "run/journal/events.jsonl").read_text().splitlines()]
    told = [line for line in lines if line["kind"] == "contactor"]
    assert {(line["bay"], line["closed"]) for line in told} == {("bay-2", False)}
    assert bay["contactor"]["problem"] in {line["problem"] for line in told}


def test_without_the_library_it_is_said_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    document = station_document(tmp_path, [udp_keys()], 2)
    on_no_chip(document)
    file = tmp_path / "station.yaml"
    file.write_text(json.dumps(document), encoding="utf-8")
    monkeypatch.setitem(sys.modules, "gpiod", None)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours:
        assert controller.main(os.dup(theirs.fileno()), str(file)) == 1
    theirs.close()
    assert capsys.readouterr().err == (
        "orchestrator: the station file names a contactor, which needs the package gpiod: "
        f"{sys.executable} -m pip install 'gpiod<3,>=2.2'\n"
    )
