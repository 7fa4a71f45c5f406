"""A service that cannot begin does not leave a charger running that an earlier one had started."""

import os
import signal
import subprocess
import sys
from collections.abc import Sequence

import pytest

from orchestrator.lastresort.guardian import ACTED
from orchestrator.sim.client import PlantProcess
from tests.waiting import wait_until
from tests.whole.recipe import Station, charge
from tests.whole.station import Service

#: The controller with a limit on its threads; a limit of the system (TasksMax=, ulimit -u) fails in the same way.
FEW_THREADS = """
import sys, threading
from orchestrator.lastresort import unforeseen
from orchestrator.service import controller
sys.excepthook = unforeseen.say_unforeseen
left, good = COUNT, threading.Thread.start
def start(thread):
    global left
    left -= 1
    if left < 0:
        raise RuntimeError("can't start new thread")
    good(thread)
threading.Thread.start = start
sys.exit(controller.main(int(sys.argv[1]), sys.argv[2]))
"""
GUARD = """
import sys
from orchestrator.lastresort import guardian
sys.exit(guardian.guard(sys.argv[2:], ("-c", sys.argv[1])))
"""


def left_running(plant: PlantProcess, service: Service) -> None:
    """A charger that runs without any service, although its service had persisted that it runs."""
    charge(plant, service)
    service.kill_all()
    assert plant.state()["run"]


pytestmark = pytest.mark.station(ready=left_running)


def run(command: Sequence[str], service: Service) -> tuple[int, str]:
    """Its exit status and output; it must end by itself."""
    done = subprocess.run(
        [sys.executable, *command, str(service.file)], capture_output=True, text=True, timeout=40, check=False
    )
    return done.returncode, done.stderr


def in_standby(plant: PlantProcess) -> bool:
    truth = plant.state()
    return (truth["operation"], truth["run"]) == (0, False)


def few_threads(count: int) -> tuple[str, str, str]:
    return "-c", GUARD, FEW_THREADS.replace("COUNT", str(count))


@pytest.mark.parametrize("count", [2, 6])
def test_without_threads_for_the_rest_the_chargers_are_stopped_and_it_ends_in_an_orderly_way(
    station: Station, count: int
) -> None:
    plant, service = station
    status, log = run(few_threads(count), service)
    assert in_standby(plant)
    assert status == 1
    assert "the service cannot begin (can't start new thread): raise MemoryMax= and TasksMax=" in log
    assert log.splitlines()[-1] == "ended: every charger stands by, verified"
    assert "Traceback" not in log
    assert "guardian:" not in log


@pytest.mark.parametrize("count", [0])
def test_without_a_thread_for_its_port_a_charger_is_stopped_all_the_same(station: Station, count: int) -> None:
    plant, service = station
    status, log = run(few_threads(count), service)
    assert in_standby(plant)
    assert status == ACTED
    assert 'orchestrator: the service cannot go on: RuntimeError("can\'t start new thread")' in log
    assert "raise MemoryMax= and TasksMax= of the unit" in log
    assert log.splitlines()[-1].endswith("/bay-1: standby verified")
    assert "Traceback" not in log


@pytest.mark.parametrize("controller", ["import nothing_like_it", "import os; os.abort()"])
def test_a_controller_that_cannot_even_be_imported_leaves_no_charger_running(station: Station, controller: str) -> None:
    plant, service = station
    status, log = run(("-c", GUARD, controller), service)
    assert in_standby(plant)
    assert status == ACTED
    assert log.splitlines()[-1].endswith("/bay-1: standby verified")


def test_where_no_controller_can_be_started_the_guardian_stops_the_chargers(station: Station) -> None:
    plant, service = station
    guard = GUARD.replace("sys.exit", "sys.executable += '.missing'; sys.exit")
    status, log = run(("-c", guard, ""), service)
    assert in_standby(plant)
    assert status == ACTED
    assert log.startswith("guardian: the controller cannot be started: ")


@pytest.mark.parametrize("megabytes", [60, 250])
def test_with_too_little_memory_no_charger_is_left_running(station: Station, megabytes: int) -> None:
    plant, service = station
    limited = f"ulimit -v {megabytes * 1024}; exec {sys.executable} -m orchestrator run {service.file}"
    process = subprocess.Popen(
        ["bash", "-c", limited], stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        wait_until(lambda: in_standby(plant), 15, "the stop")
        try:
            status = process.wait(12)
        except subprocess.TimeoutExpired:
            return  # it was enough: the service runs
        assert status in (1, ACTED)
        assert in_standby(plant)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
