"""One decision from facts made by hand: where a bay goes, its reason, what is remembered and what is commanded."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from orchestrator.core import latches
from orchestrator.core.active import active_faults
from orchestrator.core.decide import decide
from orchestrator.core.facts import Facts
from orchestrator.core.history import entered, update_history
from orchestrator.core.history.battery import Warmth, thinned
from orchestrator.core.machine import Trigger
from orchestrator.core.memory import FaultMemory, Memory, Sequence, Still, value_of
from orchestrator.core.next_transition import Next, next_transition
from orchestrator.core.rules import Rules
from orchestrator.core.sequence import RESUME, RUN, next_command
from orchestrator.model import (
    STOP,
    Cause,
    ChargeMode,
    Command,
    ControlMode,
    CurrentStep,
    Decision,
    Measurement,
    Operation,
    Precharge,
    Sent,
    Session,
    Setpoint,
    Snapshot,
    State,
)
from tests.core.edges import AT, BMU, CONTINUOUS, NO_PRECHARGE, NOW_S, PULSE, Edge, ago, marked, raised, session
from tests.core.said import cause, said
from tests.core.world import bay


def course_of(f: Facts) -> Next:
    return next_transition(f, active_faults(f.memory, f.now_s, "bay-1", f))


#: What a bay does that cannot hear its BMU.
GOES_ON = "; the bay goes on by itself once the BMU answers"


def goes(f: Facts) -> tuple[Trigger | None, Cause]:
    return course_of(f)[:2]


def holding(**changes: Any) -> dict[str, Any]:
    return {"step": CurrentStep(2, 8.0, cause("because")), **changes}


def reached(seconds: float) -> dict[str, Any]:
    return {"reached_s": ago(seconds), "session": Session(ago(60), rise_v=33.0)}


def precharged(seconds: float) -> dict[str, Any]:
    return {"session": Session(ago(9999), pulse_s=seconds, rise_v=33.0)}


STANDS_BY = {"operation": Operation.STOPPED, "current_a": 0.0}
STOP_SENT = {"stop_sent_s": ago(1)}
AT_REST: dict[str, Any] = {"charger": STANDS_BY, "charger_link": STOP_SENT}
SILENT_BMU: dict[str, Any] = {
    "bmu": dict.fromkeys(("voltage_v", "current_a", "status", "temperature_c", "soc_pct", "soh_pct")),
    "bmu_link": {"online": False},
}
FULL, SUSPENDED, OFFLINE = State.FULL, State.SUSPENDED, State.OFFLINE
IDLE, HELD = State.IDLE, State.HELD
QUALIFYING, STOPPING, STARTING, TRIPPED = State.QUALIFYING, State.STOPPING, State.STARTING, State.TRIPPED
NO_RULE = "precharge without a rule for it, or without the pack's voltage"
CHECKING = "checking charger and battery before a charge"
CUT = "CUT THE MAINS of this charger (/dev/ttyX) now: {} {}; the BMU sees 0.0 A"
RUNS_ON = CUT.format("it has not obeyed the stop for 3 s:", "{}")
NEVER = CUT.format("nothing has proved for 3 s that it obeyed the stop:", "{}")

GOES = (
    Edge(goes, (None, "step 3 (8.0 A): because"), holding()),
    Edge(goes, (None, "step 3 (8.0 A): because; a higher step is allowed, and taken after 60 s "
                f"({AT('current.raise_after_s')})"), holding(raise_s=ago(9))),
    Edge(goes, (None, "step 3 (8.0 A): because"), holding(**raised("soc_jump"))),
    Edge(goes, (None, "step 3 (8.0 A): because; text of status_limit; charging goes on, on the lowest step"),
         holding(**raised("status_limit"))),
    Edge(goes, (None, "the charger charges by itself (automatic mode)"), control=ControlMode.AUTOMATIC),
    Edge(goes, (None, "as before"), {"cause": cause("as before")}),
    Edge(goes, (Trigger.STOP, "paused by the operator"), holding(paused=True)),
    Edge(goes, (Trigger.STOP, "held"), holding(paused=True, hold=cause("held"))),
    Edge(goes, (Trigger.STOP, f"full: SOC 100 % reached 100 % ({AT('finish.full.soc_pct')})"), bmu={"soc_pct": 100.0}),
    Edge(goes, (None, f"the pack is below 39 V: pulse precharge ({AT('precharge.pulse')})"), reached(1.9), PULSE,
         bmu={"voltage_v": 35.1}),
    Edge(goes, (None, f"the pack is below 39 V: pulse precharge ({AT('precharge.pulse')})"), reached(9), PULSE,
         bmu={"voltage_v": 35.0}),
    Edge(goes, (Trigger.CONTINUE, f"the pack reached 35.1 V ({AT('precharge.pulse.until_v')})"), reached(2), PULSE,
         bmu={"voltage_v": 35.1}),
    Edge(goes, (None, f"the pack is below 39 V: pulse precharge ({AT('precharge.pulse')})"), precharged(599.9), PULSE,
         bmu={"voltage_v": 35.0}),
    Edge(goes, (Trigger.CONTINUE, f"10 min of pulses ({AT('precharge.pulse.max_min')})"), precharged(600), PULSE,
         bmu={"voltage_v": 35.0}),
    Edge(goes, (None, f"the pack is below 39 V: continuous precharge ({AT('precharge.continuous')})"), precharged(999),
         CONTINUOUS, bmu={"voltage_v": 38.9}),
    Edge(goes, (Trigger.STOP, NO_RULE), {}, PULSE, bmu={"voltage_v": 35.0}),
    Edge(goes, (Trigger.CHARGE, f"the pack reached 39 V ({AT('precharge.below_v')})"), reached(2), CONTINUOUS,
         bmu={"voltage_v": 39.0}),
    *(Edge(goes, (Trigger.STOP, NO_RULE), precharged(0), PULSE, **how)
      for how in ({"policy": NO_PRECHARGE}, {"bmu": {"voltage_v": None}})),
    Edge(goes, (None, "stopped for it"), {"cause": cause("stopped for it")}, STOPPING, 2.9),
    Edge(goes, (Trigger.GIVE_UP, RUNS_ON.format("it delivers 10.00 A")), state=STOPPING, state_s=3),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("no answer on /dev/ttyX; 10.00 A, last heard 0 s ago")), state=STOPPING,
         state_s=3, charger_link={"online": False}),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("no answer on /dev/ttyX; 10.00 A, last heard 9 s ago")), state=STOPPING,
         state_s=3, charger={"t_s": ago(9)}),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("unplugged; 10.00 A, last heard 0 s ago")), state=STOPPING, state_s=3,
         charger_link={"online": False, "problem": cause("unplugged")}),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("its status does not show a standby that lasts")), state=STOPPING,
         state_s=3, charger={"operation": None, "current_a": 0.0}),
    Edge(goes, (Trigger.LOSE, "the charger on /dev/ttyX does not answer"), {}, STARTING, 3,
         charger={"t_s": ago(9)}, charger_link={"online": False}),
    Edge(goes, (None, "still looking"), {"cause": cause("still looking")}, STARTING, 2.9, charger={"t_s": ago(9)},
         charger_link={"online": False}),
    Edge(goes, (Trigger.STOP, "the charger runs though it was not commanded to"), state=IDLE),
    Edge(goes, (None, "the charger is being stopped before anything else"), state=OFFLINE, charger=STANDS_BY),
    *(Edge(goes, (None, "the charger on /dev/ttyX does not answer"), {}, OFFLINE, **how) for how in (
        {"charger": {**STANDS_BY, "t_s": ago(9)}}, {"charger": STANDS_BY, "charger_link": {"online": False}})),
    Edge(goes, (Trigger.LOSE, "the charger on /dev/ttyX does not answer"), {}, IDLE, charger={"t_s": ago(9)}),
    Edge(goes, (Trigger.HOLD, "held; to go on: orchestrator start bay-1"), {"hold": cause("held")}, FULL, **AT_REST),
    Edge(goes, (None, "held; to go on: orchestrator start bay-1"), {"hold": cause("held")}, HELD, **AT_REST),
    Edge(goes, (Trigger.SUSPEND, "paused by the operator; to go on: orchestrator start bay-1"), {"paused": True}, IDLE,
         **AT_REST),
    Edge(goes, (Trigger.RESET, "reset by the operator; to go on: orchestrator start bay-1"), {}, TRIPPED, **AT_REST),
    Edge(goes, (Trigger.LOSE, "0.0 V at the charger, but the BMU (node 0x10) does not answer" + GOES_ON), {}, IDLE,
         **SILENT_BMU, charger={**STANDS_BY, "voltage_v": 0.0}, charger_link=STOP_SENT, snapshot={"connected": False}),
    Edge(goes, (Trigger.LOSE, "48.0 V at the charger, but the BMU (node 0x10) has just booted" + GOES_ON), {}, IDLE,
         **AT_REST, bmu=SILENT_BMU["bmu"], bmu_link={"online": False, "boot_t_s": ago(1)}),
    Edge(goes, (Trigger.LOSE, "48.0 V at the charger, but unplugged" + GOES_ON), {}, IDLE, **AT_REST,
         bmu=SILENT_BMU["bmu"], bmu_link={"online": False, "problem": cause("unplugged")}),
    Edge(goes, (None, "no battery"), {}, IDLE, **SILENT_BMU, charger={**STANDS_BY, "voltage_v": 0.0},
         charger_link=STOP_SENT),
    Edge(goes, (None, "a battery is there; its SOC is not known yet"), {}, IDLE, **AT_REST, bmu={"soc_pct": None}),
    Edge(goes, (None, f"SOC 98 % is not below 98 % ({AT('start.soc_below_pct')})"), {}, IDLE, **AT_REST,
         bmu={"soc_pct": 98.0}),
    Edge(goes, (Trigger.QUALIFY, f"SOC 97 % is below 98 % ({AT('start.soc_below_pct')})"), {}, IDLE, **AT_REST,
         bmu={"soc_pct": 97.0}),
    Edge(goes, (Trigger.QUALIFY, f"SOC 99 % is below 100 % ({AT('finish.target_soc_pct')})"), session(), SUSPENDED,
         **AT_REST, bmu={"soc_pct": 99.0}),
    Edge(goes, (None, f"full: the battery was charged full here, and is there since; SOC 95 % now, charged again below "
                f"95 % ({AT('recharge.soc_below_pct')})"), {"full_pct": 100.0}, FULL,
         **AT_REST, bmu={"soc_pct": 95.0}),
    Edge(goes, (None, f"full: the battery was charged full here, and is there since; SOC 87 % now, charged again below "
                f"87 % ({AT('recharge.soc_below_pct')})"), {"full_pct": 90.0}, FULL,
         **AT_REST, bmu={"soc_pct": 87.0}),
    Edge(goes, (Trigger.QUALIFY, f"SOC 86 % is below 87 % ({AT('recharge.soc_below_pct')})"), {"full_pct": 90.0}, FULL,
         **AT_REST, bmu={"soc_pct": 86.0}),
    Edge(goes, (None, "waiting for fresh values: SOH"), {}, QUALIFYING, **AT_REST, bmu={"soh_pct": None}),
    Edge(goes, (None, "waiting for the contactor, behind which charger and battery cannot be compared"), {}, QUALIFYING,
         **AT_REST, snapshot={"connected": False}),
    Edge(goes, (None, CHECKING), {}, QUALIFYING, **AT_REST),
    Edge(goes, (None, CHECKING), {"qualified_s": ago(1.9)}, QUALIFYING, **AT_REST),
    Edge(goes, (Trigger.CHARGE, "qualified: 48.00 V, SOC 50 %, 20.0 °C"), {"qualified_s": ago(2)}, QUALIFYING,
         **AT_REST),
    Edge(goes, (Trigger.CHARGE, "qualified: 39.00 V, SOC 50 %, 20.0 °C"), {"qualified_s": ago(2)}, QUALIFYING,
         **AT_REST, bmu={"voltage_v": 39.0}),
    Edge(goes, (Trigger.PULSE, f"the pack has 38.90 V, below 39 V ({AT('precharge.below_v')})"),
         {"qualified_s": ago(2)}, QUALIFYING, **AT_REST, bmu={"voltage_v": 38.9}),
)  # fmt: skip


@pytest.mark.parametrize(("minutes", "rise_s", "rise_v"), [(5.0, 0.0, 35.0), (4.99, 4.99 * 60, 34.0)])
def test_a_pack_that_rose_is_looked_at_from_then_on(minutes: float, rise_s: float, rise_v: float) -> None:
    f = Edge(goes, None, marked(minutes, 34.0), PULSE, bmu={"voltage_v": 35.0}).facts
    session = course_of(f).changes["session"]
    assert (session.rise_s, session.rise_v) == (rise_s, rise_v)


# --- state carried between decisions ----------------------------------------------------------------------------------


def followed(name: str) -> Callable[[Facts], object]:
    """The memory's value of this name after these facts."""

    def rule(f: Facts) -> object:
        return value_of(update_history(f, 0.25).memory, name)

    rule.__name__ = name
    return rule


