"""The emulated BMU on a `virtual` bus: the exchanges printed in its manual, its services, its faults."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count

import can
import pytest

from orchestrator.sim.background import Background
from orchestrator.sim.bmu import Bmu, Layout, words
from orchestrator.sim.can_wire import CanWire
from orchestrator.sim.pack import Readout
from tests.sim.wires import TOLD, Client, on_bus

CHANNELS = count()


@dataclass
class Scene:
    client: Client
    bmu: Bmu
    background: Background
    told: Readout = TOLD

    def read(self, index: int, sub: int = 0, within_s: float = 5.0) -> str | None:
        request = bytes((0x40, index & 0xFF, index >> 8, sub, 0, 0, 0, 0))
        return self.client.ask(0x610, request.hex(), within_s)


@contextlib.contextmanager
def bmu_on_virtual_bus(layout: Layout = Layout.FIRST_HIGH, serial: int = 0) -> Iterator[Scene]:
    channel = f"bmu-{next(CHANNELS)}"
    with on_bus(interface="virtual", channel=channel) as client, Background() as background:
        bus = can.Bus(interface="virtual", channel=channel)
        scene: Scene

        def make() -> tuple[CanWire, Bmu]:
            wire = CanWire(background.loop, bus)
            return wire, Bmu(background.loop, wire, 0x10, lambda: scene.told, layout=layout, serial=serial)

        wire, bmu = background.call(make)
        scene = Scene(client, bmu, background)
        try:
            yield scene
        finally:
            background.call(bmu.close)
            background.call(wire.close)
            bus.shutdown()


@pytest.fixture(name="scene")
def _scene() -> Iterator[Scene]:
    with bmu_on_virtual_bus() as scene:
        assert scene.client.wait(0x710) == "00", "it says its boot-up first (§2.2)"
        yield scene


def test_the_manual_s_exchanges_in_its_order(scene: Scene) -> None:
    ask = scene.client.ask
    assert ask(0x610, "40 00 60 00 00 00 00 00") == "43 00 60 00 F8 FF 40 09"
    assert ask(0x610, "2B 00 18 05 E8 03 00 00") == "60 00 18 05 00 00 00 00"
    assert ask(0x610, "40 00 18 05 00 00 00 00") == "4B 00 18 05 E8 03 00 00"
    assert ask(0x610, "2B 00 18 05 F4 01 00 00") == "60 00 18 05 00 00 00 00"
    assert ask(0x610, "40 00 18 02 00 00 00 00") == "4F 00 18 02 FF 00 00 00"
    assert ask(0x610, "2F 00 18 02 FE 00 00 00") == "60 00 18 02 00 00 00 00"


@pytest.mark.parametrize(("serial", "told"), [(0, "00 00 00 00"), (4711, "67 12 00 00")])
def test_its_serial_number_if_it_has_one(serial: int, told: str) -> None:
    with bmu_on_virtual_bus(serial=serial) as scene:
        assert scene.client.wait(0x710) == "00"
        assert scene.read(0x1018, 4) == f"43 18 10 04 {told}"


FIRST_HIGH = {
    0x6000: 0x0940_FFF8,
    0x6001: 0x0041_FFFF,
    0x6002: 0x0102_3762,
    0x6003: 0x0454_14D1,
    0x6004: 0x0000_FFE7,
}
FIRST_LOW = FIRST_HIGH | {0x6001: 0xFFFF_0041, 0x6002: 0x6237_0102, 0x6003: 0x14D1_0454}


@pytest.mark.parametrize(
    ("layout", "expected"), [(Layout.FIRST_HIGH, FIRST_HIGH), (Layout.FIRST_LOW, FIRST_LOW)], ids=["high", "low"]
)
def test_both_layouts_on_the_wire(layout: Layout, expected: dict[int, int]) -> None:
    with bmu_on_virtual_bus(layout) as scene:
        for index, word in expected.items():
            wire = bytes((0x43, index & 0xFF, index >> 8, 0)) + word.to_bytes(4, "little")
            assert scene.read(index) == wire.hex(" ").upper()


def test_what_does_not_fit_is_cut_as_firmware_does() -> None:
    told = replace(TOLD, voltage_v=700.0, time_to_full_min=1e6, soc_pct=140.0)
    assert words(told, Layout.FIRST_HIGH)[0x6000] >> 16 == 70000 - 65536
    assert words(told, Layout.FIRST_HIGH)[0x6001] & 0xFFFF == 0xFFFE
    assert words(told, Layout.FIRST_HIGH)[0x6002] >> 8 & 0xFF == 140


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("40 05 60 00 00 00 00 00", "80 05 60 00 00 00 02 06"),  # no such object
        ("40 00 18 09 00 00 00 00", "80 00 18 09 11 00 09 06"),  # no such sub-index
        ("23 00 60 00 01 00 00 00", "80 00 60 00 02 00 01 06"),  # read only
    ],
)
def test_what_cannot_be_done_is_aborted(scene: Scene, request_: str, answer: str) -> None:
    assert scene.client.ask(0x610, request_) == answer


def test_the_heartbeat_is_off_until_its_period_is_written(scene: Scene) -> None:
    assert scene.client.wait(0x710, within_s=0.15) is None
    scene.client.ask(0x610, "2B 17 10 00 32 00 00 00")
    assert [scene.client.wait(0x710) for _ in range(3)] == ["7F"] * 3
    scene.client.send(0, "01 10")
    assert scene.client.wait_for(0x710, "05")
    scene.client.send(0, "02 00")
    assert scene.client.wait_for(0x710, "04")


def test_a_stopped_node_answers_no_sdo_and_a_started_one_does(scene: Scene) -> None:
    scene.client.send(0, "02 10")
    assert scene.read(0x6000, within_s=0.15) is None
    scene.client.send(0, "01 10")
    assert scene.read(0x6000) is not None


def test_commands_for_other_nodes_are_not_obeyed(scene: Scene) -> None:
    scene.client.send(0, "82 11")
    assert scene.client.wait(0x710, within_s=0.15) is None


@pytest.mark.parametrize("command", ["81 10", "82 10", "82 00"])
def test_a_reset_says_boot_up_and_forgets_the_settings(scene: Scene, command: str) -> None:
    scene.client.ask(0x610, "2B 17 10 00 32 00 00 00")
    scene.client.ask(0x610, "2B 01 18 05 32 00 00 00")
    scene.client.send(0, command)
    assert scene.client.wait_for(0x710, "00")
    assert scene.client.wait(0x710, within_s=0.15) is None
    assert scene.read(0x1017) == "4B 17 10 00 00 00 00 00"
    assert scene.read(0x1801, 5) == "4B 01 18 05 00 00 00 00"


def test_tpdos_come_by_their_timer_and_only_when_operational(scene: Scene) -> None:
    for number in range(3):
        scene.client.ask(0x610, f"2B 0{number} 18 05 32 00 00 00")
    assert scene.client.wait(0x190, within_s=0.15) is None
    scene.client.send(0, "01 10")
    assert scene.client.wait(0x190) == "F8 FF 40 09 FF FF 41 00"
    assert scene.client.wait(0x290) == "62 37 02 01 D1 14 54 04"
    assert scene.client.wait(0x390) == "E7 FF 00 00"
    scene.client.ask(0x610, "2B 00 18 05 00 00 00 00")
    assert scene.client.wait(0x190, within_s=0.15) is None


def test_values_are_those_of_now(scene: Scene) -> None:
    scene.told = replace(TOLD, temperature_c=41.0)
    assert scene.read(0x6004) == "43 04 60 00 9A 01 00 00"


def test_foreign_and_broken_frames_do_not_disturb_it(scene: Scene) -> None:
    foreign = can.Message(arbitration_id=0x610, data=b"\x40\0\x60\0\0\0\0\0", is_extended_id=True)
    scene.client.bus.send(foreign)
    for cob_id, text in ((0x470, "70"), (0x610, ""), (0x610, "40"), (0, "81"), (0x80, ""), (0x7E5, "04")):
        scene.client.send(cob_id, text)
    assert scene.read(0x6004) == "43 04 60 00 E7 FF 00 00"


def test_the_older_protocol_carries_the_same_values(scene: Scene) -> None:
    scene.client.send(0x470, "71")
    assert scene.client.wait(0x4F0, within_s=0.1) is None, "that was no request for this node"
    scene.client.send(0x470, "70")
    assert [scene.client.wait(0x4F0) for _ in range(3)] == [
        "70 01 40 09 F8 FF 41 00",
        "70 02 FF FF 02 01 37 62",
        "70 03 54 04 D1 14 E7 FF",
    ]


def test_faults_of_a_node(scene: Scene) -> None:
    faults = scene.bmu.port.faults
    faults.aborts[0x6004] = 0x0800_0020
    assert scene.read(0x6004) == "80 04 60 00 20 00 00 08"
    faults.aborts.clear()
    faults.short.add(0x6004)
    assert scene.read(0x6004) == "4B 04 60 00 E7 FF 00 00"
    assert scene.read(0x6000) == "43 00 60 00 F8 FF 40 09"
    faults.delay_s = 0.2
    assert scene.read(0x6000, within_s=0.1) is None
    assert scene.client.wait(0x590) == "43 00 60 00 F8 FF 40 09", "it does come, late"
    faults.mute = True
    assert scene.read(0x6000, within_s=0.3) is None


def test_an_emergency(scene: Scene) -> None:
    scene.background.call(lambda: scene.bmu.emergency(0x4210, 9))
    assert scene.client.wait(0x090) == "10 42 09 00 00 00 00 00"


def test_many_bmus_share_one_bus() -> None:
    with on_bus(interface="virtual", channel="crowd") as client, Background() as background:
        bus = can.Bus(interface="virtual", channel="crowd")

        def make() -> tuple[CanWire, list[Bmu]]:
            wire = CanWire(background.loop, bus)
            return wire, [
                Bmu(background.loop, wire, node, lambda node=node: replace(TOLD, soc_pct=node))  # type: ignore[misc]  # the default is the loop's value, not a parameter
                for node in range(1, 65)
            ]

        wire, bmus = background.call(make)
        for node in (1, 33, 64):
            assert client.ask(0x600 + node, "40 02 60 00 00 00 00 00") == f"43 02 60 00 62 {node:02X} 02 01"
        client.send(0, "82 00")
        assert all(client.wait(0x700 + node) == "00" for node in range(1, 65))
        for bmu in bmus:
            background.call(bmu.close)
        background.call(wire.close)
        bus.shutdown()
