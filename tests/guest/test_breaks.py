"""Serial adapters that return under another name, and breaks inside the running service."""

import os
import signal
from pathlib import Path

import pytest

from orchestrator.lastresort.guardian import ACTED, SILENCE_S
from tests.guest.stage import LOOK_S, note, socketcan, station, vcan
from tests.waiting import wait_until

AT_ONCE_S = 0.5
#: A missing port is retried every second.
REOPENED_S = 2.0
GUARD = """
import sys
from orchestrator.lastresort.guardian import guard
sys.exit(guard(sys.argv[2:], ("-m", "tests.guest.breaker", sys.argv[1])))
"""


def test_a_serial_adapter_that_comes_back_under_another_number(tmp_path: Path) -> None:
    """While it is away no stop reaches its charger, which runs on; the first frame it then receives is a stop."""
    with vcan("vcan0"), station(tmp_path, socketcan("vcan0")) as scene:
        scene.charges()
        link, plant, service = tmp_path / "bay-1", scene.plant, scene.service
        number = link.readlink()
        plant.inject("port_gone")
        service.wait("UNCONTROLLABLE")
        taken = [os.openpty() for _ in range(3)]
        assert plant.state()["operation"] == 1
        stop_s = scene.stopped_by(lambda: None)  # "heal" plugs it in
        assert link.readlink() != number
        assert stop_s < REOPENED_S
        assert plant.state()["stops"] >= 1
        again_s = scene.charges_again()
        note("serial adapter back under another number", stop_s, again_s)
        for ends in taken:
            for fd in ends:
                os.close(fd)


@pytest.mark.parametrize(
    ("what", "reason"),
    {
        "serial ports are closed": "the adapter was unplugged",
        "CAN sockets are closed": "CAN bus can0",
    }.items(),
)
def test_the_service_mends_what_breaks_in_it(tmp_path: Path, what: str, reason: str) -> None:
    with vcan("vcan0"), station(tmp_path, socketcan("vcan0"), run=("-c", GUARD, what)) as scene:
        scene.charges()
        stop_s = scene.stopped_by(lambda: os.kill(scene.service.controller, signal.SIGUSR1))
        assert stop_s < AT_ONCE_S
        wait_until(lambda: reason in scene.service.log(), what="the reason", every_s=LOOK_S)
        again_s = scene.charges_again()
        note(what, stop_s, again_s)


def test_a_thread_that_ends_stops_the_heartbeats(tmp_path: Path) -> None:
    """It cannot be repaired: the guardian stops the chargers and ends, and systemd restarts the service."""
    what = "CAN threads end"
    with vcan("vcan0"), station(tmp_path, socketcan("vcan0"), run=("-c", GUARD, what)) as scene:
        scene.charges()
        stop_s = scene.stopped_by(lambda: os.kill(scene.service.controller, signal.SIGUSR1))
        assert stop_s < SILENCE_S + AT_ONCE_S
        assert scene.service.ended() == ACTED
        assert "guardian: the controller hangs: stopping the chargers" in scene.service.log()
        note(what, stop_s)
