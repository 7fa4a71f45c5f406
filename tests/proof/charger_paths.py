"""Every path of one charger, its line and its controller, under any grants whatever: it is within what it counts with.

The sums are then within the limits as well, whoever gets what: `test_grant_theorem.py`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from orchestrator.core import ledger
from orchestrator.core.supply import Held

#: Times are kept in their order alone: a status from before the grant was lowered, and one from after it.
BEFORE_S, LOWERED_S, AFTER_S = 0.0, 1.0, 2.0


@dataclass(frozen=True, slots=True)
class Path:
    """Where one charger and its controller have come to."""

    held: Held
    setting: int = 0  #: what the charger was told last
    flow: int = 0  #: its current follows
    wire: int | None = None  #: a command on its way
    late: ledger.Seen | None = None  #: a status on its way
    cut: bool = False


def explored(levels: int) -> int:
    """How many there are, from a start with a charger that may be running."""
    open_ = [Path(_plain(ledger.unproved(levels)), setting, setting) for setting in range(levels + 1)]
    seen = set(open_)
    while open_:
        path = open_.pop()
        for after in _next(path, levels):
            if after not in seen:
                _check(after, path, levels)
                seen.add(after)
                open_.append(after)
    return len(seen)


def _check(path: Path, before: Path, levels: int) -> None:
    held = path.held
    assert 0 <= held.granted <= held.counted <= levels, f"{before} to {path}"
    assert held.known or held.counted == levels, f"{before} to {path}"
    assert max(path.setting, path.flow, path.wire or 0) <= held.counted, f"{before} to {path}"


def _next(path: Path, levels: int) -> Iterator[Path]:
    """Whatever may happen next."""
    held, setting, flow = path.held, path.setting, path.flow
    if held.known and held.granted < levels:
        yield replace(path, held=_plain(ledger.raised(held, held.granted + 1, AFTER_S)))
    for level in range(held.granted):
        lowered, late = ledger.lowered(held, level, LOWERED_S), path.late
        yield replace(path, held=_plain(lowered), late=late and replace(late, t_s=BEFORE_S))
    if path.wire is not None:  # it arrives, or is lost
        yield replace(path, setting=path.wire, wire=None)
        yield replace(path, wire=None)
    elif not path.cut:
        yield from (replace(path, wire=level) for level in range(held.granted + 1))
        said = ledger.Seen(max(setting, flow), AFTER_S)
        yield replace(path, held=_plain(ledger.observed(held, levels, said)))
        yield replace(path, late=said)
    if path.late is not None:
        yield replace(path, held=_plain(ledger.observed(held, levels, path.late)), late=None)
    yield replace(path, flow=setting)
    yield replace(path, cut=not path.cut)
    yield replace(path, held=_plain(ledger.observed(held, levels, None)))
    yield replace(path, held=_plain(ledger.unproved(levels)), late=None)


def _plain(held: Held) -> Held:
    """Without the times that only say when something may be raised."""
    return replace(held, lowered_s=LOWERED_S, rose_s=0.0, room_s=None)
