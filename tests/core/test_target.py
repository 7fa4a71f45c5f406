"""One charge to a target that a person asks for, whatever the policy's own target and thresholds say."""

from dataclasses import replace

import pytest

from orchestrator.core import decide as decide_module
from orchestrator.core.finish import DAY_S, once
from orchestrator.core.memory import Operator
from orchestrator.core.persisted import Persisted
from orchestrator.model import Cause, Request, State
from tests.core.said import reason_of, say
from tests.core.world import POLICY, World, bay, remembering, with_full

S = State
KIM = Cause.of("started_to_by", who="kim", asked_unix_s=7.0, target_pct=100.0)


def ask(world: World, target_pct: float) -> str:
    """The answer to a start with this target; "" is yes."""
    world.ours["target_pct"] = target_pct
    answer = say(world.tick(request=Request.START, asked_by=KIM).answer)
    del world.ours["target_pct"]
    return answer


def resting(soc_pct: float, **finish: object) -> World:
    """A battery of this SOC that wants no charge."""
    policy = replace(POLICY, finish=replace(POLICY.finish, **finish))  # type: ignore[arg-type]  # its own keys
    world = World(bay(policy), soc_pct=soc_pct)
    world.until(S.IDLE)
    world.run(5)
    assert world.is_in(S.IDLE)
    return world


def rises(world: World, soc_pct: float) -> None:
    """The SOC as charging raises it."""
    world.values["soc_pct"] = soc_pct
    world.run(2)


def test_at_99_percent_it_charges_once_to_100() -> None:
    world = resting(99.0)
    assert world.ask(Request.START).startswith("nothing to start: ")
    assert ask(world, 100.0) == ""
    world.charging()
    rises(world, 99.8)
    assert world.is_in(S.CHARGING)
    rises(world, 100.0)
    world.until(S.FULL)
    assert world.memory.operator.target_pct is None
    rises(world, 99.0)
    world.run(60)
    assert world.is_in(S.FULL), "once"
    assert ask(world, 100.0) == ""
    world.until(S.CHARGING)


def test_a_start_that_another_service_forbids_leaves_no_target(monkeypatch: pytest.MonkeyPatch) -> None:
    world = resting(99.0)
    monkeypatch.setattr(decide_module, "shared", lambda _: Cause.of("port_was_locked"))
    assert ask(world, 100.0).startswith("a program that cannot be found out had the port")
    assert world.memory.operator.target_pct is None


def test_to_60_stops_at_60_and_stays_there() -> None:
    world = World(soc_pct=55.0)
    world.charging()
    assert ask(world, 60.0) == "", "while it charges"
    rises(world, 59.9)
    assert world.is_in(S.CHARGING)
    rises(world, 60.0)
    world.until(S.FULL)
    assert "SOC 60.0 % reached 60 %: charged once to 60 %, asked by kim at 7 s" in reason_of(world.decision)
    rises(world, 58.0)
    world.run(60)
    assert world.is_in(S.FULL)
    assert world.memory.battery.full_s != world.now_s and world.memory.battery.full_pct == 60.0
    rises(world, 56.0)
    world.until(S.CHARGING)
    rises(world, 60.0)
    assert world.is_in(S.CHARGING), "the next charge is one by the policy"


@pytest.mark.parametrize(
    ("soc_pct", "target_pct", "answer"),
    [
        (99.6, 99.0, "its SOC is already 99.6 %, the target is 99 %"),
        (100.0, 100.0, "its SOC is already 100.0 %, the target is 100 %"),
        (None, 100.0, "a charge to a target needs the battery's SOC, which is not known now: "),
    ],
)
def test_what_cannot_be_is_refused(soc_pct: float | None, target_pct: float, answer: str) -> None:
    world = resting(99.0)
    world.values["soc_pct"] = soc_pct
    world.run(5)
    assert ask(world, target_pct).startswith(answer)
    assert world.memory.operator.target_pct is None


def test_the_policys_own_sign_of_a_full_pack_does_not_end_it_below_the_target() -> None:
    world = World(bay(with_full(soc_pct=95.0)), soc_pct=94.0)
    world.charging()
    assert ask(world, 98.0) == ""
    world.charging()
    rises(world, 97.9)
    assert world.is_in(S.CHARGING)
    rises(world, 98.0)
    world.until(S.FULL)


def test_a_soc_that_the_policy_does_not_trust_does_not_make_it_full() -> None:
    world = World(bay(with_full(soc_pct=None)), soc_pct=99.0)
    world.until(S.IDLE)
    assert ask(world, 100.0) == ""
    world.charging()
    rises(world, 100.0)
    world.run(60)
    assert world.is_in(S.CHARGING)
    world.values["voltage_v"] = 54.0
    world.amps = 0.5
    world.until(S.FULL, 200)


