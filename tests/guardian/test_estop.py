"""`orchestrator estop` with no service, a dead one, a hanging one and a running one."""

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from orchestrator.lastresort.estop import HURRIED, LOST, UNTOLD
from orchestrator.lastresort.port_owner import control_sockets
from orchestrator.protocol.standby import STOP_FRAME
from orchestrator.sim.client import PlantProcess
from tests.guardian.chargers import running_chargers
from tests.waiting import wait_until
from tests.whole.station import Service, die_with_parent, orchestrator, whole_station

Station = tuple[PlantProcess, Service]
NOBODY = "no service is running\n"
DONE = "every charger stands by, verified\n"


def estop(*args: str, **env: str) -> "subprocess.CompletedProcess[str]":
    return orchestrator("estop", *args, env={"ORCHESTRATOR_SOCKET": "", **env})


# --- without a service: emulated chargers alone ----------------------------------------------------------------------


def test_ports_without_a_service(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 2) as (one, other):
        done = estop("--port", one.name, other.name)
        assert done.stdout == f"{one.name}: standby verified\n{other.name}: standby verified\n{DONE}"
        assert (done.returncode, done.stderr) == (0, NOBODY)
        assert not (one.runs or other.runs)


def test_who_is_not_verified_is_told(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 2) as (good, deaf):
        deaf.charger.ignores_stop = True
        missing = str(tmp_path / "none")
        done = estop("--port", good.name, "--port", deaf.name, missing)
        assert done.returncode == 1
        assert done.stdout.splitlines() == [
            f"CUT THE MAINS of {deaf.name}, {missing}: nothing proves that they stand by",
            f"{good.name}: standby verified",
            f"{deaf.name}: NOT stopped: the charger says that it goes on",
            f"{missing}: No such file or directory",
        ]
        assert deaf.stops >= 12  # two in each round of half a second, for three seconds


def station_file(directory: Path, text: str) -> Path:
    file = directory / "station.yaml"
    file.write_text(text)
    return file


BAYS = "bays:\n  - {name: left, charger: {port: ./charger-1}}\n  - {name: right, charger: {port: ./charger-2}}\n"
BAYS += "control: {socket: none}\njournal: {directory: none}\n"


@pytest.mark.parametrize("text", [BAYS, f"stattion: typo\n{BAYS}limits: 7\n"])
def test_a_station_file_gives_ports_and_names_even_with_mistakes(tmp_path: Path, text: str) -> None:
    with running_chargers(tmp_path, 2) as (left, right):
        done = estop(str(station_file(tmp_path, text)))
        assert done.returncode == 0
        assert done.stdout == f"left ({left.name}): standby verified\nright ({right.name}): standby verified\n{DONE}"
        assert not (left.runs or right.runs)


