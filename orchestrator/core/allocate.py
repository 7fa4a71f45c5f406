"""`allocate()`: who may charge how fast, so that no supply is ever asked for more than its limit. A pure function.

Theory of operation. First a plan, made afresh from what is wanted: class by class, everyone's lowest level in the
order of `ORDER`, then one level at a time to the bay with the smallest share of what it wants, while it fits. Bays that
are not known stand in the plan with what they count with. Then each grant moves towards the plan: down at once, up by
one level where the ledger (`ledger.py`) has room, after a hold and at most once a minute. So the plan decides who gets
it, the ledger alone decides whether there is any, and nothing flaps.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush
from itertools import groupby

from orchestrator.core import ledger
from orchestrator.core.order import class_of, keeps_its_place, place_in_line, raises_at_s, starves
from orchestrator.core.supply import Grant, Held, Supplies, Want
from orchestrator.core.why import Round, why

__all__ = ["allocate", "moved"]


def allocate(supplies: Supplies, wants: Sequence[Want], held: Sequence[Held], now_s: float) -> tuple[Grant, ...]:
    """The grants from now on, in the order of the bays; `held` is what they have had, as observed by now."""
    plan = _Plan.of(supplies, wants, held, now_s)
    used, after = ledger.used_w(supplies, held), list(held)
    refused: list[int | None] = [None] * len(held)
    for bay in plan.order:  # whoever comes first in the plan gets the room first
        level = plan.levels[bay]
        placed = _placed(held[bay], wants[bay], level, now_s)
        after[bay], refused[bay] = moved(supplies, used, bay, placed, level, now_s)
    now = Round(supplies, wants, after, plan.levels, plan.bound, refused, used, now_s)
    causes = {bay: why(now, bay) for bay in plan.order}
    return tuple(Grant(one.granted, causes[bay], one) for bay, one in enumerate(after))


def moved(
    supplies: Supplies, used: list[int], bay: int, held: Held, level: int, now_s: float
) -> tuple[Held, int | None]:
    """What a bay has after one move towards this level, and the supply that has no room for it yet.

    This alone raises a grant, and counts it in `used` at once.
    """
    if level < held.granted:
        return ledger.lowered(held, level, now_s), None
    if level == held.granted:
        return (held if held.room_s is None else replace(held, room_s=None)), None
    one = held if held.room_s is not None else replace(held, room_s=now_s)
    path, more_w = supplies.paths[bay], ledger.more_w(supplies.loads[bay].draw_w, one.counted, one.granted + 1)
    refused = ledger.no_room(used, supplies.limits_w, path, more_w)
    if refused is not None or now_s < raises_at_s(one):
        return one, refused
    ledger.add(used, path, more_w)
    return ledger.raised(one, one.granted + 1, now_s), None


def _placed(held: Held, want: Want, level: int, now_s: float) -> Held:
    """With its turn and its wait. The turn begins with the first level granted; until then its place is kept for it."""
    turn_s = waits_s = None
    if level:
        turn_s = held.turn_s if held.granted and held.turn_s is not None else now_s
    elif held.known and want.top:
        waits_s = held.waits_s if held.waits_s is not None else now_s
    if turn_s == held.turn_s and waits_s == held.waits_s:
        return held
    return replace(held, turn_s=turn_s, waits_s=waits_s)


@dataclass(slots=True)
class _Plan:
    """A plan while it is being made."""

    supplies: Supplies
    wants: Sequence[Want]
    held: Sequence[Held]
    now_s: float
    levels: list[int]
    bound: list[int | None]  #: the supply in which a bay's next level does not fit
    used: list[int]
    order: list[int]

    @classmethod
    def of(cls, supplies: Supplies, wants: Sequence[Want], held: Sequence[Held], now_s: float) -> "_Plan":
        """The whole plan."""
        count = len(held)
        made = cls(supplies, wants, held, now_s, [0] * count, [None] * count, [0] * len(supplies.limits_w), [])
        charging: list[int] = []
        for bay, (one, want) in enumerate(zip(held, wants, strict=True)):
            draw_w = supplies.loads[bay].draw_w
            ledger.add(made.used, supplies.paths[bay], draw_w[0] if one.known else draw_w[one.counted])
            (charging if one.known and want.top else made.order).append(bay)
        line = sorted((place_in_line(wants[bay], held[bay], now_s), bay) for bay in charging)
        for _, members in groupby((bay for _, bay in line), key=lambda bay: class_of(wants[bay], held[bay], now_s)):
            bays = list(members)
            made._lowest(bays)
            made._fair(bays)
            made.order += bays
        return made

    def _lowest(self, bays: Sequence[int]) -> None:
        """One class's lowest levels. What somebody has waited for too long is spared by those who begin after him."""
        kept = [bay for bay in bays if keeps_its_place(self.wants[bay], self.held[bay], self.now_s) == 0]
        for bay in kept:
            self._take(bay, self.used)
        floor, spared = list(self.used), [0] * len(self.used)
        for bay in bays[len(kept) :]:
            one = self.held[bay]
            begins = any(spared) and not one.granted
            used = [sum(both) for both in zip(self.used, spared, strict=True)] if begins else self.used
            if not self._take(bay, used) and starves(one, self.now_s) and self._lacks(bay, floor) is None:
                ledger.add(spared, self.supplies.paths[bay], self._next_w(bay))

    def _fair(self, bays: Sequence[int]) -> None:
        """One class's further levels: always to the smallest share of what is wanted."""
        heap = [(self._share(bay), rank) for rank, bay in enumerate(bays) if 0 < self.levels[bay] < self.wants[bay].top]
        heapify(heap)
        while heap:
            _, rank = heappop(heap)
            bay = bays[rank]
            if self._take(bay, self.used) and self.levels[bay] < self.wants[bay].top:
                heappush(heap, (self._share(bay), rank))

    def _share(self, bay: int) -> float:
        draw_w = self.supplies.loads[bay].draw_w
        return draw_w[self.levels[bay]] / (draw_w[self.wants[bay].top] or 1)

    def _next_w(self, bay: int) -> int:
        draw_w, level = self.supplies.loads[bay].draw_w, self.levels[bay]
        return draw_w[level + 1] - draw_w[level]

    def _lacks(self, bay: int, used: Sequence[int]) -> int | None:
        """The supply in which the bay's next level does not fit."""
        return ledger.no_room(used, self.supplies.limits_w, self.supplies.paths[bay], self._next_w(bay))

    def _take(self, bay: int, used: Sequence[int]) -> bool:
        """One level more, if it fits beside what is used."""
        self.bound[bay] = self._lacks(bay, used)
        if self.bound[bay] is not None:
            return False
        ledger.add(self.used, self.supplies.paths[bay], self._next_w(bay))
        self.levels[bay] += 1
        return True
