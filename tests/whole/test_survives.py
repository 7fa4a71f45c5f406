"""What must survive a restart, with real processes: full disks, stopped readers, edited files."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import pytest

from orchestrator.errors import ServiceError
from orchestrator.sim.client import PlantProcess
from tests.waiting import wait_until
from tests.whole.recipe import Station, charge, only_started, only_the_plant
from tests.whole.station import RUN, Document, Service, unnamed

HELD = "stopped by the operator; to go on: orchestrator start bay-1"
#: Each test begins with two bays that charge.
pytestmark = pytest.mark.station(2)


def on_a_worn_disk(call: str) -> tuple[str, ...]:
    return ("-m", "tests.whole.worn", call)


def killed_in_mid_charge(plant: PlantProcess, service: Service) -> None:
    charge(plant, service)
    service.kill_all()


def charging(plant: PlantProcess, service: Service, *bays: int) -> None:
    service.wait("CHARGING", [f"bay-{bay}" for bay in bays])
    wait_until(lambda: all(plant.state(bay)["current_a"] > 13 for bay in bays), 10, "the current")


def kept(service: Service) -> dict[str, Document]:
    path = service.directory / "run" / "journal" / "persisted.json"
    document: Document = json.loads(path.read_text(encoding="utf-8"))
    return {entry["bay"]: entry for entry in document["entries"]}


def without(name: str) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        document["bays"] = [bay for bay in document["bays"] if bay["name"] != name]

    return change


@contextmanager
def running_on(service: Service, run: Sequence[str] = RUN) -> Iterator[Service]:
    """The same station, with another disk."""
    other = Service(service.directory, json.loads(service.file.read_text(encoding="utf-8")), run)
    try:
        yield other
    finally:
        other.close()


def test_an_accepted_stop_outlives_a_kill_right_after_it(station: Station) -> None:
    plant, service = station
    assert service.ask("stop", "bay-1") == {"bay-1": ""}
    service.kill_all()
    assert kept(service)["bay-1"]["hold"]["id"] == "stopped_by"
    service.start()
    assert ": orchestrator start bay-1" in service.wait("HELD")["bay-1"]["reason"]
    assert plant.state(1)["operation"] == 0
    assert kept(service)["bay-1"]["hold"]["id"] == "stopped_by"


def test_a_stop_while_the_service_ends_is_kept(station: Station) -> None:
    """systemctl restart, with an operator's stop in the same second."""
    plant, service = station
    service.signal(signal.SIGTERM)
    try:
        accepted = service.ask("stop", "bay-1") == {"bay-1": ""}
    except ServiceError:
        accepted = False  # too late: nobody was told it was accepted
    assert service.ended() == 0
    service.start()
    if accepted:
        assert unnamed(service.wait("HELD")["bay-1"]["reason"]) == HELD
    charging(plant, service, 2)


@pytest.mark.station(2, ready=only_the_plant)
def test_a_reader_that_stands_still_delays_neither_the_stop_nor_what_is_kept(station: Station) -> None:
    """Ctrl-S on the terminal, or a hanging log collector: the pipe is full before the service writes anything."""
    plant, service = station
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    try:
        while True:
            os.write(writer, b"x" * 4096)
    except BlockingIOError:
        os.set_blocking(writer, True)
    service.start(stderr=writer)
    charging(plant, service, 1, 2)
    assert service.ask("stop", "bay-1") == {"bay-1": ""}
    wait_until(lambda: plant.state(1)["operation"] == 0, 2, "the stop")
    began_s = time.monotonic()
    service.signal(signal.SIGTERM)
    assert service.ended() == 0
    assert time.monotonic() - began_s < 8
    assert service.path_of("bay-2")[-2:] == ["STOPPING", "SUSPENDED"], "the journal is whole"
    os.close(reader)
    os.close(writer)
    service.start()
    assert unnamed(service.wait("HELD")["bay-1"]["reason"]) == HELD


def test_what_no_disk_takes_is_said_and_the_end_is_a_bad_one(station: Station) -> None:
    plant, service = station
    journal = service.directory / "run" / "journal"
    (journal / "persisted.json.new").symlink_to("/dev/full")
    answer = service.ask("stop", "bay-1")["bay-1"]
    assert answer.startswith("done, but not saved: a restart would forget what changes: ")
    assert answer.endswith("persisted.json: No space left on device")
    assert plant.state(1)["operation"] == 0
    service.signal(signal.SIGTERM)
    assert service.ended() == 1
    assert service.log().splitlines()[-1] == f"ended: NOT saved: {journal / 'persisted.json'}: No space left on device"
    assert (plant.state(1)["operation"], plant.state(2)["operation"]) == (0, 0)


@pytest.mark.parametrize(
    "call", [pytest.param(call, marks=pytest.mark.station(2, run=on_a_worn_disk(call))) for call in ("fsync", "write")]
)
def test_a_disk_that_hangs_delays_no_stop_and_is_named_at_the_end(station: Station, call: str) -> None:
    """A worn SD card. The charger stops at once, the operator is told it is not persisted, and shutdown finishes."""
    plant, service = station
    os.kill(service.controller, signal.SIGUSR1)
    began_s = time.monotonic()
    answers: list[str] = []
    asking = threading.Thread(target=lambda: answers.append(service.ask("stop", "bay-1")["bay-1"]))
    asking.start()
    wait_until(lambda: plant.state(1)["operation"] == 0, 2, "the stop")
    assert time.monotonic() - began_s < 1
    asking.join()
    assert answers[0].startswith("done, but not saved: a restart would forget what changes: ")
    wait_until(lambda: "not_persisted" in [fault["id"] for fault in service.bay("bay-2")["faults"]], what="the fault")
    assert service.bay("bay-2")["state"] == "CHARGING", "what is under way goes on"
    began_s = time.monotonic()
    service.signal(signal.SIGTERM)
    assert service.ended() == 1
    assert time.monotonic() - began_s < 9
    assert "ended: NOT saved: " in service.log()
    assert service.log().splitlines()[-1].endswith("is not written within 2.5 s: its disk hangs")
    assert [plant.state(bay)["operation"] for bay in (1, 2)] == [0, 0]
    with running_on(service) as healthy:
        reason = healthy.start().wait("HELD")["bay-1"]["reason"]
        assert "had ended in mid-charge" in reason, "the disk knows of its beginning, and of no end"


