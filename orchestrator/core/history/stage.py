"""What the present state has come to: makes the next `Stage`. Every state begins with an empty one."""

from orchestrator.core.facts import Facts
from orchestrator.core.finish import tapers
from orchestrator.core.history.since import since
from orchestrator.core.memory import Stage
from orchestrator.core.parts import changed
from orchestrator.core.witnesses.followed import FIRST_A
from orchestrator.core.witnesses.standby import sees_current
from orchestrator.model import Action, ChargeMode, CurrentStep, Operation, State

EMPTY = Stage()
#: The modes that a charger may be told.
TOLD = (ChargeMode.CHARGE, ChargeMode.PRECHARGE)


def update(f: Facts) -> Stage:
    """What the state has come to by these facts."""
    stage = f.memory.stage
    taper_s = since(f.memory.state is State.CHARGING and tapers(f), stage.taper_s, f.now_s)
    if taper_s != stage.taper_s:
        stage = changed(stage, taper_s=taper_s)
    return _began(f, stage) if f.energised and not stage.ran else stage


def _began(f: Facts, stage: Stage) -> Stage:
    """Whether the charge has begun, though no status reply may have shown it: a run that is ordered again would undo a
    stop.

    The charger says that it runs; or the BMU has seen its current; or the charger, which had left standby and shown the
    mode that it was told, is in standby again.
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
    """Something is missing: the time begins anew."""
    return changed(stage, qualified_s=None, ready=False, intends=False)


def not_ready(stage: Stage) -> Stage:
    """No charge is about to begin."""
    return changed(stage, ready=False, intends=False) if stage.ready or stage.intends else stage


def qualifies(f: Facts, stage: Stage) -> Stage:
    """Everything speaks for a charge, now or since some time."""
    return changed(stage, qualified_s=f.now_s) if stage.qualified_s is None else stage


def is_ready(stage: Stage, *, intends: bool) -> Stage:
    """It has for long enough; whether it is also its turn."""
    return changed(stage, ready=True, intends=intends)


# --- while current flows ----------------------------------------------------------------------------------------------


def reaches(f: Facts, stage: Stage, *, holds: bool) -> Stage:
    """Whether the pack is above the stage's voltage."""
    reached_s = since(holds, stage.reached_s, f.now_s)
    return stage if reached_s == stage.reached_s else changed(stage, reached_s=reached_s)


def chosen(stage: Stage, step: CurrentStep, raise_s: float | None, *, anew: bool) -> Stage:
    """The step for now. `anew`: the charge goes on with another one; another current follows, a taper counts anew."""
    if step is stage.step and raise_s == stage.raise_s:
        return stage
    return changed(stage, step=step, raise_s=raise_s, taper_s=None if anew else stage.taper_s)
