"""A serial CAN adapter under the kernel's slcan driver: its controller goes bus-off, and it is unplugged."""

from pathlib import Path

from tests.guest.slcan import ACTIVE, BUS_OFF, slcan
from tests.guest.stage import LOOK_S, note, socketcan, station, switch
from tests.waiting import wait_until

AT_ONCE_S = 0.5


def test_a_controller_that_goes_bus_off_and_is_restarted(tmp_path: Path) -> None:
    with slcan() as adapter, station(tmp_path, socketcan(adapter.interface), adapter.theirs) as scene:
        scene.charges()
        stop_s = scene.stopped_by(lambda: adapter.say(BUS_OFF))
        assert stop_s < AT_ONCE_S
        wait_until(lambda: "CAN bus can0" in scene.service.log(), what="the reason", every_s=LOOK_S)
        assert "the controller is bus-off; check cable, terminators and bit rate" in scene.service.log()

        def restart() -> None:
            adapter.say(ACTIVE)
            switch(adapter.interface, up=False)
            switch(adapter.interface, up=True)

        again_s = scene.charges_again(restart)
        note("bus-off … interface restarted", stop_s, again_s)


def test_an_adapter_that_is_pulled_out_and_plugged_in(tmp_path: Path) -> None:
    with slcan() as adapter, station(tmp_path, socketcan(adapter.interface), adapter.theirs) as scene:
        name = adapter.interface
        scene.charges()
        stop_s = scene.stopped_by(adapter.unplug)
        assert stop_s < AT_ONCE_S
        wait_until(lambda: "is the adapter plugged in" in scene.service.bay()["battery"]["problem"], every_s=LOOK_S)
        again_s = scene.charges_again(adapter.plug)
        assert adapter.interface == name
        note("CAN adapter pulled out … plugged in", stop_s, again_s)