@pytest.mark.station(2, ready=killed_in_mid_charge)
def test_a_disk_that_does_not_tell_the_past_holds_every_bay_after_the_stops(station: Station) -> None:
    plant, healthy = station
    with running_on(healthy, on_a_worn_disk("now-read")) as service:
        service.start()
        bays = service.wait("HELD", ["bay-1", "bay-2"])
        assert all("does not answer: nobody knows which faults were latched" in bay["reason"] for bay in bays.values())
        assert [plant.state(bay)["operation"] for bay in (1, 2)] == [0, 0]
        service.signal(signal.SIGTERM)
        assert service.ended() == 1
        assert "NOT saved: " in service.log().splitlines()[-1]
    assert {entry["running"] for entry in kept(healthy).values()} == {True}, "what was there was left alone"


def test_a_charger_that_the_station_file_has_lost_is_stopped_by_the_next_start(station: Station) -> None:
    plant, service = station
    before = service.file.read_text(encoding="utf-8")
    service.edit(without("bay-1"))
    service.kill_all()
    assert plant.state(1)["operation"] == 1
    service.start()
    wait_until(lambda: plant.state(1)["operation"] == 0, 10, "the stop")
    wait_until(lambda: service.strays()[0]["verified"], 10, "two replies that show standby")
    (stray,) = service.strays()
    assert (stray["bay"], stray["state"]) == ("bay-1", "HELD")
    assert "the station file has no bay on this port, but its charger may be running: stopping it" in service.log()
    service.signal(signal.SIGTERM)
    assert service.ended() == 0
    service.file.write_text(before, encoding="utf-8")
    bay = service.start().wait("HELD")["bay-1"]
    assert "while its charger was running" in bay["reason"]
    assert plant.state(1)["operation"] == 0


def test_one_that_does_not_stop_makes_the_end_a_bad_one(station: Station) -> None:
    plant, service = station
    plant.inject("ignore_stop", 1)
    service.edit(without("bay-1"))
    service.kill_all()
    service.start()
    service.wait("HELD", ["bay-2"])
    assert [stray["verified"] for stray in service.strays()] == [False]
    service.signal(signal.SIGTERM)
    assert service.ended() == 1
    port = service.directory / "bay-1"
    assert service.log().splitlines()[-1] == f"ended: NOT verified: bay-1 on {port}"
    service.start()
    assert [stray["bay"] for stray in service.strays()] == ["bay-1"], "and the next run knows of it, too"


def test_two_bays_whose_ports_were_changed_over_are_held(station: Station) -> None:
    plant, service = station
    service.signal(signal.SIGTERM)
    assert service.ended() == 0

    def swap(document: Document) -> None:
        one, other = (bay["charger"] for bay in document["bays"])
        one["port"], other["port"] = other["port"], one["port"]

    service.edit(swap)
    service.start()
    bays = service.wait("HELD", ["bay-1", "bay-2"])
    for bay in bays.values():
        assert "when this service last ran" in bay["reason"]
        assert f"see what is wired where; to go on: orchestrator start {bay['name']}" in bay["reason"]
    assert [plant.state(bay)["operation"] for bay in (1, 2)] == [0, 0]


def elsewhere(document: Document) -> None:
    document["bays"][0]["charger"]["port"] += "-gone"


@pytest.mark.station(1)
def test_a_charger_that_is_gone_for_good_is_dropped(station: Station) -> None:
    plant, service = station
    service.kill_all()
    port = plant.bays[0]["port"]
    plant.inject("port_gone")
    service.edit(elsewhere)
    service.start()
    wait_until(service.strays, 10, "the charger in hand")
    refused = service.cli("reset", "--port", "/dev/other")
    assert refused.returncode == 1 and f"(waited for: {port})" in refused.stderr
    done = service.cli("reset", "--port", port)
    assert (done.returncode, done.stdout) == (0, f"bay-1 on {port}: reset accepted\n")
    assert service.strays() == []
    service.kill_all()
    service.start()
    assert service.strays() == [], "it was on the disk before that was said"
    assert service.cli("reset", "bay-1", "--port", port).returncode == 2


@pytest.mark.station(2, ready=only_started)
def test_a_second_service_on_the_same_journal_ends_with_a_sentence(station: Station) -> None:
    _, service = station
    other = service.directory / "other.yaml"
    document = json.loads(service.file.read_text(encoding="utf-8"))
    document["control"]["socket"] = "run/other.sock"
    for bay in document["bays"]:
        bay["charger"]["port"] += "-other"
    other.write_text(json.dumps(document), encoding="utf-8")
    command = [sys.executable, "-m", "orchestrator", "run", str(other)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode != 0
    assert f"another service keeps its state in {service.directory / 'run' / 'journal'}: stop it first" in done.stderr
    assert service.status()
