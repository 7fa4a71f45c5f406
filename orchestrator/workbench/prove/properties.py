"""The safety properties that every decision of every bay must satisfy, as data.

Each check derives what it needs from snapshot, decision and memory. It uses none of the core's own predicates, so that
a mistake in one of those cannot hide here.
"""

from collections.abc import Callable
from dataclasses import dataclass

from orchestrator.core.states import AT_REST, ENERGISED, PRECHARGING, UNVERIFIED
from orchestrator.model import STOP, Action, Decision, Effect, Operation, State
from orchestrator.workbench.prove.consent import (
    a_death_in_mid_charge_holds,
    alarmed,
    held_until_started,
    latched_until_reset,
    operator_stops,
    out_of_control_until_it_lasts,
    tripped_until_reset,
    waits_for_a_start,
)
from orchestrator.workbench.prove.story import Taken

#: The greatest ages of evidence: a charger's silence is noticed within 2 s, a BMU's fast values go stale after 1.5 s,
#: slow ones after three readings.
CHARGER_S, FAST_S, SLOW_S = 2.0, 1.5, 3.0
#: More than this into the pack counts as current; and how long a BMU may average it.
BMU_SEES_A, UNORDERED_S = 1.0, 2.0
#: The time from the stop command until standby must be verified.
VERIFY_S = 3.0

FAST, SLOW = ("voltage_v", "current_a", "status", "temperature_c"), ("soc_pct", "soh_pct")

RUNS = frozenset({Action.RESUME, Action.SET_LIMIT, Action.SET_MODE, Action.SET_PRECHARGE, Action.RUN})


@dataclass(frozen=True, slots=True)
class Property:
    """A requirement on every decision; `check` returns the violation, or None."""

    name: str
    about: str
    check: Callable[[Taken], str | None]


def _orders_run(decision: Decision) -> bool:
    return decision.command is not None and decision.command.action in RUNS


def _runs(taken: Taken) -> bool:
    """Whether the charger should run: commanded in this very decision or before."""
    return taken.decision.setpoint.run or _orders_run(taken.decision)


def no_run_without_fresh_readings(taken: Taken) -> str | None:
    """Unknown means no."""
    if not _runs(taken):
        return None
    charger, battery = taken.snapshot.charger, taken.snapshot.battery
    if charger is None or taken.now_s - charger.t_s > CHARGER_S:
        return "runs without a fresh status of the charger"
    for age_s, names in ((FAST_S, FAST), (SLOW_S, SLOW)):
        for name in names:
            value = getattr(battery, name)
            if value is None or taken.now_s - value.t_s > age_s:
                return f"runs without a fresh {name}"
    return None


def stop_at_once(taken: Taken) -> str | None:
    """A new fault of effect STOP or worse commands a stop in the same decision."""
    new = [f for f in taken.decision.faults if f.since_s == taken.now_s and f.effect >= Effect.STOP]
    if new and taken.decision.command != STOP:
        return f"{new[0].id} ({new[0].effect.name}) is new, the command is {taken.decision.command}"
    return None


def no_current_under_a_fault(taken: Taken) -> str | None:
    """While a fault of effect PAUSE or worse is active, nothing runs."""
    worst = max((fault.effect for fault in taken.decision.faults), default=Effect.WARN)
    if worst >= Effect.PAUSE and _runs(taken):
        return f"runs with {taken.decision.faults[0].id} in force"
    return None


def charge_begins_qualified(taken: Taken) -> str | None:
    """Current begins only after QUALIFYING, or from one stage to the next."""
    if taken.after.state not in ENERGISED or taken.before.state in ENERGISED:
        return None
    return None if taken.before.state is State.QUALIFYING else f"{taken.before.state} → {taken.after.state}"


def rest_is_verified(taken: Taken) -> str | None:
    """A standby state is entered only on a reading that shows standby, requested after the state's first stop.

    And only if the BMU sees no current. A stop repeated in the meantime does not invalidate the proof.
    """
    found = taken.before.state is not State.STARTING and taken.after.state is State.OFFLINE  # it was there before
    if taken.before.state not in UNVERIFIED or not (found or taken.after.state in AT_REST) or taken.move.restart:
        return None
    amps = taken.snapshot.battery.current_a
    if amps is not None and taken.now_s - amps.t_s <= FAST_S and amps.value > BMU_SEES_A:
        return f"{taken.after.state} while the BMU sees {amps.value:.1f} A"
    reading, sent_s = taken.snapshot.charger, taken.after.witnessed.stop_s
    if sent_s is not None and taken.before.since_s is not None and sent_s < taken.before.since_s:
        return f"{taken.after.state} after a stop that was sent before {taken.before.state}"
    if reading is None or sent_s is None or reading.t_s < sent_s:
        return f"{taken.after.state} without a status from after the stop"
    if reading.operation is not Operation.STOPPED or reading.current_a > 0.5 or taken.now_s - reading.t_s > CHARGER_S:
        return f"{taken.after.state} on {reading}"
    return None


def within_current(taken: Taken) -> str | None:
    """No step above the station's current limit, whatever the policy allows."""
    setpoint, rules = taken.decision.setpoint, taken.rules
    if not setpoint.run or setpoint.current_step is None:
        return None
    amps = rules.bay.charger.steps_a[setpoint.current_step]
    return f"step of {amps:g} A above {rules.bay.limits.current_a:g} A" if amps > rules.bay.limits.current_a else None


