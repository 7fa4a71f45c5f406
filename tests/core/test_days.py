"""Hours of a whole bay on lines that lose frames: it charges, reports nothing false, and never runs by mistake."""

from collections.abc import Callable

import pytest

from orchestrator.core.states import ENERGISED
from orchestrator.model import ControlMode, Request, State
from orchestrator.sim.pack import Pack
from orchestrator.sim.presets import demo
from tests.core.said import reason_of
from tests.core.site import Site
from tests.core.world import bay


class Watched(Site):
    """Checks after every tick that current flows only where it may, and within the commanded step."""

    def tick(self, request: Request | None = None) -> None:
        super().tick(request)
        decision, amps = self.decision, self.charger.current_a
        stopping = decision.state in (State.STOPPING, State.UNCONTROLLABLE)
        assert amps < 0.05 or decision.state in ENERGISED or stopping, decision
        assert self.pack.voltage_v <= 55.2
        if decision.state in ENERGISED and decision.step is not None and decision.command is None:
            assert amps <= decision.step.current_a * 1.1


def half_full() -> Pack:
    pack = Pack(capacity_ah=2.0)
    pack.set_soc(50)
    return pack


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("loss", [0.0, 0.01])
def test_an_empty_pack_is_filled_without_a_false_alarm(loss: float, seed: int) -> None:
    site = Watched(demo(), loss=loss, can_loss=loss, seed=seed)
    site.until(State.FULL, 400)
    assert site.raised == {}
    assert [state for _, state, _ in site.moves] == [
        State.IDLE,
        State.QUALIFYING,
        State.PRECHARGE_PULSE,
        State.PRECHARGE_CONTINUOUS,
        State.CHARGING,
        State.STOPPING,
        State.FULL,
    ]
    site.run(120)
    assert site.decision.state is State.FULL
    assert not site.charger.running


@pytest.mark.parametrize("control", ControlMode)
def test_automatic_or_manual_a_charge_ends_full(control: ControlMode) -> None:
    site = Watched(half_full(), bay(control=control), loss=0.01)
    site.until(State.FULL, 1200)
    assert site.raised == {}


def test_a_bad_line_costs_time_and_nothing_else() -> None:
    """One frame in ten is lost: the charge is stopped now and then, and continues by itself."""
    site = Watched(half_full(), loss=0.1, can_loss=0.01, seed=3)
    site.run(1200)
    assert set(site.raised) <= {"charger_silent"}
    assert State.UNCONTROLLABLE not in {state for _, state, _ in site.moves}


def leaves_and_comes(site: Site) -> None:
    site.plant.connected = False
    site.run(20)
    assert reason_of(site.decision) == "no battery"
    site.plant.connected = True


def is_paused(site: Site) -> None:
    site.run(30, Request.PAUSE)
    assert site.decision.state is State.SUSPENDED
    site.run(1, Request.START)


def is_stopped(site: Site) -> None:
    site.run(30, Request.STOP)
    assert site.decision.state is State.HELD
    site.run(1, Request.START)


def loses_its_line(site: Site) -> None:
    loss, site.loss = site.loss, 1.0
    site.run(10)
    assert site.decision.state is State.UNCONTROLLABLE
    site.loss = loss


def gets_hot(site: Site) -> None:
    site.pack.driven_c = 47.0
    site.run(20)
    assert site.decision.state is State.SUSPENDED
    site.pack.driven_c = 20.0
    site.run(20)


EVENTS = (leaves_and_comes, is_paused, is_stopped, loses_its_line, gets_hot)


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: event.__name__)
def test_a_charge_survives(event: Callable[[Site], None]) -> None:
    site = Watched(half_full(), loss=0.01, can_loss=0.01, seed=7)
    for _ in range(3):
        site.until(State.CHARGING, 600)
        site.run(20)
        event(site)
    site.until(State.FULL, 1800)
    assert "will_not_stop" not in site.raised


def test_a_deaf_charger_is_said_to_be_deaf_though_stops_are_repeated() -> None:
    """For a moment each stop is newer than the last reading; that must not make the charger look innocent."""
    site = Site(half_full(), loss=0.01)
    site.until(State.CHARGING, 20)
    site.run(10)
    site.charger.ignores_stop = True
    site.run(4, Request.STOP)
    assert site.decision.state is State.UNCONTROLLABLE
    assert set(site.raised) == {"will_not_stop"}
    site.charger.ignores_stop = False
    site.until(State.TRIPPED, 13)


def test_a_line_that_was_cut_is_no_disobedience() -> None:
    site = Site(half_full())
    site.until(State.CHARGING, 20)
    site.run(10)
    loses_its_line(site)
    site.run(13)
    assert set(site.raised) == {"charger_silent"}
    assert site.decision.state is State.SUSPENDED