def test_a_file_that_is_not_even_yaml_gives_ports(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        file = station_file(tmp_path, f"]\n  port: {bench.name}\n")
        done = estop(str(file))
        told = f"{bench.name}: standby verified\n{file} is damaged: {LOST}\n"
        assert (done.returncode, done.stdout) == (1, told)


def test_a_station_file_without_ports_or_none_at_all(tmp_path: Path) -> None:
    for file, said in ((station_file(tmp_path, "bays: []\n"), ""), (tmp_path / "none.yaml", "No such file")):
        done = estop(str(file))
        assert (done.returncode, done.stdout) == (1, "")
        assert said in done.stderr
        assert done.stderr.endswith("no port to stop: name a station file or --port PATH\n")


def test_ports_besides_those_of_a_station_file(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 3) as (left, right, other):
        done = estop(str(station_file(tmp_path, BAYS)), "--port", other.name, left.name)
        assert (done.returncode, done.stderr) == (0, NOBODY)
        assert sorted(done.stdout.splitlines()) == sorted([
            f"{other.name}: standby verified",
            f"left ({left.name}): standby verified",
            f"right ({right.name}): standby verified",
            DONE.strip(),
        ])  # fmt: skip
        missing = estop(str(tmp_path / "none.yaml"), "--port", left.name)
        assert missing.returncode == 1, "nobody knows what that file names"
        assert f"{tmp_path}/none.yaml: No such file or directory" in missing.stdout


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_who_interrupts_it_is_told_what_was_stopped(tmp_path: Path, number: signal.Signals) -> None:
    """Right after the first stop: otherwise it would wait three seconds for the deaf charger."""
    with running_chargers(tmp_path, 2) as (good, deaf):
        deaf.charger.ignores_stop = True
        argv = [sys.executable, "-m", "orchestrator", "estop", "--port", deaf.name, good.name]
        with subprocess.Popen(argv, stdout=subprocess.PIPE, text=True, preexec_fn=die_with_parent) as process:
            wait_until(lambda: deaf.stops, what="the first stop")
            process.send_signal(number)
            began_s = time.monotonic()
            said, _ = process.communicate(timeout=20)
        assert process.returncode == 1
        assert time.monotonic() - began_s < 3.5
        assert said.startswith("CUT THE MAINS of ") and deaf.name in said.splitlines()[0]
        assert f"{good.name}: " in said and said.splitlines()[-1] == HURRIED
        assert not good.runs


@pytest.mark.parametrize("files", [12, 9])
def test_where_few_files_may_be_open_ports_take_turns(tmp_path: Path, files: int) -> None:
    with running_chargers(tmp_path, 5) as benches:
        names = [bench.name for bench in benches]
        limit = partial(resource.setrlimit, resource.RLIMIT_NOFILE, (files, files))
        argv = [sys.executable, "-m", "orchestrator", "estop", "--port", *names]
        done = subprocess.run(argv, preexec_fn=limit, capture_output=True, text=True, timeout=30, check=False)
        assert "Traceback" not in done.stderr
        assert not any(bench.runs for bench in benches)
        assert done.stdout == "".join(f"{name}: standby verified\n" for name in names) + DONE
        assert (done.returncode, done.stderr) == (0, NOBODY)


def test_contactors_of_a_station_file_come_after_the_stops(tmp_path: Path) -> None:
    """A device that is not a chip is reported, and changes nothing for the chargers."""
    bays = BAYS.replace("{name: right,", "{name: right, contactor: {chip: ./gpiochip0, line: 17},")
    with running_chargers(tmp_path, 2) as (left, right):
        for chip, became in (("none yet", "No such file or directory"), ("a file", "Inappropriate ioctl for device")):
            if chip == "a file":
                (tmp_path / "gpiochip0").touch()
            done = estop(str(station_file(tmp_path, bays)))
            assert (done.returncode, done.stderr) == (0, NOBODY)
            assert done.stdout.splitlines() == [
                f"left ({left.name}): standby verified",
                f"right ({right.name}): standby verified",
                f"contactor on {tmp_path}/gpiochip0 line 17: {became}",
                DONE.strip(),
            ]


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (("--prot", "/dev/x"), "unknown option --prot"),
        (("one.yaml", "two.yaml"), "name one station file"),
        (("one.yaml", "two.yaml", "--port", "/dev/x"), "name one station file"),
        (("--port",), "--port needs a path"),
        (("--port", "/dev/x", "--socket"), "--socket needs a path"),
    ],
)
def test_wrong_use_stops_nothing_and_is_told(args: tuple[str, ...], said: str) -> None:
    done = estop(*args)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"orchestrator estop: {said}\nusage: ")


def test_help() -> None:
    for word in ("-h", "--help"):
        done = estop(word)
        assert done.returncode == 0
        assert done.stdout.startswith("usage: orchestrator estop")


# --- beside a service ------------------------------------------------------------------------------------------------


@pytest.fixture(name="station", scope="module")
def _station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """Four charging bays. The tests run in order, and each starts with its own bay."""
    with whole_station(tmp_path_factory.mktemp("estop"), 4) as (plant, service):
        service.start()
        charging((plant, service))
        yield plant, service


def charging(station: Station, *bays: int) -> None:
    """Get these bays (default: all) charging, with the service aware of it."""
    _, service = station
    names = [f"bay-{bay}" for bay in bays or (1, 2, 3, 4)]
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


def test_with_its_station_file_every_bay_is_held(station: Station) -> None:
    charging(station)
    plant, service = station
    done = estop(str(service.file))
    assert done.returncode == 0
    standby = [f"bay-{n} ({port_of(station, n)}): standby verified" for n in (1, 2, 3, 4)]
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


def test_a_controller_that_hangs(station: Station) -> None:
    charging(station, 1, 2)
    plant, service = station
    os.kill(service.controller, signal.SIGSTOP)
    done = estop(str(service.file))
    assert done.returncode == ("the service has not" in done.stderr), "one that holds the ports may start them again"
    assert done.stderr.startswith(("the service has not", "no service is running"))
    assert service.ended() != 0
    assert not any(plant.state(bay)["operation"] for bay in (1, 2, 3, 4))


def test_a_service_that_is_frozen_as_a_whole_and_then_dead(station: Station) -> None:
    plant, service = station
    service.start()
    charging(station, 1, 2)
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
