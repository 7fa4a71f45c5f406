"""Whatever is granted, and whenever: no decision uses more than the bay's supply grants."""

from random import Random

import pytest

from orchestrator.core.states import ENERGISED
from orchestrator.model import Action, Cause, ControlMode, State
from tests.core.world import World, bay

FULL = Cause.of("supply_full", key="supplies.hall.limit_w", place="s.yaml:3", supply="hall", used_w=990, limit_w=999)


@pytest.mark.parametrize("control", [ControlMode.MANUAL, ControlMode.AUTOMATIC])
def test_no_decision_uses_more_than_is_granted(control: ControlMode) -> None:
    chance, world, level = Random(5), World(bay(control=control)), 0
    energised = waited = 0
    for _ in range(1500):
        if chance.random() < 0.03:
            level = chance.choice((0, 1, 2, 3, 5) if control is ControlMode.MANUAL else (0, 1))
        world.ours = {"granted": level, "granted_why": FULL}
        decision = world.tick()
        energised += decision.state in ENERGISED
        waited += decision.state is State.SUSPENDED and decision.cause.id == "waits_for_supply"
        assert level or decision.state not in ENERGISED
        assert not decision.setpoint.run or (decision.setpoint.current_step or 0) < level
        command = decision.command
        if command is not None and command.action is Action.SET_LIMIT:
            assert command.value < level
    assert energised > 50
    assert waited > 50
    assert {fault.id for one in world.decisions for fault in one.faults} == set()
