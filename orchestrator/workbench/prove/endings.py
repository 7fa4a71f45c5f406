"""What must become of a bay when nothing happens any more: that it comes to rest, stops, charges, and is charged full.

One row an ending; `lasting.py` follows every memory that was explored there.
"""

from collections.abc import Callable, Container
from dataclasses import dataclass

from orchestrator.core.faults import ROW, Clear
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.core.states import AT_REST, ENERGISED, PRECHARGING
from orchestrator.model import STOP, Request, State
from orchestrator.workbench.prove.story import TICK_S, Taken

#: What backoffs, hysteresis and the qualification take together, at most.
RECOVERY_S = 600.0
#: A taper takes no longer; the hold after it takes as long as the policy says.
TAPER_S = 3600.0
#: In this time a pack comes from any temperature to any other without looking like a broken sensor.
SLOWLY_S = 30.0
#: Faults that a charge brings with it have shown by then.
STEADY_S = 10.0


@dataclass(frozen=True, slots=True)
class Ending:
    """What must become of every memory that it is `asked_of`, when surroundings last after the operator's `request`."""

    name: str
    about: str
    charger: str  #: the names of classes of inputs
    battery: str
    within_s: float
    reached: Callable[[Taken], bool]
    request: Request | None = None
    first_s: float = TICK_S  #: after so long the surroundings begin
    asked_of: Callable[[Memory], bool] = lambda _: True
    holds: bool = False  #: the policy's hold at the top comes on top of `within_s`

    def limit_s(self, rules: Rules) -> float:
        """It must be reached within this time."""
        return self.within_s + (rules.policy.finish.hold_min * 60 if self.holds else 0.0)


def _stands_by(taken: Taken) -> bool:
    return taken.after.state in AT_REST and taken.decision.command is None


def _uncontrollable(taken: Taken) -> bool:
    return taken.after.state is State.UNCONTROLLABLE


def _called(taken: Taken) -> bool:
    """Where people are told, and the stop is repeated for as long as it is not proved."""
    named = taken.after.state in (State.UNCONTROLLABLE, State.OFFLINE, State.TRIPPED)
    return named and taken.decision.command == STOP


def _charges(taken: Taken) -> bool:
    return _runs(taken, {State.CHARGING})


def _wakes(taken: Taken) -> bool:
    return _runs(taken, PRECHARGING)


def _runs(taken: Taken, states: Container[State]) -> bool:
    """Long enough for any fault to show."""
    since_s = taken.after.since_s or taken.now_s
    runs = taken.after.state in states and taken.after.stage.ran and taken.now_s - since_s > STEADY_S
    return runs or _exchanged(taken)


def _exchanged(taken: Taken) -> bool:
    """The change of surroundings looks like another battery, after which a person must act."""
    return "battery_exchanged" in taken.after.faults


def _full(taken: Taken) -> bool:
    """A pack cannot come from any temperature to any other in the moment in which it gets full: that is no ending."""
    return taken.after.state is State.FULL or "temperature_invalid" in taken.after.faults


def _ended(taken: Taken) -> bool:
    return taken.after.state not in ENERGISED


def _free(memory: Memory) -> bool:
    """No person must act before the bay charges (again), and it is not charging."""
    waits = any(fault.latched or ROW[name].clear is Clear.OPERATOR for name, fault in memory.faults.items())
    asked = memory.operator.hold or memory.operator.paused
    return memory.state not in (*ENERGISED, State.TRIPPED) and not (waits or asked)


def _charging(memory: Memory) -> bool:
    """With nothing ordered that is not seen yet: no charger leaves a command alone for `SLOWLY_S`."""
    return memory.state is State.CHARGING and memory.stage.ran and memory.sequence.command is None


def _energised(memory: Memory) -> bool:
    return memory.state in ENERGISED


ENDINGS: tuple[Ending, ...] = (
    Ending("to standby", "an operator's stop leads to verified standby wherever the charger obeys",
           "obeys", "healthy", 10.0, _stands_by, Request.STOP),
    Ending("to standby, no battery", "the same without a battery",
           "obeys", "absent", 10.0, _stands_by, Request.STOP),
    Ending("named", "a charger that cannot be stopped is named: UNCONTROLLABLE or OFFLINE",
           "runs, whatever it is told", "healthy", 10.0, _uncontrollable, Request.STOP),
    Ending("named, silent", "a charger that says nothing is named, too",
           "silent", "healthy", 10.0, _called, Request.STOP),
    Ending("charges", "a healthy battery is charged wherever no person must act first, also after every pause",
           "obeys", "healthy", RECOVERY_S, _charges, first_s=SLOWLY_S, asked_of=_free),
    Ending("charges, as measured", "the same where charger and BMU measure a little differently",
           "obeys", "measured differently", RECOVERY_S, _charges, first_s=SLOWLY_S, asked_of=_free),
    Ending("wakes", "a deeply discharged pack is precharged",
           "obeys", "deeply discharged", RECOVERY_S, _wakes, first_s=SLOWLY_S, asked_of=_free),
    Ending("full", "a charge is over when the pack is full, or at its target",
           "obeys", "full", TAPER_S, _full, asked_of=_charging, holds=True),
    Ending("ends", "a charge that leads nowhere is ended by a limit",
           "obeys", "healthy", 76 * 3600.0, _ended, first_s=SLOWLY_S, asked_of=_energised),
)  # fmt: skip