idle_s, still_values, peak = followed("idle_s"), followed("still"), followed("peak")
search_s, wake_s = followed("search_s"), followed("wake_s")
charge_step, exchange, counted = followed("charge_step"), followed("exchange"), followed("session")
STILL = Still(NOW_S, 48.0, 10.0, 48.0, 10.0)
BEGUN = Session(
    ago(100), energised_s=90.0, charged_ah=1.0, charged_wh=48.0, soc_start_pct=40.0, soc_pct=49.0, step_changes=1
)
NOW = replace(BEGUN, elapsed_s=100.0, energised_s=90.25, soc_pct=50.0)
FOLLOWS = (
    Edge(idle_s, 0.0, charger={"current_a": 0.1}),
    Edge(idle_s, 0.25, charger={"current_a": 0.09}),
    Edge(idle_s, 5.25, {"idle_s": 5.0}, charger={"current_a": 0.0}),
    Edge(idle_s, 4.9375, {"idle_s": 5.0}),
    Edge(idle_s, 5.0, {"idle_s": 5.0}, charger={"t_s": ago(9)}),  # unknown is neither
    Edge(idle_s, 0.0, charger={"current_a": 0.0, "operation": Operation.STOPPED}),
    Edge(idle_s, 0.0, charger={"current_a": 0.0, "charge_mode": ChargeMode.BATTERY_SEARCH}),
    Edge(search_s, 0.25, charger={"charge_mode": ChargeMode.BATTERY_SEARCH}),
    Edge(search_s, 0.0, charger={"charge_mode": ChargeMode.BATTERY_SEARCH, "operation": Operation.STOPPED}),
    Edge(search_s, 0.9375, {"search_s": 1.0}),
    *(Edge(wake_s, 0.25, charger={"charge_mode": mode})
      for mode in (ChargeMode.BATTERY_RECOVERY, ChargeMode.PRECHARGE)),
    Edge(wake_s, 0.9375, {"wake_s": 1.0}),
    Edge(still_values, STILL),
    Edge(still_values, replace(STILL, t_s=ago(9)), {"still": replace(STILL, t_s=ago(9))}),
    Edge(still_values, STILL, {"still": replace(STILL, t_s=ago(9), volts=48.1)}),
    Edge(still_values, STILL, {"still": replace(STILL, t_s=ago(9), amps=10.1)}),
    Edge(still_values, replace(STILL, amps=1.1), charger={"current_a": 1.1}),
    Edge(still_values, None, {"still": STILL}, charger={"current_a": 1.0}),
    Edge(still_values, None, {"still": STILL}, charger={"t_s": ago(9)}),
    Edge(still_values, None, {"still": STILL}, charger={"current_a": math.nan}),
    *(Edge(still_values, None, {"still": STILL}, bmu={name: None}) for name in ("voltage_v", "current_a")),
    Edge(peak, (NOW_S, 50.0)),
    Edge(peak, (ago(9), 50.1), {"peak": (ago(9), 50.1)}),
    Edge(peak, (NOW_S, 50.0), {"peak": (ago(9), 50.0)}),
    Edge(peak, None, {"peak": (ago(9), 50.1)}, state=State.STOPPING),
    Edge(peak, None, {"peak": (ago(9), 50.1)}, bmu={"current_a": 1.0}),
    Edge(peak, None, {"peak": (ago(9), 50.1)}, bmu={"current_a": None}),
    Edge(peak, None, {"peak": (ago(9), 50.1)}, bmu={"soc_pct": None}),
    Edge(charge_step, None, {"charge": (ago(3), 42.0)}),
    Edge(charge_step, (NOW_S, "the SOC went from 42 to 50 % in 3 s"), {"charge": (ago(3), 41.9)}),
    Edge(charge_step, (NOW_S, "the SOC went from 58 to 50 % in 3 s"), {"charge": (ago(3), 58.1)}),
    Edge(charge_step, None, {"charge": (ago(3), None)}),
    Edge(charge_step, None, {"charge": (ago(3.1), 1.0)}),
    Edge(exchange, None, {"charge": (ago(3), 1.0)}),
    Edge(exchange, None, {"charge": (ago(30), 39.0)}),
    Edge(exchange, (NOW_S, "the SOC went from 39 to 50 % in 30 s"), {"charge": (ago(30), 38.9)}),
    Edge(exchange, None, {"charge": (ago(30), 1.0), "boots": 1}),
    Edge(counted, None),
    Edge(counted, NOW, {"session": BEGUN, "counted_t_s": NOW_S}),
    Edge(counted, NOW, {"session": BEGUN, "counted_t_s": None}),
    Edge(counted, replace(NOW, charged_ah=1 + 10 / 3600, charged_wh=48 + 480 / 3600),
         {"session": BEGUN, "counted_t_s": ago(1)}),
    Edge(counted, replace(NOW, charged_ah=1 + 10 * 1.5 / 3600, charged_wh=48 + 10 * 48 * (1.5 / 3600)),
         {"session": BEGUN, "counted_t_s": ago(9)}),
    Edge(counted, NOW, {"session": BEGUN, "counted_t_s": ago(1)}, charger={"t_s": ago(9)}),
    Edge(counted, replace(NOW, energised_s=90.0), {"session": BEGUN, "counted_t_s": ago(1)}, State.STOPPING,
         charger={"operation": Operation.STOPPED, "current_a": 0.4}),
    Edge(counted, replace(NOW, soc_pct=49.0), {"session": BEGUN, "counted_t_s": NOW_S}, bmu={"soc_pct": None}),
)  # fmt: skip


