"""A world in each state."""

from collections.abc import Callable, Mapping

from orchestrator.model import Action, ChargeMode, Request, State
from tests.core.world import POLICY, World

S = State
__all__ = ("IN", "POLICY")


def starting() -> World:
    return World()


def running_at_the_start() -> World:
    world = World()
    world.charger.resting, world.charger.run, world.charger.mode = False, True, ChargeMode.CHARGE
    return world


def idle() -> World:
    world = World(soc_pct=99.0)
    world.until(S.IDLE)
    return world


def held() -> World:
    """An operator stopped it in mid-charge."""
    world = charging()
    world.ask(Request.STOP)
    world.until(S.HELD)
    return world


def qualifying() -> World:
    world = World()
    world.until(S.QUALIFYING)
    return world


def pulse() -> World:
    return World(voltage_v=33.0).charging(S.PRECHARGE_PULSE)


def continuous() -> World:
    return World(voltage_v=36.0).charging(S.PRECHARGE_CONTINUOUS)


def charging() -> World:
    return World().charging()


def full() -> World:
    world = charging()
    for soc in range(55, 101, 5):
        world.values["soc_pct"] = float(soc)
        world.tick()
    world.until(S.FULL)
    return world


def suspended() -> World:
    world = charging()
    world.ask(Request.PAUSE)
    world.until(S.SUSPENDED)
    return world


def offline() -> World:
    """The BMU does not answer, though a battery is there."""
    world = World()
    world.battery_answers = False
    world.until(S.OFFLINE)
    world.run(2)
    return world


def stopping() -> World:
    world = charging()
    world.deaf.add(Action.STOP)
    world.ask(Request.PAUSE)
    assert world.state is S.STOPPING
    return world


def tripped() -> World:
    world = charging()
    world.internal = "ZeroDivisionError() in step, line 1"
    world.until(S.TRIPPED)
    return world


def uncontrollable() -> World:
    world = stopping()
    world.until(S.UNCONTROLLABLE)
    return world


IN: Mapping[State, Callable[[], World]] = {
    S.STARTING: starting,
    S.OFFLINE: offline,
    S.IDLE: idle,
    S.HELD: held,
    S.QUALIFYING: qualifying,
    S.PRECHARGE_PULSE: pulse,
    S.PRECHARGE_CONTINUOUS: continuous,
    S.CHARGING: charging,
    S.FULL: full,
    S.SUSPENDED: suspended,
    S.STOPPING: stopping,
    S.TRIPPED: tripped,
    S.UNCONTROLLABLE: uncontrollable,
}
