"""`orchestrator estop` beside a whole station: a service that runs, one that hangs and a dead one."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.lastresort.estop import UNTOLD
from orchestrator.lastresort.port_owner import control_sockets
from orchestrator.protocol.standby import STOP_FRAME
from tests.guardian.chargers import running_chargers
from tests.waiting import wait_until
from tests.whole.recipe import Recipe, Station, made
from tests.whole.station import orchestrator, whole_station

NOBODY = "no service is running\n"
DONE = "every charger stands by, verified\n"


def estop(*args: str, **env: str) -> "subprocess.CompletedProcess[str]":
    return orchestrator("estop", *args, env={"ORCHESTRATOR_SOCKET": "", **env})


@pytest.fixture(name="fresh")
def _fresh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """Four charging bays of its own, for a test that needs them all, or the whole service."""
    with made(Recipe(4), tmp_path_factory.mktemp("fresh")) as station:
        yield station


@pytest.fixture(name="station", scope="module")
def _station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """Four charging bays. The tests run in order, and each starts with its own bay."""
    with whole_station(tmp_path_factory.mktemp("estop"), 4) as (plant, service):
        service.start()
        charging((plant, service))
        yield plant, service


def charging(station: Station) -> None:
    """Get all bays charging, with the service aware of it."""
    _, service = station
    names = [f"bay-{bay}" for bay in (1, 2, 3, 4)]
    service.wait({"IDLE", "HELD", "CHARGING"}, names)
    service.ask("start", *names)
    service.wait("CHARGING", names)
    for name in names:
        wait_until(lambda name=name: service.bay(name)["charger"]["operation"] == 1, what="current")  # type: ignore[misc]


def port_of(station: Station, bay: int) -> str:
    return str(station[0].bays[bay - 1]["port"])


def held(*names: str) -> str:
    return f"the service holds {', '.join(names)} until an operator starts it\n"


def test_with_a_port_only_that_bay_is_held(station: Station) -> None:
    """No socket is named: it is found through the lock on the port."""
    plant, service = station
    port = port_of(station, 1)
    assert control_sockets([os.devnull]) == []
    assert control_sockets([port, os.devnull, port]) == [str(service.socket)]
    done = estop("--port", port)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{port}: standby verified\n{DONE}", held("bay-1"))
    assert [plant.state(bay)["operation"] for bay in (1, 2, 3, 4)] == [0, 1, 1, 1]


def test_a_service_that_nobody_told_leaves_a_stopped_charger_alone(station: Station) -> None:
    _, service = station
    port = os.open(port_of(station, 2), os.O_RDWR | os.O_NOCTTY)
    os.write(port, STOP_FRAME)
    os.close(port)
    (fault,) = service.wait("HELD", ["bay-2"])["bay-2"]["faults"]
    assert fault["id"] in (
        "stopped_by_itself",
        "early_full",
    )  # depending on its values in standby; both wait for an operator


def test_a_bay_in_the_first_moment_of_a_charge_is_held_as_well(station: Station) -> None:
    """Its charger has not run yet: to the service, a stop alone would look like a charger that fails to start."""
    _, service = station
    service.ask("stop", "bay-3")
    service.wait("HELD", ["bay-3"])
    service.ask("start", "bay-3")
    service.wait("CHARGING", ["bay-3"])
    done = estop("--port", port_of(station, 3))
    assert (done.returncode, done.stderr) == (0, held("bay-3"))


def test_a_charger_that_disobeys_the_service_as_well_is_not_verified(station: Station) -> None:
    plant, service = station
    plant.inject("ignore_stop", 4)
    done = estop("--port", port_of(station, 4))
    assert done.returncode == 1
    assert "NOT stopped: the service says " in done.stdout
    plant.inject("heal", 4)
    service.wait("TRIPPED", ["bay-4"])
    wait_until(lambda: not service.ask("reset", "bay-4")["bay-4"], what="a reset that is accepted")


def test_what_was_stopped_stays_so_and_nobody_is_alarmed(station: Station) -> None:
    """Longer than a bay needs to qualify. The service keeps reading its chargers all the time."""
    plant, service = station
    since_s = max(bay["charger"]["t_s"] for bay in service.status().values())
    wait_until(lambda: min(bay["charger"]["t_s"] for bay in service.status().values()) > since_s + 3, what="polls")
    for number, (name, bay) in enumerate(service.status().items(), start=1):
        assert plant.state(number)["operation"] == 0
        assert (bay["state"], bay["alarm"] != "danger", bay["charger"]["online"]) == ("HELD", True, True), name
        assert "UNCONTROLLABLE" not in service.path_of(name) or name == "bay-4"


def test_with_its_station_file_every_bay_is_held(fresh: Station) -> None:
    plant, service = fresh
    done = estop(str(service.file))
    assert done.returncode == 0
    standby = [f"bay-{n} ({port_of(fresh, n)}): standby verified" for n in (1, 2, 3, 4)]
    assert done.stdout.splitlines() == [*standby, DONE.strip()]
    assert done.stderr == held("bay-1", "bay-2", "bay-3", "bay-4")
    bays = service.wait("HELD", ["bay-1", "bay-2", "bay-3", "bay-4"]).values()
    # On a busy machine it may see its charger stop before it is told why; a person starts it all the same.
    assert all(bay["reason"].endswith(f": orchestrator start {bay['name']}") for bay in bays)
    assert not any(plant.state(bay)["operation"] for bay in (1, 2, 3, 4))


def test_a_port_that_this_service_does_not_have_is_verified_without_it(station: Station, tmp_path: Path) -> None:
    _, service = station
    with running_chargers(tmp_path) as (bench,):
        done = estop("--port", bench.name, "--socket", str(service.socket))
        assert (done.returncode, done.stdout) == (0, f"{bench.name}: standby verified\n{DONE}")
        assert done.stderr == "the service holds none of these ports\n"


def test_a_controller_that_hangs(fresh: Station) -> None:
    plant, service = fresh
    os.kill(service.controller, signal.SIGSTOP)
    done = estop(str(service.file))
    assert done.returncode == ("the service has not" in done.stderr), "one that holds the ports may start them again"
    assert done.stderr.startswith(("the service has not", "no service is running"))
    assert service.ended() != 0
    assert not any(plant.state(bay)["operation"] for bay in (1, 2, 3, 4))


def test_a_service_that_is_frozen_as_a_whole_and_then_dead(fresh: Station) -> None:
    plant, service = fresh
    os.killpg(service.guardian, signal.SIGSTOP)
    left = estop(str(service.file), "--leave-held", SERVICE_RESULT="success")
    assert left.stdout.count("left alone: a service holds this port") == 4
    assert plant.state(1)["operation"] == 1
    by_systemd = estop(str(service.file), "--leave-held", SERVICE_RESULT="watchdog")
    assert (by_systemd.returncode, by_systemd.stdout.count("standby verified")) == (1, 4)
    assert not any(plant.state(bay)["operation"] for bay in (1, 2, 3, 4))
    frozen = estop(str(service.file))
    assert frozen.returncode == 1
    assert frozen.stdout.splitlines()[-1] == UNTOLD
    assert frozen.stdout.count("standby verified") == 4
    assert frozen.stderr == "the service has not taken the stop (it does not answer): nobody holds its bays\n"
    assert not any(plant.state(bay)["operation"] for bay in (1, 2, 3, 4))
    service.kill_all()
    dead = estop(str(service.file))
    assert (dead.returncode, dead.stdout, dead.stderr) == (0, frozen.stdout.replace(f"{UNTOLD}\n", DONE), NOBODY)
