"""A charge over the kernel's own CAN, and an interface that goes down and up during it."""

from pathlib import Path

from tests.guest.stage import LOOK_S, note, socketcan, station, switch, vcan
from tests.waiting import wait_until

#: The kernel reports at once that an interface is down; the rest is the guest's slow processor.
AT_ONCE_S = 0.5


def test_a_charge_from_the_first_pulse_to_full(tmp_path: Path) -> None:
    with vcan("vcan0"), station(tmp_path, socketcan("vcan0"), None, "--pack", "demo", "--speed", "2") as scene:
        scene.service.wait("FULL", timeout_s=120)
        truth = scene.plant.state()
        assert truth["soc_pct"] > 95
        assert (truth["operation"], truth["current_a"]) == (0, 0)
        wait_until(lambda: "FULL" in scene.service.path_of("bay-1"), what="the journal")
        states = ["QUALIFYING", "PRECHARGE_PULSE", "PRECHARGE_CONTINUOUS", "CHARGING", "STOPPING", "FULL"]
        assert scene.service.path_of("bay-1")[-6:] == states
        assert {fault["id"] for fault in scene.service.journal("bay-1", "fault")} == set()


def test_an_interface_that_goes_down_and_comes_up(tmp_path: Path) -> None:
    with vcan("vcan0"), station(tmp_path, socketcan("vcan0")) as scene:
        scene.charges()
        stop_s = scene.stopped_by(lambda: switch("vcan0", up=False))
        assert stop_s < AT_ONCE_S
        wait_until(lambda: "the interface is down; bring it up" in scene.service.log(), every_s=LOOK_S)
        again_s = scene.charges_again(lambda: switch("vcan0", up=True))
        note("ip link set vcan0 down … up", stop_s, again_s)
