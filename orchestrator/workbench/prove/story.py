"""A counterexample for people: what the devices did, decision by decision, and how the bay reacted."""

from dataclasses import dataclass
from itertools import groupby

from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import Action, Cause, Decision, Measurement, Request, Snapshot
from orchestrator.text.catalogue import say
from orchestrator.text.moments import with_moments

#: Where time begins in a story; not 0, so that "never" cannot be mistaken for a time.
BEGIN_S = 1000.0
#: The time to the next decision, roughly as in the service.
TICK_S = 0.25
WITH_VALUE = (Action.SET_LIMIT, Action.SET_MODE, Action.SET_PRECHARGE)


@dataclass(frozen=True, slots=True)
class Move:
    """What happens between two decisions: time passes, and then devices and operator report this."""

    dt_s: float
    charger: str  #: the name of a class of inputs
    battery: str
    request: Request | None = None
    internal: str = ""
    ending: Cause | None = None
    restart: bool = False  #: the service has died, and starts again from its persisted state

    @property
    def lasts(self) -> bool:
        """Whether it consists only of surroundings, which may persist."""
        return self.request is None and not (self.internal or self.ending or self.restart)

    def __str__(self) -> str:
        asked = f"; operator: {self.request}" if self.request else ""
        broke = f"; internal error: {self.internal}" if self.internal else ""
        ends = "; the service ends" if self.ending else ""
        lives = "the service is killed and starts again; " if self.restart else ""
        return f"{lives}charger: {self.charger}; battery: {self.battery}{asked}{broke}{ends}"


@dataclass(frozen=True, slots=True)
class Taken:
    """One decision as it was made."""

    move: Move
    now_s: float
    snapshot: Snapshot
    before: Memory
    decision: Decision
    after: Memory
    rules: Rules
    error: str = ""  #: the exception raised instead


@dataclass(frozen=True, slots=True)
class Counterexample:
    """A violated property, and the shortest story that shows it."""

    name: str
    text: str
    story: tuple[Taken, ...]

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.text}"]
        for same, group in groupby(self.story, _told):
            times_s = [taken.now_s - BEGIN_S for taken in group]
            until = f" … {times_s[-1]:.2f}" if len(times_s) > 1 else ""
            lines.append(f"  t = {times_s[0]:.2f}{until} s  {same}")
        return "\n".join(lines)


def _told(taken: Taken) -> str:
    """One decision as text; equal consecutive ones are shown once."""
    answer = f"; answer: {_said(taken.decision.answer)}" if taken.decision.answer else ""
    return (
        f"{taken.move}\n      {_values(taken.snapshot)}\n"
        f"      → {taken.decision.state}: {_said(taken.decision.cause)}; {_order(taken.decision)}{answer}"
    )


def _said(cause: Cause) -> str:
    """The sentence, with its moments on the story's clock."""
    return say(with_moments(cause, lambda _, t_s: f"t = {t_s - BEGIN_S:.2f} s"))


def _order(decision: Decision) -> str:
    command = decision.command
    if command is None:
        return "no command"
    return f"command: {command.action}" + (f" {command.value}" if command.action in WITH_VALUE else "")


def _values(snapshot: Snapshot) -> str:
    charger, battery = snapshot.charger, snapshot.battery
    told = f"charger {charger.voltage_v:.2f} V, {charger.current_a:.2f} A" if charger else "charger not heard"
    return (
        f"{told}; pack {_value(battery.voltage_v, '.2f')} V, {_value(battery.temperature_c, '.1f')} °C, "
        f"SOC {_value(battery.soc_pct, '.0f')} %, SOH {_value(battery.soh_pct, '.0f')} %"
    )


def _value(measurement: Measurement | None, form: str) -> str:
    return "?" if measurement is None else format(measurement.value, form)
