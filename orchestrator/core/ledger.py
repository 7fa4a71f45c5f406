"""The arithmetic of "never over": who counts with how much, and whether more fits. Everything else only chooses.

Theory of operation. For every supply, the sum of what its bays count with is kept at or below its limit, by induction:

- a grant counts from the moment that it is made (*reserve before use*), and is made only where it fits;
- a lower grant frees nothing: only a status that the charger gave after it does, and never below the grant;
- a charger that is not known counts with its highest level, from then on.

The last one, and a limit that is lowered, can put a sum above its limit. Then nothing rises in that supply, and the
others are lowered. `tests/proof/test_grant_theorem.py` proves the induction over these very functions, for any number
of bays and any watts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from orchestrator.core.supply import Held, Supplies


@dataclass(frozen=True, slots=True)
class Seen:
    """The level that a charger is verified to be at, or below: its status shows it, and the current agrees."""

    level: int
    t_s: float  #: when the charger said so


def unproved(top: int) -> Held:
    """What a charger counts with before anything is known of it: at a start, it may be running."""
    return Held(counted=top)


def observed(held: Held, top: int, seen: Seen | None) -> Held:
    """What the newest status changes; `seen` is None for a charger that does not answer, or does not obey."""
    if seen is None:
        return held if held.counted == top and not held.known else replace(held, counted=top, known=False)
    if not seen.t_s > held.lowered_s:  # from before the grant was lowered: it may have risen since
        return held if seen.level <= held.counted else replace(held, counted=seen.level)
    counted = max(held.granted, seen.level)
    return held if held.known and counted == held.counted else replace(held, counted=counted, known=True)


def used_w(supplies: Supplies, held: Sequence[Held]) -> list[int]:
    """What counts in each supply."""
    used = [0] * len(supplies.limits_w)
    for load, path, one in zip(supplies.loads, supplies.paths, held, strict=True):
        add(used, path, load.draw_w[one.counted])
    return used


def no_room(used: Sequence[int], limits_w: Sequence[int], path: Sequence[int], more_w: int) -> int | None:
    """The first supply on the path in which so much more does not fit; None if it fits in all.

    Above its limit a supply has no room even for what counts already: that may be more than what really flows.
    """
    for number in path:
        if used[number] + more_w > limits_w[number]:
            return number
    return None


def add(used: list[int], path: Sequence[int], more_w: int) -> None:
    """Count so much more in every supply on the path."""
    for number in path:
        used[number] += more_w


def more_w(draw_w: Sequence[int], counted: int, level: int) -> int:
    """What a grant of this level adds to what the bay counts with already."""
    return draw_w[max(counted, level)] - draw_w[counted]


def lowered(held: Held, level: int, now_s: float) -> Held:
    """The grant goes down. What the bay counts with stays until that is seen."""
    return replace(held, granted=level, lowered_s=now_s, room_s=None)


def raised(held: Held, level: int, now_s: float) -> Held:
    """The grant goes up, and counts at once."""
    return replace(held, granted=level, counted=max(held.counted, level), rose_s=now_s, room_s=None)
