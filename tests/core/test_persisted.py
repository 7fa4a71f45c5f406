"""What survives a restart: nothing latched, held or counted is lost, and no forbidden charge begins."""

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.config.policy import Policy
from orchestrator.core.acts import MAX_RESETS
from orchestrator.core.latches import BACKOFF_S
from orchestrator.core.memory import FaultMemory, Memory, value_of
from orchestrator.core.operator import STOPPED
from orchestrator.core.persisted import COUNTERS_S, UNFINISHED, Persisted, PersistedFault, from_first_format
from orchestrator.core.safestop import LASTS_S
from orchestrator.core.states import ENERGISED, MAY_RUN
from orchestrator.model import STOP, Action, Alarm, Cause, ChargerLink, Request, Session, State
from tests.core.bays import IN, POLICY, charging, idle
from tests.core.fault_scenes import SCENES
from tests.core.said import cause, reason_of, say
from tests.core.world import World, bay

every_state = pytest.mark.parametrize("state", State)


def restarted(world: World, gap_s: float = 5.0, clock_s: float = 50.0, written: Persisted | None = None) -> World:
    """The service is killed now; another one begins after `gap_s`, on a clock that reads `clock_s`.

    Nothing stops the charger in between, unless the test does (`stopped_meanwhile`).
    """
    kept = written or Persisted.of(world.memory, world.now_s)
    world.now_s = clock_s
    world.memory = kept.aged(gap_s).memory(clock_s)
    world.reading, world.measured, world.heard_s = None, {}, clock_s
    world.charger_link = ChargerLink(online=True)
    world.battery_link = replace(world.battery_link, boot_t_s=None, heartbeat_t_s=None, heartbeat_s=None)
    world.decisions = []
    return world


def tripped_by(world: World, name: str) -> bool:
    return bool(world.decisions) and name in world.raised


def stopped_meanwhile(world: World) -> None:
    """By the guardian."""
    world.charger.resting, world.charger.run = True, False


# --- from every state -------------------------------------------------------------------------------------------------


@every_state
def test_a_restart_stops_first_and_starts_nothing_that_ran(state: State) -> None:
    world = IN[state]()
    ran = state in MAY_RUN
    assert Persisted.of(world.memory, world.now_s).running is ran
    restarted(world)
    world.deaf.clear()
    world.tick()
    assert world.decision.command == STOP
    assert world.is_in(State.UNCONTROLLABLE if state is State.UNCONTROLLABLE else State.STARTING)
    assert (world.decision.alarm is Alarm.DANGER) is ran  # nobody knows yet
    world.run(120)
    assert world.decision.alarm is not Alarm.DANGER
    if ran:
        assert not any(decision.state in ENERGISED for decision in world.decisions)
        told = world.raised["found_running"]
        assert say(UNFINISHED) in told
        assert "find out why the service ended" in told, "it ran because this service had commanded it"
        assert "find out who started it" not in told
        assert world.ask(Request.START if "will_not_stop" not in world.raised else Request.RESET) == ""
    elif state is State.TRIPPED:
        assert world.is_in(State.TRIPPED)


@every_state
def test_a_charger_that_may_run_and_is_not_heard_is_an_alarm_over_any_number_of_restarts(state: State) -> None:
    if state not in MAY_RUN:
        return
    world = IN[state]()
    for _ in range(3):
        restarted(world)
        world.charger_answers = False
        for _ in range(60):
            world.tick()
            assert world.decision.alarm is Alarm.DANGER
            assert world.decision.command == STOP
        assert world.is_in(State.UNCONTROLLABLE)
    world.charger_answers = True
    world.deaf.clear()
    world.run(12)
    assert world.decision.alarm is not Alarm.DANGER


