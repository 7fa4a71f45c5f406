"""How the service starts and ends: signals, sudden death, chargers found running, unusable files."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.sim.client import PlantProcess
from tests.waiting import wait_until
from tests.whole.recipe import Station, only_started
from tests.whole.station import Document, Service, die_with_parent, orchestrator, station_document, unnamed


def charging(plant: PlantProcess, service: Service) -> None:
    service.wait("CHARGING")
    wait_until(lambda: plant.state()["current_a"] > 13, 10, "the current")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_stops_the_chargers_and_ends_well(station: Station, number: signal.Signals) -> None:
    plant, service = station
    service.signal(number)
    assert service.ended() == 0
    truth = plant.state()
    assert (truth["operation"], truth["current_a"], truth["run"]) == (0, 0, False)
    assert service.log().splitlines()[-1] == "ended: every charger stands by, verified"
    assert not service.socket.exists()
    assert service.path_of("bay-1")[-3:] == ["CHARGING", "STOPPING", "SUSPENDED"]
    assert service.journal("bay-1", "session")[-1]["event"] == "begin", "the charge goes on with the next run"


def test_a_charger_that_does_not_stop_makes_the_end_a_bad_one(station: Station) -> None:
    plant, service = station
    plant.inject("ignore_stop")
    service.signal(signal.SIGTERM)
    assert service.ended() == 1
    assert service.log().splitlines()[-1] == "ended: NOT verified: bay-1"
    assert plant.state()["stops"] > 5  # it kept trying, every 500 ms


def test_a_charger_that_was_left_running_is_stopped_first_and_held(station: Station) -> None:
    plant, service = station
    wait_until(lambda: kept(service)["running"], what="what is kept")
    service.kill_all()
    assert plant.state()["operation"] == 1  # nobody stopped it: chargers keep running
    plant.inject("heal")  # wait again for the first byte
    service.start()
    wait_until(lambda: plant.state()["operation"] == 0, what="the stop")
    truth = plant.state()
    assert truth["first_stop_s"] == truth["first_byte_s"]
    held(plant, service)
    assert service.ask("start", "bay-1") == {"bay-1": ""}
    charging(plant, service)


def test_a_controller_that_died_is_not_started_into_a_charge(station: Station) -> None:
    plant, service = station
    wait_until(lambda: kept(service)["running"], what="what is kept")
    service.kill_controller()
    assert service.ended() != 0
    assert plant.state()["operation"] == 0
    service.start()
    held(plant, service)


def held(plant: PlantProcess, service: Service) -> None:
    bay = service.wait("HELD")["bay-1"]
    assert [fault["id"] for fault in bay["faults"]] == ["found_running"]
    assert "this service began again after its last run had ended in mid-charge" in bay["reason"]
    assert plant.state()["operation"] == 0


def kept(service: Service) -> Document:
    path = service.directory / "run" / "journal" / "persisted.json"
    document: Document = json.loads(path.read_text(encoding="utf-8"))
    (entry,) = [one for one in document["entries"] if one["bay"] == "bay-1"]
    record: Document = entry
    return record


@pytest.mark.station(3)
def test_a_restart_is_neither_a_reset_nor_a_start(station: Station) -> None:
    plant, service = station
    plant.inject("status_bits", 1)
    service.ask("stop", "bay-2")
    service.wait("TRIPPED", ["bay-1"])
    service.wait("HELD", ["bay-2"])
    plant.inject("heal", 1)
    service.signal(signal.SIGTERM)
    assert service.ended() == 0
    service.start().wait("TRIPPED", ["bay-1"])
    bay = service.bay("bay-1")
    assert "the BMU reported bmu error" in bay["reason"], "its cause is gone, the trip is not"
    reason = service.wait("HELD", ["bay-2"])["bay-2"]["reason"]
    assert unnamed(reason) == "stopped by the operator; to go on: orchestrator start bay-2"
    service.wait("CHARGING", ["bay-3"])  # its stop came from the service
    wait_until(lambda: not service.ask("reset", "bay-1")["bay-1"], what="a reset that is accepted")
    service.ask("start", "bay-1", "bay-2")
    service.wait("CHARGING", ["bay-1", "bay-2"])


def automatic(document: Document) -> None:
    document["bays"][0]["charger"]["control"] = "automatic"


@pytest.mark.station(plant_args=("--automatic", "--temperature", "40"), change=automatic)
def test_a_charger_in_automatic_mode_is_stopped_and_resumed(station: Station) -> None:
    plant, service = station
    assert service.bay()["reason"] == "the charger charges by itself (automatic mode)"
    assert service.cli("pause", "bay-1").returncode == 0
    service.wait("SUSPENDED")
    assert plant.state()["operation"] == 0
    service.ask("start", "bay-1")
    charging(plant, service)
    plant.inject("over_temperature")
    service.wait("SUSPENDED")
    assert (plant.state()["operation"], plant.state()["orders"]) == (0, 0)
    service.signal(signal.SIGTERM)
    assert service.ended() == 0
    assert plant.state()["operation"] == 0


@pytest.mark.station(ready=only_started)
def test_who_watches_goes_on_when_the_service_is_started_anew(station: Station) -> None:
    _, service = station
    argv = [sys.executable, "-m", "orchestrator", "status", "--watch", "--json", "--socket", str(service.socket)]
    said = (service.directory / "watch.txt").open("w+")
    with said, subprocess.Popen(argv, stdout=said, stderr=subprocess.STDOUT, preexec_fn=die_with_parent) as watch:
        file = service.directory / "watch.txt"
        wait_until(lambda: '"station"' in file.read_text(), 10, "the first status")
        service.signal(signal.SIGTERM)
        service.ended()
        wait_until(lambda: "orchestrator: no answer since " in file.read_text(), 10, "the loss")
        service.start()
        wait_until(lambda: "the service answers again\n" in file.read_text(), 10, "the return")
        watch.send_signal(signal.SIGINT)
        assert watch.wait(10) == 130


def broken_document(directory: Path) -> Document:
    document = station_document(directory, [{"interface": "virtual", "channel": "none"}], 1)
    document["bays"][0]["limits"]["voltage_v"] = 1000
    document["bays"][0]["battery"]["node_id"] = 0
    return document


def test_a_station_file_with_errors_does_not_run(tmp_path: Path) -> None:
    service = Service(tmp_path, broken_document(tmp_path))
    done = orchestrator("run", str(service.file))
    assert (done.returncode, done.stdout) == (1, "")
    findings = done.stderr.splitlines()
    assert len(findings) == 2
    assert all(finding.startswith(f"{service.file}:") and ": error: bays[0]." in finding for finding in findings)
    assert not (tmp_path / "run").exists()


def test_a_policy_with_errors_does_not_run(tmp_path: Path) -> None:
    policy = tmp_path / "mine.yaml"
    policy.write_text("policy: mine\npack: {cells_in_series: 13}\n", encoding="utf-8")
    document = station_document(tmp_path, [{"interface": "virtual", "channel": "none"}], 1)
    document["bays"][0]["policy"] = "./mine.yaml"
    done = orchestrator("run", str(Service(tmp_path, document).file))
    assert done.returncode == 1
    assert "mine.yaml:" in done.stderr
    assert "error: " in done.stderr


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    done = orchestrator("run", str(tmp_path / "none.yaml"))
    assert done.returncode == 1
    assert "none.yaml" in done.stderr
