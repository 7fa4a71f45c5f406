"""The shipped unit under systemd, installed by the page: its drill, and every death of guardian and controller."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator

import pytest

from orchestrator.errors import ServiceError
from tests.guest import page
from tests.guest.installed import installed
from tests.guest.stage import AGAIN_S, CHARGING_S, LOOK_S, Scene, note
from tests.waiting import wait_until

UNIT = "/etc/systemd/system/orchestrator.service"
#: Run by the technician's shell at login.
LOGIN = ". /etc/profile.d/orchestrator.sh"
#: Receivers of a signal: their process ids, from the scene.
WHOM: dict[str, Callable[[Scene], list[int]]] = {
    "controller": lambda bay: [bay.service.controller],
    "guardian": lambda bay: [bay.service.guardian],
    "guardian and controller": lambda bay: [bay.service.guardian, bay.service.controller],
}
#: Time added by the guest's slow processor, and by the start of its `estop` (1.7 s if the host has other work).
SLACK_S = 1.0
START_S = 2.5
#: (signal, receiver) → the seconds allowed until the stop. By design: the guardian's 0.5 s for a hanging controller,
#: the controller's 2 s for a hanging guardian, systemd's 3 s (WatchdogSec) for both; if nobody is left, then `estop`.
ALLOWED_S = {
    (signal.SIGKILL, "controller"): 0.0,
    (signal.SIGKILL, "guardian"): START_S,
    (signal.SIGKILL, "guardian and controller"): START_S,
    (signal.SIGSTOP, "controller"): 0.6,
    (signal.SIGSTOP, "guardian"): 2.1,
    (signal.SIGSTOP, "guardian and controller"): 3.0 + START_S,
}


@pytest.fixture(name="bay", scope="module")
def _bay() -> Iterator[Scene]:
    with installed() as scene:
        yield scene


def test_systemd_has_nothing_to_say_against_the_unit(bay: Scene) -> None:
    done = subprocess.run(["systemd-analyze", "verify", UNIT], capture_output=True, text=True, check=True)
    assert done.stderr == ""


def test_little_is_exposed(bay: Scene) -> None:
    said = page.run("systemd-analyze security --no-pager orchestrator")
    assert float(said.rpartition(": ")[2].split()[0]) <= 1.5


@pytest.mark.parametrize(("number", "whom"), ALLOWED_S, ids=lambda value: getattr(value, "name", value))
def test_the_chargers_are_stopped_whoever_dies_or_hangs(bay: Scene, number: signal.Signals, whom: str) -> None:
    charge(bay)
    guardian, victims = bay.service.guardian, WHOM[whom](bay)

    def happen() -> None:
        for victim in victims:
            os.kill(victim, number)

    happened_s = time.monotonic()
    stop_s = bay.stopped_by(happen)
    wait_until(lambda: bay.service.guardian not in (0, guardian), AGAIN_S, "a new service", LOOK_S)
    held(bay)
    note(f"{number.name} {whom}", stop_s, time.monotonic() - happened_s, held=True)
    assert stop_s < ALLOWED_S[number, whom] + SLACK_S


@pytest.mark.parametrize("command", page.drill())
def test_the_drill_of_the_page(bay: Scene, command: str) -> None:
    charge(bay)
    stop_s = bay.stopped_by(lambda: page.run(f"{LOGIN} && {command}"))
    if command.startswith("sudo systemctl stop"):
        note(command, stop_s, goes_on(bay))
    else:
        held(bay)
        note(command, stop_s)


def charge(bay: Scene) -> None:
    """The operator's start, and a charge."""
    comes_to(bay, r".")
    wait_until(lambda: not bay.service.ask("start", "bay-1")["bay-1"], AGAIN_S, "a start that is accepted", LOOK_S)
    charging(bay)


def held(bay: Scene) -> None:
    """The service is up (again), has verified the charger's standby, and waits for its operator."""
    comes_to(bay, r"^HELD: .*: orchestrator start bay-1$")
    assert bay.plant.state()["operation"] == 0


def goes_on(bay: Scene) -> float:
    """A clean end is not an operator's stop: the next run resumes the charges; returns the seconds until then."""
    assert page.run("systemctl show --property Result --value orchestrator").strip() == "success"
    started_s = time.monotonic()
    page.run("sudo systemctl start orchestrator")
    charging(bay)
    return time.monotonic() - started_s


def charging(bay: Scene) -> None:
    """The service is up (again) and charges."""
    comes_to(bay, r"^CHARGING: ")
    bay.until(lambda truth: truth["current_a"] > 1, "a current")


def comes_to(bay: Scene, wanted: str) -> None:
    """Wait for this state and reason, even of a service just starting."""
    wait_until(lambda: re.search(wanted, said(bay)), CHARGING_S, f"a bay that says {wanted}", LOOK_S)


def said(bay: Scene) -> str:
    """State and reason; "" where no service answers."""
    try:
        return "{state}: {reason}".format_map(bay.service.bay())
    except ServiceError:
        return ""
