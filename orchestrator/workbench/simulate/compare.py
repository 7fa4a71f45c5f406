"""Finds the times at which several policies behaved differently on one scenario."""

from collections.abc import Iterator, Sequence

from orchestrator.core.states import PASSING
from orchestrator.model import State
from orchestrator.workbench.simulate.trail import Span

#: A shorter difference does not count.
SAME_S = 60.0


def differences(all_spans: Sequence[Sequence[Span]]) -> list[tuple[float, float]]:
    """The intervals (from, to, in s) longer than `SAME_S` in which states or steps differed."""
    times = sorted({span.from_s for spans in all_spans for span in spans} | {spans[-1].to_s for spans in all_spans})
    found: list[tuple[float, float]] = []
    walks = [_walk(spans, times) for spans in all_spans]
    for from_s, to_s, *did in zip(times, times[1:], *walks, strict=False):
        if len(set(did)) == 1:
            continue
        if found and from_s - found[-1][1] < SAME_S:
            found[-1] = (found[-1][0], to_s)
        else:
            found.append((from_s, to_s))
    return [(from_s, to_s) for from_s, to_s in found if to_s - from_s >= SAME_S]


def _walk(spans: Sequence[Span], times: Sequence[float]) -> Iterator[tuple[State, int | None] | None]:
    """State and step from each of the times on."""
    done: tuple[State, int | None] | None = None
    rest = iter(spans)
    span: Span | None = next(rest, None)
    for from_s in times:
        while span is not None and span.from_s <= from_s:
            if span.state not in PASSING:
                done = (span.state, span.step)
            span = next(rest, None)
        yield done