def test_the_first_step_lasts_no_time() -> None:
    f = Edge(goes, None, {"session": BEGUN, "counted_t_s": NOW_S}).facts
    assert update_history(f, 0.0).memory.session == replace(NOW, energised_s=90.0)


@pytest.mark.parametrize(
    ("t_s", "value"), [(ago(1.5), 48.0), (ago(1.51), None), (NOW_S + 1.5, 48.0), (NOW_S + 1.51, None)]
)
def test_a_value_counts_while_it_is_fresh_and_not_from_the_future(t_s: float, value: float | None) -> None:
    battery = replace(BMU, voltage_v=Measurement(48.0, t_s))
    assert Facts.of(NOW_S, Snapshot(battery=battery), Memory(), Rules.of(bay())).pack_v == value


def test_a_fault_of_the_first_moment_is_shown_from_then_on() -> None:
    (fault,) = active_faults(Memory(faults={"soh_low": FaultMemory(raised_s=0.0)}), 9.0, "bay-1")
    assert fault.since_s == 0.0


@pytest.mark.parametrize(
    ("kept", "after"),
    [
        ((), ((1000.0, 30.0),)),
        (((990.1, 20.0),), ((990.1, 20.0),)),
        (((990.0, 20.0),), ((990.0, 20.0), (1000.0, 30.0))),
        (((810.0, 20.0), (990.0, 25.0)), ((810.0, 20.0), (990.0, 25.0), (1000.0, 30.0))),
        (((809.9, 20.0), (990.0, 25.0)), ((990.0, 25.0), (1000.0, 30.0))),
    ],
)
def test_temperatures_are_kept_ten_seconds_apart_for_three_minutes(kept: Warmth, after: Warmth) -> None:
    assert thinned(kept, (1000.0, 30.0)) == after