@pytest.mark.parametrize("after_s", [0.0, 5.0, LASTS_S - 1])
def test_a_restart_shortens_no_standby_that_must_last(after_s: float) -> None:
    """A charger that runs again shows standby for seconds, too; the time begins again with each restart."""
    world = IN[State.UNCONTROLLABLE]()
    world.deaf.clear()
    world.run(after_s)
    for gap_s in (1.0, 3600.0):
        restarted(world, gap_s)
        began_s = world.now_s
        while world.now_s - began_s < LASTS_S - 0.5:
            world.tick()
            assert world.is_in(State.UNCONTROLLABLE)
            assert world.decision.alarm is Alarm.DANGER
            assert world.decision.command == STOP
            assert not world.decision.closed
            assert world.ask(Request.RESET) != ""
            assert world.ask(Request.START) != ""
    world.run(3)
    assert world.state in (State.TRIPPED, State.HELD)


def test_a_charger_out_of_control_is_persisted_before_it_is_relied_on() -> None:
    world = IN[State.UNCONTROLLABLE]()
    kept = Persisted.of(world.memory, world.now_s)
    assert replace(kept, uncontrollable=None).gist != kept.gist
    assert Persisted.of(kept.memory(world.now_s), world.now_s).uncontrollable == kept.uncontrollable


def test_the_seconds_out_of_control_count_on_over_a_restart() -> None:
    world = IN[State.UNCONTROLLABLE]()
    assert world.memory.stop.stopping_s is not None
    tried_s = world.now_s - world.memory.stop.stopping_s
    restarted(world, gap_s=60.0)
    world.run(1)
    assert f"has not obeyed the stop for {tried_s + 61:.0f} s" in reason_of(world.decision)


@pytest.mark.parametrize("request_", [Request.STOP, Request.PAUSE])
def test_a_persons_word_outlives_the_service(request_: Request) -> None:
    world = charging()
    assert world.ask(request_) == ""
    for _ in range(3):
        restarted(world)
        world.run(60)
        assert not any(decision.state in ENERGISED for decision in world.decisions)
    assert world.memory.operator.hold == (STOPPED if request_ is Request.STOP else None)
    assert world.memory.operator.paused is (request_ is Request.PAUSE)
    assert world.ask(Request.START) == ""
    world.until(State.CHARGING, 10)


MOVED = Cause.of("bay_moved_port", bay="bay-1", old_port="/dev/old", port="/dev/ttyX")


@pytest.mark.parametrize("name", ["hot_trip", "emergency"])
def test_what_was_wired_where_is_told_with_a_fault_and_after_its_reset(name: str) -> None:
    world = charging()
    fault = PersistedFault(cause("seen"), latched=name == "hot_trip", raised=60.0)
    restarted(world, written=Persisted(hold=MOVED, faults={name: fault}))
    world.run(30)
    assert world.decision.state is (State.TRIPPED if name == "hot_trip" else State.HELD)
    assert reason_of(world.decision).endswith(say(MOVED))
    assert ("seen" if name == "hot_trip" else "found running") in reason_of(world.decision)
    if name == "hot_trip":
        assert world.ask(Request.RESET) == ""
        world.run(5)
        assert world.decision.state is State.HELD
        assert reason_of(world.decision).startswith(say(MOVED))
    assert world.ask(Request.START) == ""
    world.until(State.CHARGING, 10)


# --- counters ---------------------------------------------------------------------------------------------------------


def with_finish(max_hours: float = 12.0, max_ah: float = 44.0) -> Policy:
    return replace(POLICY, finish=replace(POLICY.finish, max_hours=max_hours, max_ah=max_ah))


def in_order(world: World) -> None:
    """The service ends: it stops the charge, verifies that, and starts again."""
    world.ours = {"ending": cause("the service ends: SIGTERM")}
    world.run(3)
    assert world.state not in ENERGISED
    assert not Persisted.of(world.memory, world.now_s).running
    world.ours = {}
    restarted(world)


def killed(world: World) -> None:
    """It dies, the guardian stops the charger, and a person starts again."""
    stopped_meanwhile(world)
    restarted(world)
    world.run(3)
    assert world.is_in(State.HELD)
    assert world.ask(Request.START) == ""


