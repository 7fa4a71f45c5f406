"""The emulated others on a bus, and the BMU they meet: a main loop, a second master, a forger."""

import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, cast

import can
import pytest
from durand.scheduler import AsyncScheduler, get_scheduler, set_scheduler  # type: ignore[import-untyped]  # no annotations

from orchestrator.sim.background import Background
from orchestrator.sim.bmu import NAME, Bmu
from orchestrator.sim.can_wire import CanWire
from orchestrator.sim.forger import Forger, Lie, When
from orchestrator.sim.main_loop import LATEST_S, MainLoop
from orchestrator.sim.second_master import EVERYTHING, SecondMaster
from tests.proof.virtual_calls import Calls
from tests.proof.virtual_can import BusWire
from tests.proof.virtual_time import Time
from tests.sim.wires import TOLD
from tests.waiting import wait_until

NODE_ID = 0x10
READ_TEMPERATURE = bytes.fromhex("40 04 60 00 00 00 00 00")
TRUE, FORGED = "43 04 60 00 E7 FF 00 00", "43 04 60 00 C8 00 00 00"


@dataclass
class Scene:
    """A BMU on a bus in virtual time, and all frames on it."""

    main_loop: bool = False
    time: Time = field(default_factory=Time)
    heard: list[tuple[float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.bus = BusWire(self.time, Calls(self.time))
        set_scheduler(AsyncScheduler(self.time))
        for cob_id in (0x090, 0x590, 0x710, 0x7E4):
            self.bus.subscribe(cob_id, self, self._hear)
        timers, bus = cast("Any", self.time), cast("Any", self.bus)
        self.bmu = Bmu(timers, bus, NODE_ID, lambda: TOLD, main_loop=self.main_loop)
        self.bmu.port.faults.delay_s = 0.0 if self.main_loop else 0.002
        self.master = SecondMaster(self.time, self.bus, NODE_ID)
        self.run(0.1)
        self.heard.clear()

    __hash__ = object.__hash__

    def _hear(self, cob_id: int, data: bytes) -> None:
        self.heard.append((self.time.now_s, f"{cob_id:03X} {data.hex(' ').upper()}"))

    def run(self, seconds: float) -> list[str]:
        begin = len(self.heard)
        self.time.wait(self.time.now_s + seconds)
        return [frame for _, frame in self.heard[begin:]]


@pytest.fixture(autouse=True)
def _scheduler() -> Iterator[None]:
    before = get_scheduler()
    yield
    set_scheduler(before)


def test_a_main_loop_takes_in_bursts_what_came_since_its_last_round() -> None:
    scene = Scene(main_loop=True)
    delays_s: list[float] = []
    for _ in range(200):
        begun_s = scene.time.now_s
        for index in range(3):
            scene.master.read(0x6000 + index)
        frames = scene.run(0.05)
        assert [frame[7:12] for frame in frames] == ["00 60", "01 60", "02 60"]
        delays_s.append(scene.heard[-3][0] - begun_s)
    assert max(delays_s) > 0.9 * LATEST_S
    assert min(delays_s) < 0.1 * LATEST_S + 0.003
    assert max(delays_s) < LATEST_S + 0.003


def test_the_same_seed_makes_the_same_rounds() -> None:
    def rounds(seed: int) -> list[float]:
        time = Time()
        loop, taken = MainLoop(time, seed), list[float]()
        for number in range(50):
            time.call_later(0.05 * number, loop.take, lambda *_: taken.append(time.now_s), 0, b"")
        time.wait(time.now_s + 5.0)
        return taken

    assert rounds(1) == rounds(1) != rounds(2)
    assert len(rounds(1)) == 50


@pytest.mark.parametrize("blocks", [False, True], ids=["segments", "blocks"])
def test_a_name_that_takes_several_frames_is_read_to_its_end(blocks: bool) -> None:
    scene = Scene(main_loop=True)
    scene.master.read(0x1008, block=blocks)
    frames = [bytes.fromhex(frame[4:]) for frame in scene.run(1.0)]
    assert scene.master.seen.texts == 1
    assert NAME in b"".join(frame[1:] for frame in frames[1:])
    assert scene.master.seen.aborts == 0


def test_values_writes_and_refusals_are_told_apart() -> None:
    scene = Scene()
    scene.master.read(0x6000)
    scene.master.write(0x1017, 0, 1000, 2)
    scene.master.write(0x6000, 0, 1, 4)
    frames = scene.run(0.05)
    assert [frame[4:6] for frame in frames if frame.startswith("590")] == ["43", "60", "80"]
    seen = scene.master.seen
    assert (seen.asked, seen.values, seen.written, seen.aborts) == (3, 1, 1, 1)


def test_it_reads_everything_in_turn_until_it_is_told_to_stop() -> None:
    scene = Scene()
    scene.master.keep_reading(period_s=0.05)
    scene.run(0.05 * len(EVERYTHING) - 0.01)
    assert scene.master.seen.asked == len(EVERYTHING)
    assert scene.master.seen.texts == 1
    scene.master.stop()
    assert scene.run(1.0) == []
    scene.master.close()
    scene.bus.send(0x590, bytes.fromhex("43 00 60 00 00 00 00 00"))
    values = scene.master.seen.values
    scene.run(0.1)
    assert scene.master.seen.values == values


def test_a_node_that_is_guarded_answers_with_a_bit_that_alternates() -> None:
    scene = Scene()
    for expected in ("710 7F", "710 FF", "710 7F"):
        scene.master.guard()
        assert scene.run(0.01) == [expected]
    scene.master.nmt(0x81)
    assert scene.run(0.01) == ["710 00"]
    scene.master.nmt(0x01, 0)
    scene.master.guard()
    assert scene.run(0.01) == ["710 05"]  # starting with 0 again


def test_lss_and_emergencies_of_any_length() -> None:
    scene = Scene()
    scene.master.look_for_unconfigured()  # a node that has an id does not answer
    scene.bmu.short_emergency(0x4210)
    scene.bmu.emergency(0)
    frames = scene.run(0.05)
    assert frames[0] == "090 10 42"
    assert frames[1].startswith("090 00 00")


@pytest.mark.parametrize(
    ("lie", "frames"),
    [
        (Lie(), [TRUE, FORGED]),
        (Lie(when=When.FIRST), [FORGED, TRUE]),
        (Lie(size=2), [TRUE, "4B 04 60 00 C8 00 00 00"]),
        (Lie(abort=0x0602_0000), [TRUE, "80 04 60 00 00 00 02 06"]),
        (Lie(index=0x6000), [TRUE]),
        (Lie(when=When.SOMETIMES, share=0.0), [TRUE]),
    ],
)
def test_a_forger_lies_when_and_as_it_is_told(lie: Lie, frames: list[str]) -> None:
    scene = Scene()
    forger = Forger(scene.time, scene.bus, NODE_ID, lie)
    for _ in range(3):
        scene.bus.send(0x610, READ_TEMPERATURE)
        assert scene.run(0.05) == [f"590 {frame}" for frame in frames]
    assert forger.told == 3 * (len(frames) - 1)
    forger.close()
    scene.bus.send(0x610, READ_TEMPERATURE)
    assert scene.run(0.05) == [f"590 {TRUE}"]


def test_now_and_then_is_sometimes_before_and_sometimes_after() -> None:
    scene = Scene()
    forger = Forger(scene.time, scene.bus, NODE_ID, Lie(when=When.SOMETIMES, share=0.5))
    courses = []
    for _ in range(200):
        scene.bus.send(0x610, READ_TEMPERATURE)
        courses.append(tuple(frame[4:] for frame in scene.run(0.05)))
    assert {(TRUE,), (TRUE, FORGED), (FORGED, TRUE)} == set(courses)
    assert 70 < forger.told < 130


def test_one_that_nobody_asks_lies_by_its_clock() -> None:
    scene = Scene()
    forger = Forger(scene.time, scene.bus, NODE_ID, Lie(when=When.UNASKED, period_s=0.1))
    assert scene.run(1.0).count(f"590 {FORGED}") == 10
    forger.close()
    assert scene.run(1.0) == []


def test_they_work_on_a_real_bus_that_brings_frames_back() -> None:
    channel = f"others-{random.getrandbits(64):x}"
    bus = can.Bus(interface="virtual", channel=channel, receive_own_messages=True)
    with Background() as background:
        before = get_scheduler()

        def make() -> tuple[CanWire, SecondMaster, Forger, Bmu]:
            wire = CanWire(background.loop, bus)
            bmu = Bmu(background.loop, wire, NODE_ID, lambda: TOLD, main_loop=True)
            master = SecondMaster(background.loop, wire, NODE_ID)
            return wire, master, Forger(background.loop, wire, NODE_ID, Lie()), bmu

        wire, master, forger, bmu = background.call(make)
        background.call(lambda: master.read(0x6004))
        background.call(master.guard)
        wait_until(lambda: master.seen.values == 2, what="both answers")
        assert forger.told == 1
        background.call(bmu.close)
        background.call(wire.close)
        set_scheduler(before)
    bus.shutdown()
