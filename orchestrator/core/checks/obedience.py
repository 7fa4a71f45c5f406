"""Faults of a charger that does not do as it is told, or does not answer."""

from orchestrator.core.facts import CHARGER_STALE_S, Facts
from orchestrator.core.finish import early_below_pct, ends_full
from orchestrator.core.witnesses.standby import sees_current
from orchestrator.model import Action, Operation, State

#: A setting must be read back within this time (about ten attempts), and a run must be seen (FAULTS C7, C9).
OBEY_S = 5.0
#: A charger's current measurement may be off by this, whatever the step.
OVER_CURRENT_OFFSET_A = 0.3
#: After a step down the current may be the old step's for this long. More would delay the stop beyond its budget (2 s).
FOLLOWS_S = 1.0
#: The charger's own modes before current flows (search) and while it wakes a pack (recovery, precharge).
SEARCH_MAX_S = 60.0
WAKE_MAX_S = 1800.0
#: Charging with less than this is no charging.
NO_CURRENT_A = 0.1
#: A running charger that delivers nothing for this long is connected to nothing.
IDLE_MAX_S = 10.0
#: Nearly full packs may take no current.
NEARLY_FULL_PCT = 95.0
#: So many settings that go back within this time are no accident.
MAX_REVERTS, REVERTS_S = 3, 60.0
#: How a stop is told that only one of the two has seen, and one that was verified in the end.
CONTRADICTED, PAST = "is not seen by both", "before, "
#: What somebody else did to the line is news for this long.
NEWS_S = 5.0


def charger_silent(f: Facts) -> str | None:
    """FAULTS C23, C25."""
    if f.charger.problem:
        return f.charger.problem
    port = f.rules.bay.charger.port
    if not f.charger.online:
        return f"the charger on {port} has not answered {f.charger.misses} polls"
    if f.reading is None:
        return f"the charger on {port} has sent no status for {CHARGER_STALE_S:g} s"
    return None


def found_running(f: Facts) -> str | None:
    """FAULTS G10: the last run of this service died, or it was started by somebody else while we could not see it."""
    return "the charger was found running though it was not commanded to" if f.runs else None


def rogue_run(f: Facts) -> str | None:
    """FAULTS C5."""
    if not f.runs or f.reading is None:
        return None
    return f"the charger runs though it was not commanded to: {f.reading.current_a:.2f} A"


def will_not_stop(f: Facts) -> str | None:
    """FAULTS C6: it answers, and its answer or the BMU says that it goes on. (A line that is cut is no disobedience: it
    is given up, too, but goes on by itself once it is mended.)"""
    if f.reading is None:
        return None
    if f.runs:
        return f"the charger does not obey the stop, which is repeated: it still delivers {f.reading.current_a:.2f} A"
    if not sees_current(f):
        return None
    return (
        f"the stop, which is repeated, {CONTRADICTED}: the BMU still sees {f.pack_a:.2f} A, the charger says "
        f"{f.reading.current_a:.2f} A; one of them is wrong"
    )


def did_not_stop(text: str, lasted_s: float) -> str:
    """What is said of `will_not_stop` once its charger stands by; `text` is what was said before, this or that."""
    if text.startswith(PAST):
        return text
    if CONTRADICTED in text:
        return f"{PAST}the BMU saw current for {lasted_s:.0f} s while the charger said none: one of them was wrong"
    return f"{PAST}it did not obey the stop for {lasted_s:.0f} s"


def will_not_start(f: Facts) -> str | None:
    """FAULTS C7."""
    if f.memory.order is None or f.memory.order.action not in (Action.RUN, Action.RESUME) or not f.energised:
        return None
    return _unconfirmed(f, "run")


def stopped_by_itself(f: Facts) -> str | None:
    """FAULTS C4: an emergency stop past this service looks like this, too; it is not for us to start again."""
    if f.reading is None or not f.energised or not f.memory.ran:
        return None
    if f.reading.operation is not Operation.STOPPED:
        return None
    if not f.full_mode:
        return "the charger stopped though it was told to run"
    if early_full(f) is not None or (f.rules.policy.finish.full.charger is not False and ends_full(f)):
        return None
    return (
        "the charger stopped though it was told to run, and its mode 5 is not taken for full: the current had not "
        "tapered off and the pack has not reached its end voltage"
    )


def limit_reverted(f: Facts) -> str | None:
    """FAULTS C28: settings that it confirms and then drops."""
    step, reverts = f.memory.step, f.memory.reverts
    recent = [t_s for t_s in reverts if f.now_s - t_s < REVERTS_S]
    if step is None or len(recent) < MAX_REVERTS:
        return None
    return (
        f"the charger confirmed the step that it was told and went back by itself {len(recent)} times within a minute"
    )