def out_of_reach(world: World) -> None:
    """The BMU is silent for longer than any backoff."""
    world.battery_answers = False
    world.run(400)
    world.battery_answers = True
    world.forget("bmu_silent")  # not tested here


def cut_off(world: World) -> None:
    """The charger is not heard for a while: out of control, and back."""
    world.charger_answers = False
    world.run(10)
    assert world.is_in(State.UNCONTROLLABLE)
    world.charger_answers = True
    world.forget("charger_silent")


BREAKS: tuple[Callable[[World], None], ...] = (in_order, killed, out_of_reach, cut_off)
every_break = pytest.mark.parametrize("breaks", BREAKS, ids=lambda breaks: breaks.__name__)


@every_break
def test_no_number_of_breaks_lets_more_in_than_the_policy_allows(breaks: Callable[[World], None]) -> None:
    world = World(bay(with_finish(max_ah=0.3)), soc_pct=0.0)
    flowed_as, number = 0.0, 0
    while not tripped_by(world, "ah_limit"):
        world.until(State.CHARGING, 60)
        for _ in range(60):
            world.tick()
            flowed_as += world.reading.current_a * 0.25 if world.reading else 0.0
        if world.is_in(State.CHARGING):
            breaks(world)
        number += 1
        assert number < 12, world.decision
    assert number >= 4
    assert 0.2 <= flowed_as / 3600 <= 0.31  # some of it flows in the breaks; after a kill some is only assumed


@pytest.mark.parametrize("gap_s", [30.0, 40.0, 86400.0])
def test_what_a_kill_left_uncounted_counts_as_charged(gap_s: float) -> None:
    """Counters are written every 30 s. What flowed after the last time is in no file."""
    world = World(bay(with_finish(max_ah=0.3)), soc_pct=0.0)
    flowed_as = 0.0
    for _ in range(12):
        world.until(State.CHARGING, 60)
        written = Persisted.of(world.memory, world.now_s)
        for _ in range(int(COUNTERS_S - 1) * 4):
            world.tick()
            flowed_as += world.reading.current_a * 0.25 if world.reading else 0.0
        if tripped_by(world, "ah_limit"):
            break
        stopped_meanwhile(world)
        restarted(world, gap_s, written=written)
        world.run(3)
        if world.is_in(State.TRIPPED):
            break
        assert world.ask(Request.START) == ""
    assert "ah_limit" in world.memory.faults
    assert flowed_as / 3600 <= 0.31


def test_an_age_that_cannot_be_told_counts_as_the_longest() -> None:
    world = charging()
    kept = Persisted.of(world.memory, world.now_s)
    assert kept.session is not None
    unsure = kept.aged(0.0, COUNTERS_S).session
    assert unsure is not None
    assert unsure.unseen_s == COUNTERS_S
    rested = replace(kept, running=False).aged(100.0).session
    assert rested is not None
    assert rested.unseen_s == 0, "a charge that was stopped was counted to its end"


@every_break
def test_no_number_of_breaks_lets_a_charge_last_longer(breaks: Callable[[World], None]) -> None:
    world = World(bay(with_finish(max_hours=0.02)), soc_pct=0.0)
    world.amps = 3.0
    energised = number = 0
    while not tripped_by(world, "time_limit"):
        world.until(State.CHARGING, 60)
        for _ in range(60):
            energised += world.tick().state in ENERGISED
        if world.is_in(State.CHARGING):
            breaks(world)
        number += 1
        assert number < 12, world.decision
    assert 55 <= energised * 0.25 <= 75  # as above


def short_precharge() -> Policy:
    rule = POLICY.precharge
    assert rule is not None
    return replace(POLICY, precharge=replace(
        rule, pulse=replace(rule.pulse, max_min=0.5), continuous=replace(rule.continuous, max_min=1.0),
        rise=replace(rule.rise, within_min=0.4)))  # fmt: skip


