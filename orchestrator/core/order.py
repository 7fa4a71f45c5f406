"""Who comes first, as a table: each rule gives a number, the smaller goes first; then the next rule decides."""

from collections.abc import Callable
from math import inf

from orchestrator.core.supply import Held, Want

#: A place is kept at least this long: shorter turns wear contactors, and much of each goes into ramps and checks.
TURN_S = 15 * 60.0
#: Room must have lasted this long before a level is raised: what another bay gives up for a moment is no room.
RAISE_HOLD_S = 10.0
#: A bay's level goes up at most this often; a charger and its checks need some seconds to settle on each.
RAISE_EVERY_S = 60.0

Rule = Callable[[Want, Held, float], float]


def class_of(want: Want, _held: Held, _now_s: float) -> float:
    """By priority: a class gets all it wants before the next one gets anything."""
    return want.priority


def keeps_its_place(want: Want, held: Held, _now_s: float) -> float:
    """A precharge or constant-voltage tail that has begun is not interrupted for others of its class."""
    return 0 if want.keeps and held.granted else 1


def in_its_turn(_want: Want, held: Held, now_s: float) -> float:
    """A turn lasts for a while, and does not begin before its first level is granted."""
    return 0 if held.turn_s is not None and (not held.granted or now_s - held.turn_s < TURN_S) else 1


def waits_too_long(_want: Want, held: Held, now_s: float) -> float:
    """Whoever has waited for a whole turn comes before those who have had theirs, the longest wait first."""
    return held.waits_s if held.waits_s is not None and starves(held, now_s) else inf


def hurries(want: Want, _held: Held, _now_s: float) -> float:
    """The least time to spare first."""
    return want.laxity_s


def waits(_want: Want, held: Held, _now_s: float) -> float:
    """Those who wait before those who charge, the longest wait first."""
    return held.waits_s if held.waits_s is not None else inf


ORDER: tuple[Rule, ...] = (class_of, keeps_its_place, in_its_turn, waits_too_long, hurries, waits)


def place_in_line(want: Want, held: Held, now_s: float) -> tuple[float, ...]:
    """By all rules."""
    return tuple(rule(want, held, now_s) for rule in ORDER)


def starves(held: Held, now_s: float) -> bool:
    """It has waited for a whole turn."""
    return held.waits_s is not None and now_s - held.waits_s >= TURN_S


def raises_at_s(held: Held) -> float:
    """When a bay for which there is room may go up."""
    since_s = held.room_s if held.room_s is not None else inf
    return max(since_s + RAISE_HOLD_S, held.rose_s + RAISE_EVERY_S)
