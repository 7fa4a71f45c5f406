"""What another policy would have decided in what was recorded, and what that would have changed.

A record cannot answer back: from where the other policy would have gone into another state, it no longer shows what
would have followed. That is said once, and compared anew from the next rest or check that the record itself comes to.
A step that is lower or higher is compared on: the charger's own readings are taken as they are.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from orchestrator.config.policy import Policy
from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory, by_policy, value_of, with_values
from orchestrator.core.rules import Rules
from orchestrator.core.states import RESTING
from orchestrator.model import CurrentStep, Decision, Snapshot, State
from orchestrator.record.utc import unix_s, utc
from orchestrator.text.catalogue import say
from orchestrator.text.moments import UNIX, with_moments
from orchestrator.workbench.replay.again import Again


@dataclass(slots=True)
class Difference:
    """From one moment to another the policies decide differently; the reasons are those of its first step."""

    wall: str
    began_s: float
    ended_s: float
    was: Decision
    now: Decision
    ah: float = 0.0  #: by how much the other policy would have charged more; where it may have, the most

    @property
    def parted(self) -> bool:
        """They are in different states: what would have followed is not on record."""
        return self.was.state is not self.now.state


def _as_told(snapshot: Snapshot, was: CurrentStep | None, now: CurrentStep | None, rules: Rules) -> Snapshot:
    """What the devices would have shown on the other policy's step: the record's charger obeyed its own one.

    Where the steps are the same, or nothing is charged, as it was recorded.
    """
    charger, pack_a = snapshot.charger, snapshot.battery.current_a
    if was is None or now is None or was.index == now.index or charger is None or not rules.manual:
        return snapshot
    share = min(1.0, now.current_a / was.current_a)
    told = now.index if charger.current_step == was.index else charger.current_step
    battery = snapshot.battery
    if pack_a is not None:
        battery = replace(battery, current_a=replace(pack_a, value=pack_a.value * share))
    charger = replace(charger, current_a=charger.current_a * share, current_step=told)
    return replace(snapshot, charger=charger, battery=battery)


class Comparison:
    """One bay's record against another policy; `differences` grows while steps come."""

    def __init__(self, policy: Policy) -> None:
        self.differences: list[Difference] = []
        self._policy = policy
        self._rules: tuple[Rules, Rules] | None = None  # the recorded ones, and with the other policy
        self._own: Memory | None = None
        self._open: Difference | None = None

    def take(self, one: Again) -> None:
        """Decide this step with the other policy, too."""
        parted = self._open is not None and self._open.parted
        if parted and not (one.decision.state is not one.memory.state and one.decision.state in RESTING):
            self._go_on(one)
            return
        own = None if parted or self._own is None else self._own
        given = (
            with_values(one.memory, rows=(), row_returns=())
            if own is None
            else with_values(one.memory, **{name: value_of(own, name) for name in by_policy()})
        )
        rules = self._other(one.rules)
        snapshot = _as_told(one.recorded.snapshot, one.memory.stage.step, given.stage.step, rules)
        decision, self._own = decide(one.recorded.at_s, snapshot, given, rules)
        if decision.state is one.decision.state and _step(decision) == _step(one.decision):
            self._open = None
            return
        before = self._open
        if before is None or (before.parted, _step(before.now), _step(before.was)) != (
            decision.state is not one.decision.state, _step(decision), _step(one.decision),
        ):  # fmt: skip
            at_s = one.recorded.at_s
            self._open = Difference(one.recorded.wall, at_s, at_s, one.decision, decision)
            self.differences.append(self._open)
        self._go_on(one)

    def _other(self, rules: Rules) -> Rules:
        if self._rules is None or self._rules[0] is not rules:
            self._rules = rules, Rules.of(replace(rules.bay, policy=self._policy))
        return self._rules[1]

    def _go_on(self, one: Again) -> None:
        difference, reading = self._open, one.recorded.snapshot.charger
        assert difference is not None
        passed_h = (one.recorded.at_s - difference.ended_s) / 3600
        difference.ended_s = one.recorded.at_s
        if reading is None or one.decision.step is None:
            return
        other_a = difference.now.step.current_a if difference.now.step is not None else 0.0
        lower = other_a < one.decision.step.current_a
        difference.ah += passed_h * ((min(other_a, reading.current_a) if lower else other_a) - reading.current_a)


def _step(decision: Decision) -> int | None:
    return decision.step.index if decision.step is not None else None


def compare(steps: Iterable[Again], policy: Policy) -> list[Difference]:
    """Every difference, in order."""
    comparison = Comparison(policy)
    for one in steps:
        comparison.take(one)
    return comparison.differences


def told(difference: Difference) -> Iterator[str]:
    """A difference for a person: when, what was, what would have been, what that changes."""
    lasted_s = difference.ended_s - difference.began_s
    yield f"{difference.wall}  for {lasted_s:.1f} s"
    yield f"    was  {_why(difference.was, difference)}"
    yield f"    now  {_why(difference.now, difference)}"
    yield f"    {_change(difference, lasted_s)}"


def _why(decision: Decision, difference: Difference) -> str:
    """With the moments in it as times of day, in UTC as the journal has them."""

    def tell(name: str, seconds: float) -> str:
        try:
            then = utc(seconds if name.endswith(UNIX) else unix_s(difference.wall) - (difference.began_s - seconds))
        except ValueError:  # the journal's own time is none
            return f"{seconds:.0f} s"
        return f"{then[11:19] if then[:10] == difference.wall[:10] else then[:16]}Z"

    step = decision.step
    why = f"{step.label}: {say(step.rule)}" if step is not None else say(with_moments(decision.cause, tell))
    return f"{decision.state}: {why}"


def _change(difference: Difference, lasted_s: float) -> str:
    charged = f"{abs(difference.ah):.2f} Ah {'less' if difference.ah < 0 else 'more'}"
    if not difference.parted:
        most = "" if difference.ah < 0 else " at most"
        return f"→ {charged}{most}, by a {'lower' if difference.ah < 0 else 'higher'} step"
    if difference.was.state is State.CHARGING:
        return f"→ {charged}: the rest of this stage would not have been charged"
    return f"→ what would have followed is not on record (compared anew after {lasted_s:.0f} s)"