@every_break
def test_no_number_of_breaks_lets_a_pack_be_precharged_without_a_rise(breaks: Callable[[World], None]) -> None:
    world = World(bay(short_precharge()), voltage_v=33.0)
    energised = number = 0
    while not tripped_by(world, "precharge_no_rise"):
        world.until(State.PRECHARGE_PULSE, 60)
        for _ in range(32):
            energised += world.tick().state in ENERGISED
        if world.state in ENERGISED:
            breaks(world)
        number += 1
        assert number < 12, world.decision
    assert energised * 0.25 <= 30


@every_break
def test_no_number_of_breaks_lets_a_precharge_last_longer(breaks: Callable[[World], None]) -> None:
    world = World(bay(short_precharge()), voltage_v=33.0)
    seconds, number = {State.PRECHARGE_PULSE: 0.0, State.PRECHARGE_CONTINUOUS: 0.0}, 0
    while not tripped_by(world, "precharge_too_long"):
        end_s = world.now_s + 60
        while world.tick().state not in ENERGISED:
            assert world.now_s < end_s, (world.decision, seconds)
        for _ in range(32):
            world.tick()
            world.values["voltage_v"] = 33.0 + 0.022 * sum(seconds.values())  # it rises enough, but not to the end
            if world.state in seconds:
                seconds[world.state] += 0.25
        if world.state in ENERGISED:
            breaks(world)
        number += 1
        assert number < 25, (world.decision, seconds)
    assert seconds[State.PRECHARGE_PULSE] <= 35
    assert seconds[State.PRECHARGE_CONTINUOUS] <= 70


def test_a_battery_that_was_changed_meanwhile_begins_anew() -> None:
    world = charging()
    world.run(60)
    in_order(world)
    assert world.memory.session is not None
    world.battery_answers, world.volts = False, 0.0
    world.run(5)
    assert world.is_in(State.IDLE)
    assert reason_of(world.decision) == "no battery"
    assert world.memory.session is None
    assert len([one for one in world.decisions if one.session is not None and one.session.result]) == 1


def test_another_soc_after_the_restart_is_another_battery() -> None:
    world = charging()
    world.run(10)
    in_order(world)
    world.values |= {"soc_pct": 85.0, "voltage_v": 51.5}
    world.run(30)
    assert "battery_exchanged" in world.raised
    assert world.memory.session is None
    assert not any(decision.state in ENERGISED for decision in world.decisions)


def test_a_start_ends_no_charge_that_a_restart_has_left_open() -> None:
    """HELD and IDLE are alike here: otherwise the limits would start again with each start."""
    world = charging()
    world.run(60)
    restarted(world)
    world.until(State.HELD, 10)
    world.frozen.add("soc_pct")
    world.run(5)
    assert world.ask(Request.START) == ""
    assert (world.state, reason_of(world.decision)) == (State.IDLE, "a battery is there; its SOC is not known yet")
    world.ask(Request.STOP)
    assert world.is_in(State.HELD)
    session = world.memory.session
    assert session is not None
    assert session.charged_ah > 0.2


def test_strikes_count_on_over_restarts() -> None:
    world = charging()
    for number in range(1, len(BACKOFF_S) + 1):
        world.battery_link = replace(world.battery_link, implausible={"soc_pct": cause("SOC 140 %")})
        world.tick()
        world.battery_link = replace(world.battery_link, implausible={})
        world.run(3)
        restarted(world, clock_s=1e6 * number)
        assert len(world.memory.faults["implausible"].strikes) == number
        world.tick()
        assert "implausible" in world.raised  # the backoff continues, too
        world.until(State.CHARGING, 400)
    world.battery_link = replace(world.battery_link, implausible={"soc_pct": cause("SOC 140 %")})
    world.tick()
    world.battery_link = replace(world.battery_link, implausible={})
    world.until(State.TRIPPED, 3)
    restarted(world)
    world.run(600, dt_s=1.0)
    assert world.is_in(State.TRIPPED)


