"""Faults of a charger that does not obey, or does not answer."""

from orchestrator.core.facts import CHARGER_STALE_S, Facts
from orchestrator.core.finish import early_below_pct, ends_full, ends_hold
from orchestrator.core.witnesses.standby import sees_current
from orchestrator.model import Action, Cause, Operation, State

#: A setting must be read back within this time (about ten attempts), and a run must be seen (FAULTS C7, C9).
OBEY_S = 5.0
#: After a step down the current may stay at the old step for this long. More would delay the stop beyond its budget (2
#: s).
FOLLOWS_S = 1.0
#: The charger's own modes before current flows (search) and while it wakes a pack (recovery, precharge).
SEARCH_MAX_S = 60.0
WAKE_MAX_S = 1800.0
#: Charging with less than this is not charging.
NO_CURRENT_A = 0.1
#: A running charger that delivers nothing for this long is connected to nothing.
IDLE_MAX_S = 10.0
#: Nearly full packs may take no current.
NEARLY_FULL_PCT = 95.0
#: This many settings that revert within this time are no accident.
MAX_REVERTS, REVERTS_S = 3, 60.0
#: The later wording for a stop verified in the end: one that the charger's own report denied, or only the BMU's.
PAST = {"will_not_stop": "did_not_stop", "stop_contradicted": "stop_was_contradicted"}
#: A change to the line by somebody else is news for this long.
NEWS_S = 5.0


def charger_silent(f: Facts) -> Cause | None:
    """FAULTS C23, C25."""
    if f.stalled:
        return None
    if f.charger.problem:
        return f.charger.problem
    port = f.rules.bay.charger.port
    if not f.charger.online:
        return Cause.of("charger_silent", port=port, misses=f.charger.misses)
    if f.reading is None:
        return Cause.of("charger_stale", port=port, limit_s=CHARGER_STALE_S)
    return None


def found_running(f: Facts) -> Cause | None:
    """FAULTS G10: the previous run of this service died, or somebody else started the charger unseen."""
    return Cause("found_running") if f.runs else None


def rogue_run(f: Facts) -> Cause | None:
    """FAULTS C5."""
    if not f.runs or f.reading is None:
        return None
    return Cause.of("rogue_run", charger_a=f.reading.current_a)


def will_not_stop(f: Facts) -> Cause | None:
    """FAULTS C6: the charger answers, and it or the BMU reports that it goes on.

    A cut line is not disobedience: that is given up, too, but recovers by itself once repaired.
    """
    if f.reading is None:
        return None
    if f.runs:
        return Cause.of("will_not_stop", charger_a=f.reading.current_a)
    if not sees_current(f):
        return None
    return Cause.of("stop_contradicted", pack_a=f.pack_a, charger_a=f.reading.current_a)


def did_not_stop(cause: Cause, lasted_s: float) -> Cause:
    """The cause of `will_not_stop` once its charger is in standby, from the cause shown before."""
    return Cause.of(PAST[cause.id], lasted_s=lasted_s) if cause.id in PAST else cause


def will_not_start(f: Facts) -> Cause | None:
    """FAULTS C7."""
    command = f.memory.sequence.command
    if command is None or command.action not in (Action.RUN, Action.RESUME) or not f.energised:
        return None
    return _unconfirmed("will_not_start", f, Action.RUN.value, None)


def stopped_by_itself(f: Facts) -> Cause | None:
    """FAULTS C4: an emergency stop that bypasses this service looks like this, too; restarting is not up to us."""
    if f.reading is None or not f.energised or not f.memory.stage.ran:
        return None
    if f.reading.operation is not Operation.STOPPED:
        return None
    if not f.full_mode:
        return Cause("stopped_by_itself")
    if ends_hold(f) is not None or early_full(f) is not None:
        return None
    if f.rules.policy.finish.full.charger is False:
        return f.rules.by_policy("stopped_not_asked", "finish.full.charger")
    return None if ends_full(f) else Cause("stopped_not_full")


def limit_reverted(f: Facts) -> Cause | None:
    """FAULTS C28: settings that the charger confirms and then drops."""
    step, reverts = f.memory.stage.step, f.memory.charger.reverts
    recent = [t_s for t_s in reverts if f.now_s - t_s < REVERTS_S]
    if step is None or len(recent) < MAX_REVERTS:
        return None
    return Cause.of("limit_reverted", times=len(recent))


