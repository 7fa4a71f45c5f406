"""Progress within the present state: makes the next `Stage`. Every state begins with an empty one."""

from orchestrator.core.facts import Facts
from orchestrator.core.finish import tapers
from orchestrator.core.history.since import since
from orchestrator.core.memory import Stage
from orchestrator.core.parts import changed
from orchestrator.core.witnesses.followed import FIRST_A
from orchestrator.core.witnesses.standby import sees_current
from orchestrator.model import Action, ChargeMode, CurrentStep, Operation, State

EMPTY = Stage()
#: The modes that a charger may be commanded into.
TOLD = (ChargeMode.CHARGE, ChargeMode.PRECHARGE)


def update(f: Facts) -> Stage:
    """The stage after these facts."""
    stage = f.memory.stage
    taper_s = since(f.memory.state is State.CHARGING and tapers(f), stage.taper_s, f.now_s)
    if taper_s != stage.taper_s:
        stage = changed(stage, taper_s=taper_s)
    return _began(f, stage) if f.energised and not stage.ran else stage


def _began(f: Facts, stage: Stage) -> Stage:
    """Whether the charge has begun, even if no status reply showed it: commanding a run again would undo a stop.

    It has begun if the charger reports that it runs; if the BMU has seen its current; or if the charger, having left
    standby and shown the commanded mode, is in standby again.
    """
    reading, command = f.reading, f.memory.sequence.command
    if reading is not None and reading.operation is Operation.RUNNING:
        return changed(stage, ran=True)
    ordered = command is not None and command.action is Action.RUN
    if ordered and sees_current(f) and (f.pack_a or 0.0) - f.memory.witnessed.before_a >= FIRST_A:
        return changed(stage, ran=True)
    if reading is None or not f.rules.manual:
        return stage
    shown = stage.shown or reading.charge_mode in TOLD
    stood = reading.operation is Operation.STOPPED and reading.charge_mode is ChargeMode.FULL
    ran = shown and stood
    return changed(stage, shown=shown, ran=ran) if (shown, ran) != (stage.shown, stage.ran) else stage


# --- before a charge --------------------------------------------------------------------------------------------------


def not_qualified(stage: Stage) -> Stage:
    """Something is missing: the time starts again."""
    return changed(stage, qualified_s=None, ready=False, intends=False)


def not_ready(stage: Stage) -> Stage:
    """No charge is about to begin."""
    return changed(stage, ready=False, intends=False) if stage.ready or stage.intends else stage


def qualifies(f: Facts, stage: Stage) -> Stage:
    """Every condition for a charge holds, now or since some time ago."""
    return changed(stage, qualified_s=f.now_s) if stage.qualified_s is None else stage


def is_ready(stage: Stage, *, intends: bool) -> Stage:
    """Every condition has held for long enough; `intends` says whether its turn has come, too."""
    return changed(stage, ready=True, intends=intends)


# --- while current flows ----------------------------------------------------------------------------------------------


def reaches(f: Facts, stage: Stage, *, holds: bool) -> Stage:
    """Since when the pack has been at the stage's voltage."""
    reached_s = since(holds, stage.reached_s, f.now_s)
    return stage if reached_s == stage.reached_s else changed(stage, reached_s=reached_s)


def chosen(stage: Stage, step: CurrentStep, raise_s: float | None, *, anew: bool) -> Stage:
    """The step for now.

    `anew`: it differs from the previous one, so the current changes and the taper time starts again.
    """
    if step is stage.step and raise_s == stage.raise_s:
        return stage
    return changed(stage, step=step, raise_s=raise_s, taper_s=None if anew else stage.taper_s)
