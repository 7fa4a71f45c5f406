"""Serial adapters that come back under another name, and files that are closed under the running service."""

import os
import signal
from pathlib import Path

from tests.guest.stage import LOOK_S, note, socketcan, station, vcan
from tests.waiting import wait_until

AT_ONCE_S = 0.5
#: A port that is gone is opened again every second.
REOPENED_S = 2.0
GUARD = """
import sys
from orchestrator.service.guardian import guard
sys.exit(guard(sys.argv[2:], ("-m", "tests.guest.closer", sys.argv[1])))
"""


def closing(which: str) -> tuple[str, ...]:
    """How the service is started so that its files can be closed from outside."""
    return "-c", GUARD, which


def test_a_serial_adapter_that_comes_back_under_another_number(tmp_path: Path) -> None:
    """While it is away no stop reaches its charger, which goes on; the first thing that it hears then is a stop."""
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
        again_s = scene.charges_again(lambda: None)
        note("serial adapter back under another number", stop_s, again_s)
        for ends in taken:
            for fd in ends:
                os.close(fd)


def test_a_port_that_is_closed_under_the_service(tmp_path: Path) -> None:
    with vcan("vcan0"), station(tmp_path, socketcan("vcan0"), run=closing("ports")) as scene:
        scene.charges()
        stop_s = scene.stopped_by(lambda: os.kill(scene.service.controller, signal.SIGUSR1))
        assert stop_s < REOPENED_S
        again_s = scene.charges_again(lambda: None)
        note("serial port closed under the service", stop_s, again_s)


def test_a_bus_that_is_closed_under_the_service(tmp_path: Path) -> None:
    with vcan("vcan0"), station(tmp_path, socketcan("vcan0"), run=closing("buses")) as scene:
        scene.charges()
        stop_s = scene.stopped_by(lambda: os.kill(scene.service.controller, signal.SIGUSR1))
        assert stop_s < AT_ONCE_S
        wait_until(lambda: "→ STOPPING: CAN bus can0" in scene.service.log(), what="the reason", every_s=LOOK_S)
        again_s = scene.charges_again(lambda: None)
        note("CAN socket closed under the service", stop_s, again_s)
