"""What a simulation leaves behind: measured values over time, and which rule bound the bay in each stretch of it."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from orchestrator.model import Cause, Decision, State
from orchestrator.text.catalogue import say
from orchestrator.workbench.simulate.plant import Plant


class Moment(NamedTuple):
    """The truth of the bay at one time; without a battery most of it is None."""

    t_s: float
    soc_pct: float | None
    voltage_v: float | None
    current_a: float
    temperature_c: float | None
    ambient_c: float
    step: int | None  #: the current-limit step in force, None while no current is to flow
    state: State


@dataclass(frozen=True, slots=True)
class Span:
    """A time in which the bay was in one state, on one step, for one reason."""

    from_s: float
    to_s: float
    state: State
    step: int | None
    step_a: float | None
    cause: Cause  #: the rule that bound it; else why the bay is in this state
    faults: tuple[str, ...] = ()  #: the ids of those in force

    @property
    def key(self) -> str:
        """Of the policy's row that bound it, where one did."""
        return self.cause.key

    @property
    def why(self) -> str:
        """The cause in words, with the rule's line in the policy."""
        return say(self.cause)

    @property
    def rule(self) -> tuple[State, int | None, str, str]:
        """What bound it, without the numbers that were measured: equal for the same rule at another time."""
        return self.state, self.step, self.cause.id, self.cause.key


@dataclass(frozen=True, slots=True)
class Bound:
    """One rule and all the times in which it bound the bay."""

    number: int  #: from 1, in the order in which they came
    spans: tuple[Span, ...]

    @property
    def total_s(self) -> float:
        """How long altogether."""
        return sum(span.to_s - span.from_s for span in self.spans)


def bounds(spans: Iterable[Span]) -> list[Bound]:
    """The spans by their rule, in the order in which the rules came."""
    by_rule: dict[object, list[Span]] = {}
    for span in spans:
        by_rule.setdefault(span.rule, []).append(span)
    return [Bound(number, tuple(same)) for number, same in enumerate(by_rule.values(), start=1)]


@dataclass(slots=True)
class Trail:
    """Filled by a simulation while it goes."""

    moments: list[Moment] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)

    def add(self, plant: Plant, decision: Decision) -> None:
        """One more moment, at the plant's time."""
        pack, step = plant.pack, decision.step
        self.moments.append(
            Moment(
                plant.t_s,
                pack.soc * 100 if pack else None,
                pack.voltage_v if pack else None,
                plant.charger.current_a,
                pack.temperature_c if pack else None,
                plant.ambient_c,
                step.index if step else None,
                decision.state,
            )
        )
        cause = step.rule if step is not None and decision.state is State.CHARGING else decision.cause
        faults = tuple(fault.id for fault in decision.faults)
        index, amps = (step.index, step.current_a) if step else (None, None)
        span = Span(plant.t_s, plant.t_s, decision.state, index, amps, cause, faults)
        if self.spans and (span.rule, span.faults) == (self.spans[-1].rule, self.spans[-1].faults):
            return
        self.close(plant.t_s)
        self.spans.append(span)

    def close(self, t_s: float) -> None:
        """The last span ends here."""
        if self.spans:
            self.spans[-1] = replace(self.spans[-1], to_s=t_s)