def above_step(f: Facts) -> Cause | None:
    """FAULTS C28: the current is compared with the commanded step, whatever setting the charger shows."""
    step = f.memory.stage.step
    if f.memory.state is not State.CHARGING or step is None or f.amps is None or not f.rules.manual:
        return None
    limit_a = f.rules.measured_most_a(step.current_a)
    if f.amps <= limit_a:
        return None
    return Cause.of("above_step", charger_a=f.amps, limit_a=limit_a, step_a=step.current_a)


def port_locked(f: Facts) -> Cause | None:
    """FAULTS C27."""
    if not f.charger.locked_by:
        return None
    return Cause.of("port_locked", port=f.rules.bay.charger.port, program=f.charger.locked_by)


def line_taken_over(f: Facts) -> Cause | None:
    """FAULTS C26."""
    found_s = f.charger.taken_over_t_s
    if found_s is None or f.now_s - found_s >= NEWS_S:
        return None
    return Cause.of("line_taken_over", port=f.rules.bay.charger.port, settings=f.charger.taken_over)


def loose_plug(f: Facts) -> Cause | None:
    """FAULTS C13: the battery was removed in mid-charge and back within a minute."""
    return Cause("loose_plug") if f.memory.battery.returned_s == f.now_s else None


def setting_not_obeyed(f: Facts) -> Cause | None:
    """FAULTS C9, C16."""
    command = f.memory.sequence.command
    if command is None or command.action in (Action.RUN, Action.RESUME, Action.STOP) or not f.energised:
        return None
    if command.action is Action.SET_LIMIT:  # people count steps from 1
        return _unconfirmed("setting_not_obeyed", f, "step", command.value + 1)
    return _unconfirmed("setting_not_obeyed", f, command.action.value.removeprefix("set_"), command.value)


def contactor_lost(f: Facts) -> Cause | None:
    """FAULTS C6: without the contactor, nothing is left to stop a charger that does not obey."""
    return f.snapshot.contactor_problem


def _unconfirmed(id_: str, f: Facts, command: str, value: int | None) -> Cause | None:
    waited_s = f.now_s - f.memory.sequence.command_s
    if waited_s < OBEY_S or f.stalled:
        return None
    held = Cause.of("held_back", refused=f.charger.refused) if f.charger.refused else None
    return Cause.of(id_, command=command, value=value, waited_s=waited_s, held=held)


def over_current(f: Facts) -> Cause | None:
    """FAULTS C11."""
    reading, rules = f.reading, f.rules
    if reading is None:
        return None
    limit_a = rules.bay.limits.current_a
    if rules.manual and reading.current_step is not None:
        limit_a = min(limit_a, max([rules.steps_a[step] for step in _steps_in_force(f, reading.current_step)]))
    highest_a = rules.measured_most_a(limit_a)
    if reading.current_a <= highest_a:
        return None
    return Cause.of("over_current", charger_a=reading.current_a, allowed_a=highest_a, limit_a=limit_a)


def _steps_in_force(f: Facts, shown: int) -> tuple[int, ...]:
    """The step that the charger shows, and briefly the one before: its current changes later than its status."""
    before = f.memory.charger.limit_before
    return (shown,) if before is None or f.now_s - f.memory.charger.limit_s > FOLLOWS_S else (shown, before)


def early_full(f: Facts) -> Cause | None:
    """FAULTS C18."""
    if not f.full_mode or f.soc is None or f.soc >= early_below_pct(f) or ends_hold(f) is not None:
        return None
    if not ends_full(f):
        return None  # an end that did not look like a full charge was a stop by somebody: `stopped_by_itself`
    return Cause.of("early_full", soc_pct=f.soc)


def open_circuit(f: Facts) -> Cause | None:
    """FAULTS C13."""
    idle_s = f.memory.charger.idle_s
    if idle_s <= IDLE_MAX_S or f.soc is None or f.soc >= NEARLY_FULL_PCT:
        return None
    return Cause.of("open_circuit", idle_s=idle_s, soc_pct=f.soc)


def no_battery(f: Facts) -> Cause | None:
    """FAULTS C14."""
    return _too_long("no_battery", f.memory.charger.search_s, SEARCH_MAX_S)


def wakes_too_long(f: Facts) -> Cause | None:
    """FAULTS C15, the charger's own recovery and precharge."""
    return _too_long("wakes_too_long", f.memory.charger.wake_s, WAKE_MAX_S)


def _too_long(id_: str, lasted_s: float, limit_s: float) -> Cause | None:
    return Cause.of(id_, lasted_min=lasted_s / 60, limit_min=limit_s / 60) if lasted_s > limit_s else None
