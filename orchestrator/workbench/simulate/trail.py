"""The recording of a simulation: measured values over time, and the rule that limited the bay in each span."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from orchestrator.model import Cause, Decision, State
from orchestrator.text.catalogue import say
from orchestrator.text.moments import with_moments
from orchestrator.workbench.simulate.plant import Plant


def clock_s(hours: float) -> str:
    """Hours, minutes and seconds, `2:05:07`."""
    seconds = round(hours * 3600)
    return f"{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}"


class Moment(NamedTuple):
    """The bay's true state at one time; without a battery most values are None."""

    t_s: float
    soc_pct: float | None
    voltage_v: float | None
    current_a: float
    temperature_c: float | None
    ambient_c: float
    step: int | None  #: the current step in force, None while no current should flow
    state: State


@dataclass(frozen=True, slots=True)
class Span:
    """An interval in which the bay was in one state, on one step, for one reason."""

    from_s: float
    to_s: float
    state: State
    step: int | None
    step_a: float | None
    cause: Cause  #: the limiting rule; else the reason for the state
    faults: tuple[str, ...] = ()  #: the ids of the active faults

    @property
    def key(self) -> str:
        """The key of the limiting policy row, if any."""
        return self.cause.key

    @property
    def why(self) -> str:
        """The cause in words, with the rule's line in the policy; moments as hours, minutes and seconds."""
        return say(with_moments(self.cause, lambda _, t_s: clock_s(t_s / 3600)))

    @property
    def rule(self) -> tuple[State, int | None, str, str]:
        """The limiting rule without measured numbers: equal for the same rule at another time."""
        return self.state, self.step, self.cause.id, self.cause.key


@dataclass(frozen=True, slots=True)
class Bound:
    """One rule and all the spans in which it limited the bay."""

    number: int  #: from 1, in order of appearance
    spans: tuple[Span, ...]

    @property
    def total_s(self) -> float:
        """The total time."""
        return sum(span.to_s - span.from_s for span in self.spans)


def bounds(spans: Iterable[Span]) -> list[Bound]:
    """The spans grouped by rule, in the rules' order of appearance."""
    by_rule: dict[object, list[Span]] = {}
    for span in spans:
        by_rule.setdefault(span.rule, []).append(span)
    return [Bound(number, tuple(same)) for number, same in enumerate(by_rule.values(), start=1)]


@dataclass(slots=True)
class Trail:
    """Filled by a simulation as it runs."""

    moments: list[Moment] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)

    def add(self, plant: Plant, decision: Decision) -> None:
        """Add a moment at the plant's time."""
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
        """End the last span here."""
        if self.spans:
            self.spans[-1] = replace(self.spans[-1], to_s=t_s)
