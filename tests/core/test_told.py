"""What people read of a fault: the tense, what to do, and what comes next."""

from dataclasses import replace

from orchestrator.model import Cause, State
from tests.core.bays import charging
from tests.core.said import reason_of, say
from tests.core.world import World

LATE, SILENT = Cause.of("charger_late", port="/dev/ttyX"), Cause.of("charger_no_reply", port="/dev/ttyX")


def test_a_problem_of_a_line_that_is_gone_is_told_in_the_past() -> None:
    world = charging()
    world.charger_link = replace(world.charger_link, online=False, problem=LATE)
    world.run(1)
    assert "/dev/ttyX: it answers, but not in time or not" in world.told["charger_silent"]
    world.charger_link = replace(world.charger_link, online=True, problem=None)
    world.run(4)
    assert "/dev/ttyX: it answered, but not in time or not" in world.told["charger_silent"]


def test_what_to_do_is_told_once() -> None:
    world = charging()
    world.charger_link = replace(world.charger_link, online=False, problem=SILENT)
    world.run(1)
    told = world.told["charger_silent"]
    assert told.count("check") == 1, told


def test_what_only_happened_is_not_waited_for_to_be_gone() -> None:
    world = charging()
    taken = Cause.of("settings_found", found=("38400 baud",))
    world.charger_link = replace(world.charger_link, taken_over=taken, taken_over_t_s=world.now_s)
    world.run(1)
    assert "goes on by itself 20 s after it no longer happens" in world.told["line_taken_over"]


def test_the_move_to_a_wait_tells_that_the_bay_goes_on() -> None:
    world = World(soc_pct=99.0, temperature_c=46.0)
    world.until(State.IDLE, 5)
    world.values["soc_pct"] = 97.0
    world.until(State.SUSPENDED, 5)
    moved = reason_of(world.decision)
    assert moved.endswith("; goes on by itself 10 s after it is gone")
    world.run(1)
    assert reason_of(world.decision).endswith("; goes on by itself 10 s after it is gone")


def test_a_late_bmu_is_told_with_what_to_do_and_what_comes_next() -> None:
    why = Cause.of("bmu_late", bus="can0", node_id=0x10, timeout_s=0.3)
    told = say(Cause.of("battery_not_heard", charger_v=48.0, what=why))
    assert "raise sdo_timeout_s in the station file" in told
    assert told.endswith("; the bay goes on by itself once the BMU answers")