def above_step(f: Facts) -> str | None:
    """FAULTS C28: what flows is held against what was commanded, whatever the charger shows as its setting."""
    step = f.memory.step
    if f.memory.state is not State.CHARGING or step is None or f.amps is None or not f.rules.manual:
        return None
    allowed_a = step.current_a * f.rules.policy.faults.over_current_pct / 100 + OVER_CURRENT_OFFSET_A
    if f.amps <= allowed_a:
        return None
    return f"{f.amps:.2f} A flow, more than {allowed_a:.2f} A, where {step.current_a:g} A were commanded"


def port_locked(f: Facts) -> str | None:
    """FAULTS C27."""
    if not f.charger.locked_by:
        return None
    port = f.rules.bay.charger.port
    return f"another program holds {port}: {f.charger.locked_by}; the charger is stopped in spite of it"


def line_taken_over(f: Facts) -> str | None:
    """FAULTS C26."""
    found_s = f.charger.taken_over_t_s
    if found_s is None or f.now_s - found_s >= NEWS_S:
        return None
    return f"another program set {f.rules.bay.charger.port} to {f.charger.taken_over}; it has been set up again"


def loose_plug(f: Facts) -> str | None:
    """FAULTS C13: it left in mid-charge and was back within a minute."""
    return "the battery left in mid-charge and was back at once" if f.memory.returned_s == f.now_s else None


def setting_not_obeyed(f: Facts) -> str | None:
    """FAULTS C9, C16."""
    order = f.memory.order
    if order is None or order.action in (Action.RUN, Action.RESUME, Action.STOP) or not f.energised:
        return None
    step = order.action is Action.SET_LIMIT
    return _unconfirmed(
        f, f"step {order.value + 1}" if step else f"{order.action.value.removeprefix('set_')} {order.value}"
    )


def contactor_lost(f: Facts) -> str | None:
    """FAULTS C6: without it, nothing is left for a charger that does not obey."""
    return f.snapshot.contactor_problem or None


def _unconfirmed(f: Facts, what: str) -> str | None:
    waited_s = f.now_s - f.memory.order_s
    if waited_s < OBEY_S:
        return None
    held = f"; the interlock held it back: {f.charger.refused}" if f.charger.refused else ""
    return f"the charger was told '{what}' for {waited_s:.1f} s and its status does not show it{held}"


def over_current(f: Facts) -> str | None:
    """FAULTS C11."""
    reading, rules = f.reading, f.rules
    if reading is None:
        return None
    limit_a = rules.bay.limits.current_a
    if rules.manual and reading.current_limit is not None:
        limit_a = min(limit_a, max(rules.steps_a[step] for step in _steps_in_force(f, reading.current_limit)))
    allowed_a = limit_a * rules.policy.faults.over_current_pct / 100 + OVER_CURRENT_OFFSET_A
    if reading.current_a <= allowed_a:
        return None
    return f"{reading.current_a:.2f} A, more than {allowed_a:.2f} A for a limit of {limit_a:g} A"


def _steps_in_force(f: Facts, shown: int) -> tuple[int, ...]:
    """The step that the charger shows, and for a moment the one before: its current follows later than its status."""
    before = f.memory.limit_before
    return (shown,) if before is None or f.now_s - f.memory.limit_s > FOLLOWS_S else (shown, before)


def early_full(f: Facts) -> str | None:
    """FAULTS C18."""
    if not f.full_mode or f.soc is None or f.soc >= early_below_pct(f) or not ends_full(f):
        return None  # what did not end like a full charge was stopped by somebody: `stopped_by_itself`
    return f"the charger reports full (mode 5), the BMU only {f.soc:.0f} %"


def open_circuit(f: Facts) -> str | None:
    """FAULTS C13."""
    idle_s = f.memory.idle_s
    if idle_s <= IDLE_MAX_S or f.soc is None or f.soc >= NEARLY_FULL_PCT:
        return None
    return f"the charger runs but has delivered nothing for {idle_s:.0f} s at SOC {f.soc:.0f} %"


def no_battery(f: Facts) -> str | None:
    """FAULTS C14."""
    return _too_long(f.memory.search_s, SEARCH_MAX_S, "has been looking for a battery")


def wakes_too_long(f: Facts) -> str | None:
    """FAULTS C15, the charger's own recovery and precharge."""
    return _too_long(f.memory.wake_s, WAKE_MAX_S, "has been in recovery or precharge")


def _too_long(lasted_s: float, limit_s: float, what: str) -> str | None:
    return f"the charger {what} for {lasted_s / 60:.0f} min" if lasted_s > limit_s else None
