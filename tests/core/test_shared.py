"""A port that another service, or nobody knows who, has had: the bay waits for a person."""

from dataclasses import replace

from orchestrator.model import Cause, Request, State
from tests.core.bays import charging
from tests.core.said import reason_of
from tests.core.world import World

OTHER = Cause.of("port_of_service", port="/dev/ttyX", pid=4711)
HAD = "another service had /dev/ttyX (pid 4711)"


def lose(world: World) -> None:
    world.charger_answers = False
    world.charger_link = replace(world.charger_link, online=False, problem=OTHER)


def get_back(world: World) -> None:
    world.charger_answers = True
    world.charger_link = replace(world.charger_link, online=True, problem=None)


def test_a_bay_whose_port_another_service_had_waits_for_a_person() -> None:
    for world in (World(), charging()):
        lose(world)
        world.run(10)
        assert HAD in world.ask(Request.START)
        get_back(world)
        world.until(State.HELD, 20)
        world.run(120)
        assert world.state is State.HELD
        assert HAD in reason_of(world.decision)
        assert not world.charger.running


def test_a_person_ends_the_wait() -> None:
    world = World()
    lose(world)
    world.run(10)
    get_back(world)
    world.until(State.HELD, 20)
    assert world.ask(Request.START) == ""
    world.until(State.CHARGING, 60)


def test_a_holder_who_cannot_be_found_out_may_be_another_service() -> None:
    world = charging()
    before = world.charger_link
    world.charger_link = replace(before, locked_by=Cause("program_unknown"))
    world.run(10)
    world.charger_link = before
    world.run(60)
    assert world.state is State.HELD
    assert "a program that cannot be found out had the port" in reason_of(world.decision)