@pytest.mark.parametrize(("charger", "counted_t_s"), [({}, NOW_S), ({"t_s": ago(9)}, None)])
def test_a_session_counts_from_its_beginning(charger: dict[str, Any], counted_t_s: float | None) -> None:
    f = Edge(goes, None, state=QUALIFYING, bmu={"voltage_v": None}, charger=charger).facts
    memory = entered(f, State.CHARGING, cause("begun"))
    assert memory.session == Session(NOW_S, soc_start_pct=50.0, soc_pct=50.0)
    assert memory.charger.counted_t_s == counted_t_s


@pytest.mark.parametrize(
    ("state", "before", "now"),
    [
        (PULSE, Session(ago(9), rise_s=7.0), Session(ago(9), rise_s=0.0, rise_v=33.0)),
        (PULSE, Session(ago(9), rise_s=7.0, rise_v=32.9), Session(ago(9), rise_s=7.0, rise_v=32.9)),
        (State.CHARGING, Session(ago(9)), Session(ago(9))),
    ],
)
def test_a_rise_counts_from_the_first_precharge_of_a_charge(state: State, before: Session, now: Session) -> None:
    f = Edge(goes, None, {"session": before}, QUALIFYING, bmu={"voltage_v": 33.0}).facts
    assert entered(f, state, cause("begun")).session == now


