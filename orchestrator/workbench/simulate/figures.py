"""The key figures of a simulation: duration, charge, temperature, stops and faults."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

from orchestrator.config.scenario import Cell, Scenario, Visit
from orchestrator.core.states import ENERGISED
from orchestrator.model import State
from orchestrator.workbench.simulate.simulation import Run
from orchestrator.workbench.simulate.trail import Moment, Span, clock_s

#: Above this cell voltage, time counts as time at high voltage, in which cells age fastest.
HIGH_CELL_V: dict[Cell, float] = {Cell.NMC: 4.10, Cell.LFP: 3.45}


@dataclass(frozen=True, slots=True)
class Figures:
    """One policy's figures on one scenario. With several batteries, hours are per battery, not per bay."""

    policy: str
    visits: int
    full: int  #: visits that ended with a full battery
    full_h: float | None  #: mean time from arrival to full; None: none was full
    left_pct: float | None  #: mean state of charge at the end of a visit
    charged_ah: float
    charged_wh: float
    peak_c: float | None  #: the highest temperature of a battery
    high_voltage_h: float
    stops: int  #: stops before the battery was full, including its removal
    step_changes: int
    state_h: Mapping[State, float]
    faults: Mapping[str, int] = field(default_factory=dict)  #: occurrences of each


def figures(run: Run) -> Figures:
    """The figures of a run."""
    moments, spans, scenario = run.trail.moments, run.trail.spans, run.scenario
    stays = [_stay(visit, scenario, moments) for visit in scenario.visits]
    full_h = [hours for visit, stay in zip(scenario.visits, stays, strict=True) if (hours := _full_h(visit, stay))]
    left = [stay[-1].soc_pct for stay in stays if stay and stay[-1].soc_pct is not None]
    return Figures(
        policy=run.policy.policy,
        visits=len(stays),
        full=len(full_h),
        full_h=sum(full_h) / len(full_h) if full_h else None,
        left_pct=sum(left) / len(left) if left else None,
        charged_ah=run.charged_ah,
        charged_wh=run.charged_wh,
        peak_c=max((m.temperature_c for m in moments if m.temperature_c is not None), default=None),
        high_voltage_h=sum(_high_voltage_h(v, s, scenario) for v, s in zip(scenario.visits, stays, strict=True)),
        stops=sum(1 for before, now in pairwise(spans) if before.state in ENERGISED and _stopped(now, spans)),
        step_changes=sum(1 for before, now in pairwise(spans) if before.state is now.state is State.CHARGING
                         and before.step != now.step),
        state_h=_state_h(spans),
        faults=_faults(spans),
    )  # fmt: skip


def _stay(visit: Visit, scenario: Scenario, moments: Sequence[Moment]) -> list[Moment]:
    """The moments of one battery's stay."""
    end_h = visit.to_h if visit.to_h is not None else scenario.hours
    return [m for m in moments if visit.from_h * 3600 < m.t_s <= end_h * 3600 and m.soc_pct is not None]


def _full_h(visit: Visit, stay: Sequence[Moment]) -> float | None:
    return next((m.t_s / 3600 - visit.from_h for m in stay if m.state is State.FULL), None)


def _high_voltage_h(visit: Visit, stay: Sequence[Moment], scenario: Scenario) -> float:
    battery = scenario.batteries[visit.battery]
    high_v = HIGH_CELL_V[battery.cells] * battery.cells_in_series
    return sum(_above_s(before, now, high_v) for before, now in pairwise(stay)) / 3600


def _above_s(before: Moment, now: Moment, high_v: float) -> float:
    """How long the voltage, linear between the two, was that high."""
    low, high = sorted((before.voltage_v or 0.0, now.voltage_v or 0.0))
    share = 1.0 if low >= high_v else max(high - high_v, 0.0) / (high - low) if high > low else 0.0
    return (now.t_s - before.t_s) * share


def _stopped(span: Span, spans: Sequence[Span]) -> bool:
    """Whether this is a stop that does not lead to FULL."""
    if span.state is not State.STOPPING:
        return False
    return next((s.state for s in spans if s.from_s >= span.to_s and s is not span), None) is not State.FULL


def _state_h(spans: Sequence[Span]) -> dict[State, float]:
    hours: Counter[State] = Counter()
    for span in spans:
        hours[span.state] += (span.to_s - span.from_s) / 3600  # type: ignore[assignment]  # typeshed: counts are int
    return {state: hours[state] for state in State if hours[state]}


def _faults(spans: Sequence[Span]) -> dict[str, int]:
    came: Counter[str] = Counter()
    known: set[str] = set()
    for span in spans:
        came.update(set(span.faults) - known)
        known = set(span.faults)
    return dict(came)


# --- as a table ------------------------------------------------------------------------------------------------------

Row = tuple[str, Callable[[Figures], str]]


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else form.format(value)


def clock(hours: float) -> str:
    """Hours and minutes, `2:05`."""
    minutes = round(hours * 60)
    return f"{minutes // 60}:{minutes % 60:02}"


ROWS: tuple[Row, ...] = (
    ("time to full, h:min", lambda f: "–" if f.full_h is None else clock(f.full_h)),
    ("full, of batteries", lambda f: f"{f.full} of {f.visits}"),
    ("state of charge in the end", lambda f: _number(f.left_pct, "{:.1f} %")),
    ("charged", lambda f: f"{f.charged_ah:.1f} Ah, {f.charged_wh:.0f} Wh"),
    ("peak temperature", lambda f: _number(f.peak_c, "{:.1f} °C")),
    ("time at high voltage, h:min", lambda f: clock(f.high_voltage_h)),
    ("stops before full", lambda f: str(f.stops)),
    ("step changes", lambda f: str(f.step_changes)),
    ("faults", lambda f: ", ".join(f"{name} ×{times}" for name, times in f.faults.items()) or "none"),
)


def table(all_figures: Sequence[Figures]) -> list[list[str]]:
    """A row per figure and per lasting state, a column per policy; the first row has the headings."""
    rows = [["", *(f.policy for f in all_figures)]]
    rows += [[name, *(tell(f) for f in all_figures)] for name, tell in ROWS]
    for state in State:
        if any(f.state_h.get(state, 0.0) * 3600 >= 1 for f in all_figures):
            rows.append([f"time {state}, h:min:s", *(clock_s(f.state_h.get(state, 0.0)) for f in all_figures)])
    return rows


def titles(runs: Sequence[Run]) -> list[str]:
    """The policies' names; those of one name with their files."""
    times = Counter(run.policy.policy for run in runs)
    return [
        f"{policy.policy} ({policy.source.file})" if times[policy.policy] > 1 else policy.policy
        for policy in (run.policy for run in runs)
    ]


def compared(runs: Sequence[Run]) -> list[list[str]]:
    """The table of all runs, each under its policy's title."""
    return table([replace(figures(run), policy=title) for run, title in zip(runs, titles(runs), strict=True)])