def test_a_backoff_is_over_when_the_gateway_was_off_for_longer() -> None:
    world = charging()
    world.battery_link = replace(world.battery_link, implausible={"soc_pct": cause("SOC 140 %")})
    world.tick()
    world.battery_link = replace(world.battery_link, implausible={})
    world.run(3)
    restarted(world, gap_s=60.0)
    world.until(State.CHARGING, 10)


def test_resets_are_counted_over_restarts() -> None:
    world = idle()
    for _ in range(MAX_RESETS):
        world.internal = "ValueError()"
        world.until(State.TRIPPED, 3)
        assert world.ask(Request.RESET) == ""
        restarted(world, gap_s=60.0)
        world.run(2)
    world.internal = "ValueError()"
    world.until(State.TRIPPED, 3)
    assert "was reset 3 times within an hour" in world.ask(Request.RESET)


# --- any day, with restarts in it -------------------------------------------------------------------------------------

acts = st.lists(
    st.tuples(st.integers(0, len(SCENES) * 2 + 7), st.sampled_from([1, 3, 8, 40]),
              st.none() | st.floats(0.0, 4000.0)), min_size=1, max_size=10)  # fmt: skip


def do(world: World, number: int) -> None:
    if number < len(SCENES):
        SCENES[number].spoil(world)
    elif number < 2 * len(SCENES):
        SCENES[number - len(SCENES)].heal(world)
    else:
        others: tuple[Callable[[], object], ...] = (
            *(partial(world.ask, request) for request in Request),
            world.leave, world.arrive, lambda: world.deaf.add(Action.STOP), world.deaf.clear,
        )  # fmt: skip
        others[number - 2 * len(SCENES)]()


@settings(max_examples=60)
@given(acts=acts)
def test_nothing_is_lost_and_nothing_begins_by_itself(acts: list[tuple[int, int, float | None]]) -> None:
    world = charging()
    for number, ticks, gap_s in acts:
        do(world, number)
        for _ in range(ticks):
            world.tick()
        if gap_s is None:
            continue
        before, now_s, ran = world.memory, world.now_s, world.state in MAY_RUN
        restarted(world, gap_s)
        assert_kept(before, now_s, world.memory, world.now_s, gap_s)
        for _ in range(20):
            world.tick()
            assert not ran or world.state not in ENERGISED
            for name, fault in before.faults.items():
                assert not fault.latched or world.memory.faults[name].latched
            if ran:
                assert world.raised.keys() & {"found_running"}


def assert_kept(before: Memory, before_s: float, after: Memory, after_s: float, gap_s: float) -> None:
    for name, fault in before.faults.items():
        if name == "found_running" or (fault.raised_s is None and not fault.strikes):
            continue
        kept = after.faults[name]
        assert kept.latched is fault.latched
        assert kept.cause == (fault.cause if fault.raised_s is not None else None)
        for then, now in ((fault.raised_s, kept.raised_s), (fault.clean_s, kept.clean_s)):
            assert (then is None) is (now is None)
            if then is not None and now is not None:
                assert after_s - now == pytest.approx(before_s - then + gap_s)
        assert [after_s - t for t in kept.strikes] == pytest.approx([before_s - t + gap_s for t in fault.strikes])
    for name in ("hold", "paused", "full_pct", "serial"):
        assert value_of(after, name) == value_of(before, name)
    assert [name for _, name in after.operator.resets] == [name for _, name in before.operator.resets]
    if before.session is not None:
        assert after.session is not None
        aged = after_s - after.session.started_s
        assert aged == pytest.approx(before_s - before.session.started_s + gap_s)
        old, new = asdict(before.session), asdict(after.session)
        counts = ("unseen_s", "pulse_s", "continuous_s", "rise_s")  # these may have grown
        assert all(new.pop(name) >= old.pop(name) for name in counts)
        assert {**new, "started_s": 0.0} == {**old, "started_s": 0.0}


# --- forms ------------------------------------------------------------------------------------------------------------


def test_what_is_kept_twice_is_the_same() -> None:
    world = charging()
    world.internal = "ValueError()"
    world.run(2)
    kept = Persisted.of(world.memory, world.now_s)
    again = Persisted.of(kept.memory(world.now_s), world.now_s)
    assert again.gist == kept.gist
    assert replace(again, soc=None, session=None) == replace(kept, soc=None, session=None)