boots = followed("boots")
BOOTED: dict[str, Any] = {"bmu_link": {"boots": 3}}

# --- the fault memory -------------------------------------------------------------------------------------------------


def faults_after(name: str) -> Callable[[Facts], object]:
    """What is remembered of one row of the fault table after these facts."""

    def rule(f: Facts) -> object:
        return latches.update(f).get(name)

    rule.__name__ = name
    return rule


implausible, soh_low, emergency = map(faults_after, ("implausible", "soh_low", "emergency"))
charger_silent, bmu_silent = map(faults_after, ("charger_silent", "bmu_silent"))
UNPLUGGED: dict[str, Any] = {"charger_link": {"online": False, "problem": cause("unplugged")}}
DEPARTED: dict[str, Any] = {**SILENT_BMU, "charger": {**STANDS_BY, "voltage_v": 0.0}, "charger_link": STOP_SENT}
SILENT = cause("unplugged")
DEBOUNCED = FaultMemory(present=True, seen_s=9, polls=9, poll_t_s=ago(1))


def faults(**rows: FaultMemory) -> dict[str, Any]:
    return {"faults": rows}


BOTH = faults(bmu_silent=FaultMemory(raised_s=ago(9)), emergency=FaultMemory(raised_s=ago(9)))
LATCHES = (
    Edge(implausible, FaultMemory(strikes=(ago(3599),)), faults(implausible=FaultMemory(strikes=(ago(3599),)))),
    Edge(implausible, None, faults(implausible=FaultMemory(strikes=(ago(3600),)))),
    Edge(implausible, FaultMemory(strikes=(ago(9),)),
         faults(implausible=FaultMemory(raised_s=ago(9), clean_s=ago(20), strikes=(ago(9),)))),
    Edge(soh_low, None, faults(soh_low=FaultMemory(raised_s=ago(9), clean_s=ago(5)))),
    Edge(soh_low, FaultMemory(raised_s=ago(9), clean_s=ago(4.9), poll_t_s=ago(1)),
         faults(soh_low=replace(DEBOUNCED, raised_s=ago(9), clean_s=ago(4.9)))),
    Edge(soh_low, FaultMemory(raised_s=ago(9), clean_s=NOW_S, poll_t_s=ago(1)),
         faults(soh_low=replace(DEBOUNCED, raised_s=ago(9)))),
    Edge(charger_silent, replace(DEBOUNCED, raised_s=NOW_S, cause=SILENT, now=SILENT, strikes=(NOW_S,), polls=10,
                                 poll_t_s=NOW_S), faults(charger_silent=DEBOUNCED), **UNPLUGGED),
    Edge(charger_silent, None, faults(charger_silent=DEBOUNCED), STOPPING, **UNPLUGGED),
    Edge(charger_silent, None, {}, STOPPING, **UNPLUGGED),
    Edge(emergency, FaultMemory(raised_s=ago(9), clean_s=NOW_S, unheard=True), BOTH, IDLE, **DEPARTED),
    Edge(bmu_silent, None, BOTH, IDLE, **DEPARTED),
)  # fmt: skip

