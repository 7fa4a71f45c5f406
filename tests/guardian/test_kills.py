"""Everything a controller or its guardian can die of while its charger runs: it ends stopped and verified."""

import json
import os
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from orchestrator.errors import ServiceError
from orchestrator.lastresort.guardian import ACTED
from orchestrator.model import Action, Command
from orchestrator.protocol.charger import encode
from orchestrator.sim.client import PlantProcess
from tests.guardian import briefly
from tests.guardian.saboteur import MODES
from tests.guardian.watched import state_of
from tests.sim.wires import udp_keys
from tests.waiting import wait_until
from tests.whole.recipe import ends
from tests.whole.station import Service, orchestrator, station_document

GUARD = """
import sys
from orchestrator.lastresort import guardian
guardian.VERIFY_S = 1.0
sys.exit(guardian.guard(sys.argv[2:], ("-m", "tests.guardian.saboteur", sys.argv[1])))
"""
#: Started without input or output, as by a program that has closed its own.
WITHOUT_STREAMS = """
import os, sys
os.closerange(0, 3)
os.execv(sys.executable, [sys.executable, "-m", "orchestrator", "run", sys.argv[1]])
"""
#: Not a timing test (`make bench` measures that): it only shows that nobody waited for a time-out.
SOON_S = 3.0


@dataclass(frozen=True)
class Case:
    """One way to die: the signal sent to the controller, and the guardian's message about it."""

    name: str
    number: signal.Signals
    said: str
    mode: str = ""  #: of the saboteur


CASES = (
    Case("SIGKILL, as the kernel's out-of-memory killer sends it", signal.SIGKILL, "was ended by SIGKILL"),
    Case("SIGSEGV", signal.SIGSEGV, "was ended by SIGSEGV"),
    Case("SIGSTOP", signal.SIGSTOP, "hangs"),
    *(
        Case(mode, signal.SIGUSR1, said, mode)
        for mode, said in {
            **dict.fromkeys(MODES, "hangs"),
            "loop_fails": "has ended with status 1",
            "decision_leaves": "has ended with status 0",
            "decision_aborts": "was ended by SIGABRT",
        }.items()
    ),
)
#: Number of services started ahead of need.
AHEAD = 4
OTHERS = (
    "half a frame",
    "without streams",
    "guardian killed",
    "guardian frozen",
    "both killed",
    "told to end",
    "a second one",
    "a terminal",
)
#: Start options of services with unusual ones.
RUNS: Mapping[str, Sequence[str]] = {
    **{case.name: ("-c", GUARD, case.mode) for case in CASES if case.mode},
    **dict.fromkeys(("SIGSEGV", "SIGSTOP", "half a frame"), (*briefly.GUARDIAN, "run")),
    "without streams": ("-c", WITHOUT_STREAMS),
}
BAYS = {name: number for number, name in enumerate([*(case.name for case in CASES), *OTHERS], start=1)}


@dataclass(frozen=True)
class Charging:
    """A service with one running charger."""

    plant: PlantProcess
    service: Service
    bay: int

    @property
    def port(self) -> str:
        return str(self.plant.bays[self.bay - 1]["port"])

    @property
    def runs(self) -> bool:
        return bool(self.plant.state(self.bay)["operation"])

    def until_it_runs(self) -> None:
        """Wait for the charge."""
        self.service.wait("CHARGING")
        wait_until(lambda: self.runs, what="current")

    def watch(self) -> float:
        """Watch for the first stop from now on; returns the time."""
        return self.plant.inject("heal", self.bay)

    def check_stopped(self, since_s: float) -> None:
        truth = self.plant.state(self.bay)
        assert (truth["operation"], truth["current_a"], truth["run"]) == (0, 0, False)
        assert truth["first_stop_s"] - since_s < SOON_S


class Services:
    """A service per test, each with its own bay and bus. Some are started ahead: they need 3 s to charge."""

    def __init__(self, directory: Path, plant: PlantProcess, cans: Sequence[Mapping[str, object]]) -> None:
        self._directory, self._plant, self._cans = directory, plant, cans
        self._started: dict[str, Charging] = {}

    def take(self, name: str) -> Charging:
        """The service of this name, once its charger runs."""
        names = list(BAYS)
        for near in names[names.index(name) :][:AHEAD]:
            if near not in self._started:
                self._started[near] = self._start(near)
        one = self._started[name]
        try:
            one.until_it_runs()
        except (AssertionError, ServiceError):  # starved on a busy machine, before it was its turn
            if not ends(one.service):
                raise
            one = self._started[name] = self._start(name, again=True)
            one.until_it_runs()
        return one

    def _start(self, name: str, *, again: bool = False) -> Charging:
        number = BAYS[name]
        document = station_document(self._directory, [self._cans[number - 1]], 1)
        document["bays"][0]["charger"]["port"] = self._plant.bays[number - 1]["port"]
        own = self._directory / (f"{number}-again" if again else str(number))
        own.mkdir()
        service = Service(own, document, RUNS.get(name, ("-m", "orchestrator", "run")))
        return Charging(self._plant, service.start(), number)

    def close(self) -> None:
        for one in self._started.values():
            one.service.close()


