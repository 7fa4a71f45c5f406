"""What binds a grant, as a table: the first rule that gives a cause is the one that people see."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from orchestrator.core.order import TURN_S, raises_at_s
from orchestrator.core.supply import Held, Supplies, Want
from orchestrator.model import Cause


@dataclass(frozen=True, slots=True)
class _Members:
    """What is said of the bays in one supply."""

    unknown: tuple[str, ...]  #: not in hand
    falling: tuple[str, ...]  #: count with more than they are granted, until that is seen
    standby_w: int  #: what all of them draw in standby
    ends: list[tuple[float, str]]  #: the turns, the next to end last

    @classmethod
    def of(cls, supplies: Supplies, held: Sequence[Held], number: int) -> "_Members":
        rows = zip(supplies.loads, supplies.paths, held, strict=True)
        bays = [(load, one) for load, path, one in rows if number in path]
        turns = [(one.turn_s + TURN_S, load.bay) for load, one in bays if one.turn_s is not None]
        return cls(
            tuple(load.bay for load, one in bays if not one.known),
            tuple(load.bay for load, one in bays if one.known and one.counted > one.granted),
            sum(load.draw_w[0] for load, _ in bays),
            sorted(turns, reverse=True),
        )


@dataclass(frozen=True, slots=True)
class Round:
    """One allocation, when its grants are made."""

    supplies: Supplies
    wants: Sequence[Want]
    held: Sequence[Held]
    levels: Sequence[int]  #: as planned
    bound: Sequence[int | None]  #: the supply in which the plan has no more for a bay
    refused: Sequence[int | None]  #: the supply in which what is planned does not fit yet
    used: Sequence[int]
    now_s: float
    known: dict[int, _Members] = field(default_factory=dict)  #: those of the supplies that were asked about

    def of_supply(self, id_: str, number: int, **params: Any) -> Cause:  # noqa: ANN401 - as those of a cause
        """A cause with a supply and what counts in it, and with those bays that are not in hand, if any."""
        supply, limit_w = self.supplies.supplies[number], self.supplies.limits_w[number]
        cause = Cause(
            id_,
            (("supply", supply.name), ("used_w", self.used[number]), ("limit_w", limit_w), *params.items()),
            f"supplies.{supply.name}.limit_w",
            supply.place,
        )
        unknown = self.members(number).unknown
        return cause.with_(then=Cause.of("supply_unknown_bays", bays=unknown)) if unknown else cause

    def members(self, number: int) -> _Members:
        """The bays in a supply, looked at once."""
        if number not in self.known:
            self.known[number] = _Members.of(self.supplies, self.held, number)
        return self.known[number]


def why(now: Round, bay: int) -> Cause | None:
    """What binds the bay's grant; None for one that has all that it wants."""
    return next((cause for rule in WHY if (cause := rule(now, bay)) is not None), None)


def _not_in_hand(now: Round, bay: int) -> Cause | None:
    """Its charger may be running: it counts with its highest step, and is granted nothing."""
    if now.held[bay].known:
        return None
    return _of_own(now, "supply_not_in_hand", bay, counts_w=now.supplies.loads[bay].draw_w[now.held[bay].counted])


def _never(now: Round, bay: int) -> Cause | None:
    """Its lowest step does not fit, even if all others stand by."""
    number, draw_w = now.bound[bay], now.supplies.loads[bay].draw_w
    if number is None or now.levels[bay]:
        return None
    need_w = now.members(number).standby_w - draw_w[0] + draw_w[1]
    return now.of_supply("supply_never", number, need_w=need_w) if need_w > now.supplies.limits_w[number] else None


def _in_line(now: Round, bay: int) -> Cause | None:
    """Not enough for everyone's lowest step: it waits for a place. Each turn that ends is told to one of those."""
    number = now.bound[bay]
    if number is None or now.levels[bay]:
        return None
    ends, waits_s = now.members(number).ends, now.held[bay].waits_s
    if not ends or waits_s is None:
        return now.of_supply("supply_line", number)
    end_s, other = ends.pop()
    at_s = end_s if end_s > now.now_s else max(now.now_s, waits_s + TURN_S)
    return now.of_supply("supply_turn", number, other=other, turn_t_s=at_s)


def _unproved(now: Round, bay: int) -> Cause | None:
    """What others have given up is not seen yet."""
    number = now.refused[bay]
    return None if number is None else now.of_supply("supply_unproved", number, others=now.members(number).falling)


def _hold(now: Round, bay: int) -> Cause | None:
    """There is room: it goes up when that has lasted. A bay that charges is told no moment: its rule is kept."""
    held = now.held[bay]
    if held.granted >= now.levels[bay]:
        return None
    if held.granted:
        return _of_own(now, "supply_rises", bay)
    return _of_own(now, "supply_raise", bay, raise_t_s=raises_at_s(held))


def _of_own(now: Round, id_: str, bay: int, **params: Any) -> Cause:  # noqa: ANN401 - as those of a cause
    """A cause with the supply that the bay is directly on."""
    supply = now.supplies.supplies[now.supplies.paths[bay][0]]
    pairs = (("supply", supply.name), *params.items())
    return Cause(id_, pairs, f"supplies.{supply.name}.limit_w", supply.place)


def _full(now: Round, bay: int) -> Cause | None:
    """The next step does not fit."""
    number = now.bound[bay]
    return None if number is None else now.of_supply("supply_full", number)


WHY: tuple[Callable[[Round, int], Cause | None], ...] = (_not_in_hand, _never, _in_line, _unproved, _hold, _full)