# --- commands ---------------------------------------------------------------------------------------------------------


def commands(f: Facts) -> Command | None:
    return ordered(f)[0]


def ordered(f: Facts) -> tuple[Command | None, Sequence]:
    return next_command(f, Setpoint(True, 4, ChargeMode.CHARGE, Precharge.OFF))


RESUMED = {"resumed": False, "ran": False, "resume_s": ago(2), "command": RUN, "command_s": ago(1)}


def sent(t_s: float, command: Command = RESUME) -> dict[str, Any]:
    return {"sent": Sent(command, t_s)}


ORDERS = (
    Edge(commands, None),
    Edge(commands, RESUME, RESUMED, charger=STANDS_BY),
    Edge(commands, RESUME, RESUMED, charger=STANDS_BY, charger_link=sent(ago(2.1))),
    Edge(commands, RUN, RESUMED, charger=STANDS_BY, charger_link=sent(ago(2))),
    Edge(commands, RUN, RESUMED, charger=STANDS_BY, charger_link=sent(ago(0.1))),
    Edge(commands, RESUME, RESUMED, charger=STANDS_BY, charger_link=sent(NOW_S)),
    Edge(commands, RESUME, RESUMED, charger=STANDS_BY, charger_link=sent(ago(1), RUN)),
    Edge(commands, RUN, {**RESUMED, "resumed": True, "command_s": ago(1.4)}, charger=STANDS_BY),
    Edge(commands, RESUME, {**RESUMED, "resumed": True, "command_s": ago(1.5)}, charger=STANDS_BY),
    Edge(commands, RUN, {**RESUMED, "resumed": True, "command_s": ago(1.5), "tries": 1}, charger=STANDS_BY),
)  # fmt: skip