@pytest.fixture(name="services", scope="module")
def _services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    directory = tmp_path_factory.mktemp("kills")
    cans = [udp_keys() for _ in BAYS]
    can_args = [arg for keys in cans for arg in ("--can", json.dumps(keys))]
    with PlantProcess(directory, "--bays", str(len(BAYS)), *can_args) as plant:
        services = Services(directory, plant, cans)
        try:
            yield services
        finally:
            services.close()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_whatever_the_controller_dies_of_its_charger_is_stopped(services: Services, case: Case) -> None:
    one = services.take(case.name)
    since_s = one.watch()
    os.kill(one.service.controller, case.number)
    if case.mode.startswith("control_"):
        wait_until(lambda: not answers(one.service), what="the end of its answers")
    assert one.service.ended() in (ACTED, 1)
    one.check_stopped(since_s)
    assert f"guardian: the controller {case.said}: stopping the chargers on 1 ports" in one.service.log()
    assert one.service.log().splitlines()[-1] == f"guardian: {one.port}: standby verified"


def answers(service: Service) -> bool:
    with suppress(ServiceError):
        return bool(service.status())
    return False


def test_half_a_frame_of_the_dying_controller_is_no_harm(services: Services) -> None:
    one = services.take("half a frame")
    since_s = one.watch()
    controller = one.service.controller
    os.kill(controller, signal.SIGSTOP)
    port = os.open(one.port, os.O_RDWR | os.O_NOCTTY)
    os.write(port, encode(Command(Action.RUN))[:6])
    os.close(port)
    os.kill(controller, signal.SIGKILL)
    assert one.service.ended() == ACTED
    one.check_stopped(since_s)


def test_what_it_says_without_a_standard_error_does_not_go_to_a_charger(services: Services) -> None:
    """An opened file gets the lowest free number: a serial port would be "standard error"."""
    one = services.take("without streams")
    since_s = one.watch()
    for pid in (one.service.guardian, one.service.controller):
        assert {Path(f"/proc/{pid}/fd/{fd}").readlink() for fd in range(3)} == {Path(os.devnull)}
    one.service.kill_controller()
    assert one.service.ended() == ACTED
    one.check_stopped(since_s)


def test_without_its_guardian_the_controller_stops_and_ends(services: Services) -> None:
    one = services.take("guardian killed")
    controller, since_s = one.service.controller, one.watch()
    one.service.signal(signal.SIGKILL)
    wait_until(lambda: state_of(controller) == "Z", 15, "the controller's end")
    one.check_stopped(since_s)
    log = one.service.log().splitlines()
    assert "the guardian has died: stopping every bay" in log
    assert log[-1] == "ended: every charger stands by, verified"


def test_a_guardian_that_hangs_is_none(services: Services) -> None:
    one = services.take("guardian frozen")
    controller, since_s = one.service.controller, one.watch()
    one.service.signal(signal.SIGSTOP)
    wait_until(lambda: state_of(controller) == "Z", 15, "the controller's end")
    one.check_stopped(since_s)
    assert "the guardian has not answered for 2 s: stopping every bay" in one.service.log()
    one.service.signal(signal.SIGCONT)
    assert one.service.ended() == 1


def test_when_both_are_killed_only_an_emergency_stop_is_left(services: Services) -> None:
    """This is why the systemd unit has one as its ExecStopPost."""
    one = services.take("both killed")
    since_s = one.watch()
    one.service.kill_all()
    assert one.runs
    done = orchestrator("estop", str(one.service.file), "--leave-held")
    assert (done.returncode, done.stdout, done.stderr) == (
        0, f"bay-1 ({one.port}): standby verified\nevery charger stands by, verified\n", "",
    )  # fmt: skip
    one.check_stopped(since_s)


def test_an_orderly_end_leaves_nothing_to_the_guardian(services: Services) -> None:
    one = services.take("told to end")
    since_s = one.watch()
    one.service.signal(signal.SIGTERM)
    assert one.service.ended() == 0
    one.check_stopped(since_s)
    assert "guardian" not in one.service.log()


def test_a_second_service_stops_nothing(services: Services, tmp_path: Path) -> None:
    """With the same station file or another one, both at its start and when it is killed."""
    one = services.take("a second one")
    one.watch()
    second = orchestrator("run", str(one.service.file))
    assert second.returncode == 1
    assert second.stderr.startswith(
        f"orchestrator: {one.port}: another service (pid {one.service.controller}) has this"
    )
    assert len(second.stderr.splitlines()) == 1
    document = json.loads(one.service.file.read_text())
    document["can"]["can0"] = udp_keys()  # two masters on one BMU are noticed: a separate subject
    third = orchestrator("run", str(Service(tmp_path, document).file))
    assert third.returncode == 1
    assert third.stderr.startswith(f"orchestrator: {one.port}: another service (pid {one.service.controller}) has this")
    assert len(third.stderr.splitlines()) == 1
    fourth = orchestrator("estop", str(one.service.file), "--leave-held")
    assert (fourth.returncode, fourth.stdout) == (1, f"bay-1 ({one.port}): left alone: a service holds this port\n")
    truth = one.plant.state(one.bay)
    assert (truth["operation"], truth["first_stop_s"]) == (1, None)
    assert one.service.bay()["state"] == "CHARGING"


def test_a_terminal_that_suspends_is_no_way_round_and_a_hang_up_reads_the_policies_anew(services: Services) -> None:
    """Ctrl-Z stops neither; SIGHUP without a terminal ends neither, whoever gets it."""
    one = services.take("a terminal")
    os.killpg(one.service.guardian, signal.SIGTSTP)
    assert one.service.bay()["state"] == "CHARGING"
    os.killpg(one.service.guardian, signal.SIGHUP)
    wait_until(lambda: "reload: policy" in one.service.log(), what="the reload")
    assert one.service.bay()["state"] == "CHARGING"