def test_a_target_replaces_a_full_charge_that_is_due() -> None:
    finish = replace(POLICY.finish, target_soc_pct=80.0, full_every_days=14.0)
    world = World(bay(replace(POLICY, finish=finish)), soc_pct=58.0).charging()
    world.memory = remembering(world.memory, full_s=world.now_s - 15 * DAY_S)
    assert ask(world, 60.0) == ""
    rises(world, 60.0)
    world.until(S.FULL)
    world.run(60)
    assert world.is_in(S.FULL), "not on to 100 % at once: the full charge waits for a day"
    assert world.memory.battery.full_s == pytest.approx(world.now_s - 13 * DAY_S, abs=100)
    world.memory = remembering(world.memory, full_s=world.now_s - 14 * DAY_S)
    world.until(S.CHARGING)


def test_it_outlives_a_pause_and_a_restart_and_ends_with_a_stop() -> None:
    world = resting(99.0)
    ask(world, 100.0)
    world.charging()
    assert world.ask(Request.PAUSE) == ""
    world.until(S.SUSPENDED)
    world.memory = Persisted.of(world.memory, world.now_s).aged(5.0).memory(world.now_s)
    world.until(S.SUSPENDED)
    assert (world.memory.operator.target_pct, world.memory.operator.target_by) == (100.0, KIM)
    assert world.ask(Request.START) == ""
    world.charging()
    rises(world, 99.5)
    assert world.is_in(S.CHARGING)
    assert world.ask(Request.STOP) == ""
    world.until(S.HELD)
    assert world.memory.operator.target_pct is None
    assert world.ask(Request.START) == ""
    world.run(30)
    assert world.is_in(S.IDLE), "99.5 % is above the policy's threshold"


def test_another_battery_is_not_meant() -> None:
    world = resting(99.0)
    world.ours["waits"] = Cause.of("waits_for_turn", other="bay-2")
    assert ask(world, 100.0) == ""
    world.until(S.QUALIFYING)
    world.leave()
    world.run(10)
    assert world.memory.operator.target_pct is None
    del world.ours["waits"]
    world.arrive(soc_pct=99.0)
    world.run(30)
    assert world.is_in(S.IDLE)


def test_a_battery_that_may_be_another_is_not_meant() -> None:
    """It was not seen to leave, but tells another serial number."""
    world = resting(99.0)
    world.battery_link = replace(world.battery_link, serial=7)
    world.tick()
    world.ours["waits"] = Cause.of("waits_for_turn", other="bay-2")
    assert ask(world, 100.0) == ""
    world.battery_link = replace(world.battery_link, serial=8)
    world.tick()
    assert world.memory.operator == Operator(), "nothing is left of it, nor of who asked"


def test_a_charge_to_a_target_begins_with_that_as_its_reason() -> None:
    world = resting(99.0)
    ask(world, 100.0)
    assert world.is_in(S.QUALIFYING)
    assert reason_of(world.decision) == "SOC 99.0 % is below 100 %: charges once to 100 %, asked by kim at 7 s"


def test_a_limit_of_the_policy_holds_all_the_same() -> None:
    world = resting(99.0)
    ask(world, 100.0)
    world.charging()
    world.values["voltage_v"] = 55.3
    world.until(S.TRIPPED)
    assert world.memory.operator.target_pct is None


def test_reached_before_it_began_it_waits_for_nothing_more() -> None:
    world = resting(99.0)
    ask(world, 99.5)
    rises(world, 99.5)
    world.run(5)
    assert world.is_in(S.IDLE)
    assert reason_of(world.decision) == "SOC 99.5 % is not below 99.5 %: charges once to 99.5 %, asked by kim at 7 s"


def test_a_target_is_told_with_whoever_asked_for_it() -> None:
    """A service that knew nobody may have kept one."""
    assert once(Operator()) is None
    assert once(Operator(target_pct=60.0)) == Cause.of("charges_once", target_pct=60.0)
    told = once(Operator(target_pct=60.0, target_by=KIM))
    assert told is not None
    assert (told.id, told.param("target_pct"), told.param("who")) == ("charges_once_by", 60.0, "kim")
    because = once(Operator(target_pct=60.0, target_by=Cause(KIM.id, (*KIM.params, ("because", "cold store")))))
    assert because is not None
    assert because.param("because") == "cold store"