def test_a_new_order_has_not_been_tried() -> None:
    f = Edge(commands, RUN, {**RESUMED, "resumed": True, "command": RESUME, "tries": 4}, charger=STANDS_BY).facts
    command, sequence = ordered(f)
    assert command == RUN
    assert (sequence.command, sequence.command_s, sequence.tries) == (RUN, NOW_S, 0)


# --- the whole decision -----------------------------------------------------------------------------------------------


def whole(edge: Edge) -> tuple[Decision, Memory]:
    return decide(NOW_S, edge.facts.snapshot, edge.facts.memory, edge.facts.rules)


def test_from_stage_to_stage_the_charge_goes_on() -> None:
    memory = {**reached(2), "resumed": True, "session": BEGUN, "last_s": ago(0.25), "counted_t_s": NOW_S}
    decision, after = whole(Edge(goes, None, memory, PULSE, bmu={"voltage_v": 35.1}, charger={"voltage_v": 35.1}))
    assert decision.state is CONTINUOUS
    assert after.sequence.resumed
    assert decision.session == replace(NOW, pulse_s=0.25, rise_s=0.0, rise_v=35.1)


def test_a_charge_that_ends_at_rest_says_why_it_ends_there() -> None:
    memory = {"session": BEGUN, "hold": cause("held"), "stop_cause": cause("of before")}
    decision, after = whole(Edge(goes, None, memory, SUSPENDED, **AT_REST))
    assert decision.state is HELD
    assert decision.session is not None
    assert decision.session.result == cause("held")
    assert after.session is None


@pytest.mark.parametrize(("index", "changes"), [(2, 2), (4, 1)])
def test_a_change_of_the_step_is_counted(index: int, changes: int) -> None:
    memory = {"session": BEGUN, "step": CurrentStep(index, 0.0, cause("")), "raise_s": ago(60), "last_s": ago(0.25)}
    decision, _ = whole(Edge(goes, None, memory))
    assert decision.session is not None
    assert decision.session.step_changes == changes


def test_a_new_fault_orders_a_stop_also_where_the_line_has_just_failed() -> None:
    tripped = {"faults": {"internal": FaultMemory(raised_s=ago(9), latched=True)}}
    spoilt: dict[str, Any] = {"charger": STANDS_BY, "charger_link": {"online": False, **STOP_SENT}}
    assert whole(Edge(goes, None, tripped, TRIPPED, **spoilt))[0].command is None
    decision, _ = whole(
        Edge(goes, None, tripped, TRIPPED, **spoilt, bmu_link={"implausible": {"soc_pct": cause("SOC 140 %")}})
    )
    assert (decision.state, decision.command) == (TRIPPED, STOP)


EDGES = (
    *GOES, *FOLLOWS, *LATCHES, *ORDERS,
    Edge(boots, 3, state=IDLE, **BOOTED), Edge(boots, 0, state=STOPPING, **BOOTED), Edge(boots, 0, **BOOTED),
)  # fmt: skip


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: edge.name)
def test_one_step(edge: Edge) -> None:
    assert said(edge.rule(edge.facts)) == said(edge.says)
