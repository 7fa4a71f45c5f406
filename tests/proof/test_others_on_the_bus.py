"""The whole service next to others on its bus, in virtual time: masters, forgers, a BMU with a main loop."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest

from orchestrator.model import BatteryLink, ControlMode, State
from orchestrator.service.bay import BayRunner
from orchestrator.sim.forger import Forger, Lie, When
from orchestrator.sim.presets import PACKS
from orchestrator.sim.second_master import EVERYTHING, SecondMaster
from tests.core.said import say
from tests.proof.play import POLICIES
from tests.proof.virtual_rig import Nature
from tests.proof.virtual_service import FIRST_NODE, World, station, world

S = State
#: Faults that only report somebody else's presence.
SAID = {"other_master", "heartbeat_set"}
START_S, END_S = 8.0, 42.0


@dataclass
class Next:
    """The history of one bay."""

    states: list[State] = field(default_factory=list)
    stopped_s: float | None = None  #: when current last flowed after START_S
    faults: set[str] = field(default_factory=set)
    link: BatteryLink = field(default_factory=BatteryLink)
    reads_s: float = 0.0  #: the greatest age of the volts while current flowed


def played(come: Callable[[World], object], *, end_s: float = END_S, main_loop: bool = True, **battery: Any) -> Next:
    """A bay charging from the start; `come(world)` is called at START_S."""
    next_transition, pack = Next(), PACKS["demo"]()
    pack.set_soc(30.0)
    the_station = station([ControlMode.MANUAL], [POLICIES["demo"]], **battery)
    with world(the_station, [Nature(pack, main_loop=main_loop, speed=0.1)], end_s=end_s + 60.0) as made:

        def look(runner: BayRunner) -> None:
            decision = made.decision()
            if next_transition.states[-1:] != [decision.state]:
                next_transition.states.append(decision.state)
            next_transition.faults |= {fault.id for fault in decision.faults}
            reading, next_transition.link = runner._snapshot.battery, runner._snapshot.battery_link
            if decision.state is S.CHARGING and reading.voltage_v is not None:
                next_transition.reads_s = max(next_transition.reads_s, made.time.now_s - reading.voltage_v.t_s)
            if (
                next_transition.stopped_s is None
                and made.time.now_s >= 1000.0 + START_S
                and not made.rigs[0].bay.charger.running
            ):
                next_transition.stopped_s = made.time.now_s - 1000.0 - START_S

        made.on_step = look
        made.time.call_later(START_S, come, made)
        made.time.call_later(end_s, made.end)
        assert made.run() == 0
    assert S.CHARGING in next_transition.states
    return next_transition


def master(on: World) -> SecondMaster:
    return SecondMaster(on.time, on.bus, FIRST_NODE)


def writes_everything(on: World) -> None:
    """Writes to read-only objects, ten times a second: each is refused."""
    one = master(on)

    def again(number: int) -> None:
        one.write(0x6000 + number % 5, 0, 1, 4)
        on.time.call_later(0.1, again, number + 1)

    again(0)


def guards(on: World) -> None:
    one = master(on)

    def again() -> None:
        one.guard()
        one.look_for_unconfigured()
        on.rigs[0].bmu.port.send(0x080 + FIRST_NODE, b"\0\0")  # "error reset", and short
        on.rigs[0].bmu.emergency(0)
        on.time.call_later(0.3, again)

    again()


def sets_heartbeat(on: World) -> None:
    master(on).write(0x1017, 0, 5000, 2)


def sets_heartbeat_unheard(on: World) -> None:
    on.rigs[0].bmu._dictionary.write(0x1017, 0, 5000)


def floods(on: World) -> None:
    def again() -> None:
        for cob_id in (0x080, 0x100, 0x123):  # SYNC, TIME, anything
            on.bus.send(cob_id, b"")
        on.time.call_later(0.01, again)

    again()


def two_masters(on: World) -> None:
    master(on).keep_reading()
    master(on).keep_reading(EVERYTHING[::-1], 0.013)


HARMLESS: Sequence[tuple[str, Callable[[World], object], str]] = (
    ("reads everything", lambda on: master(on).keep_reading(), "another CANopen master reads"),
    ("reads in blocks", lambda on: master(on).keep_reading([(0x1008, 0)], 0.1, blocks=True), "reads 0x1008"),
    ("reads in segments", lambda on: master(on).keep_reading([(0x1008, 0)], 0.02), "reads 0x1008"),
    ("reads one", lambda on: master(on).keep_reading([(0x6004, 0)], 0.004), "reads 0x6004"),
    ("two masters", two_masters, "another CANopen master reads"),
    ("writes everything", writes_everything, "another CANopen master writes"),
    ("guards", guards, ""),
    ("sets the heartbeat", sets_heartbeat, "another CANopen master writes 0x1017"),
    ("heartbeat, unheard", sets_heartbeat_unheard, ""),
    ("floods", floods, ""),
    ("nobody", lambda _: None, ""),
)


@pytest.mark.parametrize("main_loop", [False, True], ids=["immediate", "main loop"])
@pytest.mark.parametrize(("come", "said"), [one[1:] for one in HARMLESS], ids=[one[0] for one in HARMLESS])
def test_a_charge_goes_on_beside_others(come: Callable[[World], object], said: str, main_loop: bool) -> None:
    next_transition = played(come, main_loop=main_loop)
    assert next_transition.stopped_s is None or next_transition.stopped_s >= END_S - START_S - 0.1, next_transition
    assert next_transition.faults <= SAID
    assert said in say(next_transition.link.other_master)
    assert next_transition.reads_s < 0.8


def test_a_heartbeat_that_is_set_is_said_and_ours_again() -> None:
    next_transition = played(sets_heartbeat_unheard)
    assert "set the BMU's heartbeat to 5 s" in say(next_transition.link.heartbeat_set)


@pytest.mark.parametrize("when", [When.FIRST, When.AFTER, When.UNASKED])
@pytest.mark.parametrize("main_loop", [False, True], ids=["immediate", "main loop"])
def test_a_forged_temperature_stops_the_charge_at_once(when: When, main_loop: bool) -> None:
    next_transition = played(
        lambda on: Forger(on.time, on.bus, FIRST_NODE, Lie(word=350, when=when)), main_loop=main_loop, end_s=12.0
    )
    assert next_transition.stopped_s is not None
    assert next_transition.stopped_s < 0.5
    assert "temperature_invalid" in next_transition.faults


def test_one_that_lies_now_and_then_is_found_out_with_its_first_lie() -> None:
    next_transition = played(
        lambda on: Forger(on.time, on.bus, FIRST_NODE, Lie(word=350, when=When.SOMETIMES, share=0.1)), end_s=20.0
    )
    assert next_transition.stopped_s is not None
    assert next_transition.stopped_s < 5.0