def test_the_gist_changes_with_what_must_be_on_disk_and_not_with_time() -> None:
    world = charging()
    gists = [Persisted.of(world.memory, world.now_s).gist]
    world.run(10)
    assert Persisted.of(world.memory, world.now_s).gist == gists[0]
    for change in (partial(world.ask, Request.PAUSE), partial(world.ask, Request.STOP),
                   partial(setattr, world, "internal", "ValueError()")):  # fmt: skip
        change()
        world.run(2)
        gists.append(Persisted.of(world.memory, world.now_s).gist)
    assert all(before != after for before, after in pairwise(gists))


@pytest.mark.parametrize("seen", [cause("something"), Cause.of("rogue_run", charger_a=2.0), None])
def test_a_latched_fault_that_this_version_does_not_know_stays_until_a_reset(seen: Cause | None) -> None:
    world = World()
    for _ in range(2):
        known = {"of_tomorrow": PersistedFault(seen, latched=True, raised=1.0)}
        restarted(world, written=Persisted(faults=known))
        world.until(State.TRIPPED, 5)
        world.run(60)
        assert world.is_in(State.TRIPPED)
        assert world.decision.alarm is Alarm.ATTENTION
    told = reason_of(world.decision)
    assert "another version of this software raised 'of_tomorrow', which this one does not know" in told
    assert "then reset" in told
    assert "not seen since" in told
    assert "gone since" not in told
    if seen is not None:
        assert say(seen.with_(past=True)) in told, "in the past tense: nothing here looks for it"
    assert Persisted.of(world.memory, world.now_s).faults["of_tomorrow"].cause == seen, "for the version that knows it"
    assert world.ask(Request.START) != ""
    assert world.ask(Request.RESET) == ""
    world.until(State.HELD, 3)
    assert "of_tomorrow" not in world.memory.faults
    assert world.ask(Request.START) == ""


def test_an_unlatched_fault_that_this_version_does_not_know_holds_the_bay() -> None:
    memory = Persisted(faults={"of_tomorrow": PersistedFault(cause("something"), raised=1.0)}).memory(100.0)
    assert memory.faults == {}
    assert say(memory.operator.hold).startswith("another version of this software raised 'of_tomorrow'")
    assert say(memory.operator.hold).endswith("something")


def test_strikes_of_a_fault_that_this_version_does_not_know_hold_nothing() -> None:
    world = restarted(World(), written=Persisted(faults={"of_tomorrow": PersistedFault(strikes=(1.0,))}))
    world.until(State.CHARGING, 10)
    assert world.memory.faults["of_tomorrow"].strikes


@pytest.mark.parametrize(
    ("name", "latched", "strikes"),
    [("internal", True, 0), ("of_yesterday", True, 0), ("system_stop", False, 0), ("implausible", True, 4)],
)
def test_the_first_format_is_read(name: str, latched: bool, strikes: int) -> None:
    fault = from_first_format(name, "text")
    assert (fault.cause, fault.latched, len(fault.strikes)) == (cause("text"), latched, strikes)
    assert set(fault.strikes) <= {0.0}, "when it was raised is not known: just now, so that no wait is cut short"
    memory = Persisted(faults={name: fault}).memory(100.0)
    assert memory.faults[name].latched is latched
    assert memory.faults[name].raised_s == 100.0


def test_an_empty_past_is_a_new_bay() -> None:
    assert Persisted().memory(5.0) == Memory()
    assert Persisted.of(Memory(), 5.0) == Persisted()


def test_a_fault_that_is_only_being_debounced_is_not_kept() -> None:
    memory = Memory(faults={"volts_disagree": FaultMemory(present=True, seen_s=2.0)}, session=Session(1.0))
    kept = Persisted.of(memory, 3.0)
    assert kept.faults == {}
    assert kept.session == Session(2.0)
