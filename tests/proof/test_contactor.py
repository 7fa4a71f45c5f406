"""The whole service on bays behind contactors, in virtual time: it never locks itself out."""

from collections.abc import Callable, Mapping

import pytest

from orchestrator.model import ControlMode, Request, State
from orchestrator.service.bay import BayRunner
from orchestrator.sim.presets import PACKS
from tests.proof.play import POLICIES
from tests.proof.virtual_rig import Nature
from tests.proof.virtual_service import World, station, world

S = State


def played(
    happenings: Mapping[float, Callable[[World], object]],
    end_s: float,
    soc_pct: float,
    control: ControlMode = ControlMode.MANUAL,
) -> list[tuple[State, bool]]:
    """The history of the demo's bay: each change of state or contactor."""
    next_transition: list[tuple[State, bool]] = []

    def look(_: BayRunner) -> None:
        now = (made.decision().state, made.rigs[0].bay.connected)
        if next_transition[-1:] != [now]:
            next_transition.append(now)

    pack = PACKS["demo"]()
    pack.set_soc(soc_pct)
    the_station = station([control], [POLICIES["demo"]], contactors=True)
    with world(the_station, [Nature(pack, control)], end_s=end_s + 60.0) as made:
        made.rigs[0].bay.connected = False  # an undriven line with its pull-down
        made.on_step = look
        for t_s, happen in {**happenings, end_s: World.end}.items():
            made.time.call_later(t_s, happen, made)
        assert made.run() == 0
        assert not made.rigs[0].bay.connected
        return next_transition


def asks(request: Request) -> Callable[[World], object]:
    return lambda on: on.ask(request)


def deafens(on: World) -> None:
    on.rigs[0].bay.charger.ignores_stop = True


def mends(on: World) -> None:
    on.rigs[0].bay.charger.ignores_stop = False


def test_from_the_start_to_a_full_charge_and_back() -> None:
    """From the bottom of the deep discharge through every state; recharged after some use."""
    assert played({120.0: lambda on: on.rigs[0].bay.pack.set_soc(50.0)}, 160.0, soc_pct=-100.0) == [
        (S.STARTING, False),
        (S.OFFLINE, True),
        (S.IDLE, True),
        (S.QUALIFYING, True),
        (S.PRECHARGE_PULSE, True),
        (S.PRECHARGE_CONTINUOUS, True),
        (S.CHARGING, True),
        (S.STOPPING, True),
        (S.FULL, True),
        (S.QUALIFYING, True),
        (S.CHARGING, True),
        (S.STOPPING, True),
        (S.FULL, True),
        (S.IDLE, True),
    ]


@pytest.mark.parametrize("control", ControlMode)
def test_a_charger_that_was_out_of_control_can_charge_again(control: ControlMode) -> None:
    happenings: dict[float, Callable[[World], object]] = {
        8.0: deafens,
        9.0: asks(Request.STOP),
        20.0: mends,
        35.0: asks(Request.RESET),  # in standby for 10 s
        36.0: asks(Request.START),
    }
    assert played(happenings, 50.0, 20.0, control) == [
        (S.STARTING, False),
        (S.OFFLINE, True),
        (S.IDLE, True),
        (S.QUALIFYING, True),
        (S.CHARGING, True),
        (S.STOPPING, True),
        (S.UNCONTROLLABLE, False),
        (S.TRIPPED, False),
        (S.HELD, True),
        (S.QUALIFYING, True),
        (S.CHARGING, True),
        (S.STOPPING, True),
        (S.SUSPENDED, True),
    ]