def within_volts(taken: Taken) -> str | None:
    """Nothing runs while charger or pack exceeds the station's voltage."""
    limit_v = taken.rules.bay.limits.voltage_v
    charger, pack = taken.snapshot.charger, taken.snapshot.battery.voltage_v
    highest_v = max(charger.voltage_v if charger else 0.0, pack.value if pack else 0.0)
    return f"runs at {highest_v:.2f} V, above {limit_v:g} V" if _runs(taken) and highest_v > limit_v else None


def within_temperature(taken: Taken) -> str | None:
    """Nothing runs while the pack is colder or warmer than the station allows."""
    allowed, measured = taken.rules.bay.limits.temperature_c, taken.snapshot.battery.temperature_c
    if not _runs(taken) or measured is None or measured.value in allowed:
        return None
    return f"runs at {measured.value:.1f} °C, allowed are {allowed} °C"


def unproved_stops(taken: Taken) -> str | None:
    """In states that wait for verified standby, the command is stop."""
    if taken.after.state in UNVERIFIED and taken.decision.command != STOP:
        return f"the command in {taken.after.state} is {taken.decision.command}"
    return None


def unordered_current_stops(taken: Taken) -> str | None:
    """A charger that reports 0 A while the BMU sees 14 A is running."""
    amps, before = taken.snapshot.battery.current_a, taken.before
    if amps is None or amps.value <= BMU_SEES_A or taken.now_s - amps.t_s > FAST_S or taken.move.restart:
        return None
    since_s = before.witnessed.unordered_s  # of consecutive readings, by the core's own count
    if taken.after.state in AT_REST and since_s >= UNORDERED_S and taken.decision.command != STOP:
        return f"{taken.after.state} without a stop, and the BMU has seen {amps.value:.1f} A for {since_s:.1f} s"
    return None


def counts_over_restarts(taken: Taken) -> str | None:
    """No limit starts over with a restart."""
    before, after = taken.before.session, taken.after.session
    if not taken.move.restart or before is None or after is None:
        return None
    less = [
        name for name in ("charged_ah", "energised_s", "pulse_s", "continuous_s", "rise_s")
        if getattr(after, name) < getattr(before, name)
    ]  # fmt: skip
    return f"{less[0]} went from {getattr(before, less[0]):.2f} to {getattr(after, less[0]):.2f}" if less else None


def stops_in_time(taken: Taken) -> str | None:
    """A stop that is not verified in time leaves STOPPING."""
    since_s = taken.after.since_s
    if taken.after.state is not State.STOPPING or since_s is None or taken.now_s - since_s < VERIFY_S:
        return None
    return f"{taken.now_s - since_s:.2f} s in STOPPING"


def precharge_ends(taken: Taken) -> str | None:
    """A stage of precharge never takes longer than its policy allows, not counting pauses and restarts."""
    rule, session = taken.rules.policy.precharge, taken.after.session
    if taken.after.state not in PRECHARGING:
        return None
    if rule is None or session is None:
        return "precharge without a rule for it, or outside of a charge"
    pulse = taken.after.state is State.PRECHARGE_PULSE
    minutes = rule.pulse.max_min if pulse else rule.continuous.max_min
    lasted_s = session.pulse_s if pulse else session.continuous_s
    return f"{taken.after.state} beyond {minutes:g} min" if lasted_s > minutes * 60 else None


def session_ends(taken: Taken) -> str | None:
    """A charge is never energised for longer than the policy's hours."""
    session, hours = taken.after.session, taken.rules.max_hours
    if taken.after.state not in ENERGISED or session is None or session.energised_s <= hours * 3600:
        return None
    return f"energised for {session.energised_s / 3600:.2f} h, allowed are {hours:g} h"


PROPERTIES: tuple[Property, ...] = (
    Property("fresh", "nothing runs without fresh readings of everything", no_run_without_fresh_readings),
    Property("stop at once", "a new fault of effect STOP or worse: stop in the same decision", stop_at_once),
    Property("no current", "nothing runs while a fault of effect PAUSE or worse is active", no_current_under_a_fault),
    Property("operator", "an accepted stop or pause takes effect in the same decision", operator_stops),
    Property("hold", "only an operator starts what an operator stopped", held_until_started),
    Property("held", "HELD ends only with a person's start, and says so", waits_for_a_start),
    Property("tripped", "TRIPPED ends only with a reset, or to stop", tripped_until_reset),
    Property("latched", "only a reset clears a latched fault", latched_until_reset),
    Property("qualified", "current begins only after QUALIFYING", charge_begins_qualified),
    Property("verified", "standby is entered only on proof", rest_is_verified),
    Property("current limit", "no step above the station's current limit", within_current),
    Property("voltage limit", "nothing runs above the station's voltage", within_volts),
    Property("temperature limit", "nothing runs outside the station's temperatures", within_temperature),
    Property("standing stop", "the command is stop until standby is verified", unproved_stops),
    Property("alarm", "danger: a charger may be out of control; attention: a fault waits for a person", alarmed),
    Property("out of control", "only a standby that lasts ends it, over restarts too", out_of_control_until_it_lasts),
    Property("unordered", "uncommanded current is stopped, whatever the charger reports", unordered_current_stops),
    Property("death", "a service that dies in mid-charge waits for a person", a_death_in_mid_charge_holds),
    Property("counters", "no limit starts over with a restart", counts_over_restarts),
    Property("in time", "STOPPING ends within 3 s, one way or the other", stops_in_time),
    Property("precharge", "precharge never exceeds its time", precharge_ends),
    Property("hours", "a charge never exceeds its hours", session_ends),
)
