"""`orchestrator estop` without a service: emulated chargers alone, and files that name them."""

import resource
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from orchestrator.lastresort.bareport import HELD
from orchestrator.lastresort.estop import HURRIED, LOST
from tests.guardian import briefly
from tests.guardian.chargers import running_chargers
from tests.link.strangers import holding
from tests.waiting import wait_until
from tests.whole.station import die_with_parent, orchestrator

NOBODY = "no service is running\n"
DONE = "every charger stands by, verified\n"


def estop(*args: str, **env: str) -> "subprocess.CompletedProcess[str]":
    return orchestrator("estop", *args, env={"ORCHESTRATOR_SOCKET": "", **env}, program=briefly.ESTOP)


def test_ports_without_a_service(tmp_path: Path) -> None:
    """As people call it; most others watch for a shorter time."""
    with running_chargers(tmp_path, 2) as (one, other):
        done = orchestrator("estop", "--port", one.name, other.name, env={"ORCHESTRATOR_SOCKET": ""})
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
    """As soon as the first stop has come: it would have waited three seconds for the charger that is deaf."""
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
    """What is not a chip is told, and changes nothing for the chargers."""
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


def test_a_port_that_a_service_holds_may_be_left_to_it(tmp_path: Path) -> None:
    """By systemd, whose ExecStopPost= runs after every end; but not when its watchdog has found the service frozen."""
    with running_chargers(tmp_path, 2) as (held, free), holding(held.name, name="/opt/bin/orchestrator"):
        words = ("--leave-held", "--port", held.name, free.name)
        left = estop(*words, SERVICE_RESULT="success")
        assert left.returncode == 1
        assert left.stdout.splitlines() == [f"{held.name}: {HELD}", f"{free.name}: standby verified"]
        assert (held.runs, free.runs) == (True, False)
        frozen = estop(*words, SERVICE_RESULT="watchdog")
        assert f"{held.name}: standby verified\n" in frozen.stdout
        assert not held.runs
