"""The station's supplies in the running service: one allocation for all bays, twice a second, in the control loop.

Theory of operation. After each decision a bay tells what it would use and what its charger shows (`decided`). `turn`
divides the supplies and names the bays that must decide at once, because another level is granted to them. A lower
level is in force once the bay has decided on it: from then on the interlock refuses more, and only two statuses in a
row that were requested later prove anything. Until that, and after a start, a charger counts with what it may have been
told.

If the allocation itself fails, every bay keeps what was verified, nothing rises, and each bay has a fault.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from time import monotonic

from orchestrator.config.station import Station
from orchestrator.core import demand, ledger
from orchestrator.core.allocate import allocate
from orchestrator.core.draw import supplies_of
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.core.supply import Held, Load, Supplies, Want
from orchestrator.model import Cause, Decision, Snapshot
from orchestrator.model.bay_document import Shared, Supplied
from orchestrator.model.document import SupplyFields
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import as_told

#: How often the supplies are divided.
EVERY_S = 0.5
#: A bay that has told nothing for this long is not in hand. It is decided twice a second.
QUIET_S = 3.0
#: Readings are timed in whole milliseconds.
ROUNDED_S = 0.001
#: The figures of a cause are renewed when one of these moments changes, or with another cause or level.
MOMENTS = ("turn_t_s", "raise_t_s")


@dataclass(slots=True)
class Feed:
    """One bay's part. A bay in no supply has an empty one, with which nothing changes."""

    load: Load | None = None
    held: Held = Held(0)
    want: Want = demand.NOTHING
    shown: int | None = None  #: the level that its charger was last verified to be at
    told_s: float = -inf  #: when it last told something
    in_force_s: float = inf  #: since when the interlock holds the present level; inf: it does not yet
    last: tuple[int, float] | None = None  #: the level and time of the status before, if it was requested since then
    why: Cause | None = None
    problem: Cause | None = None

    def into(self, snapshot: Snapshot) -> Snapshot:
        """The snapshot with what is granted."""
        if self.load is None:
            return snapshot
        return replace(snapshot, granted=self.held.granted, granted_why=self.why, supply_problem=self.problem)

    def decided(self, now_s: float, snapshot: Snapshot, memory: Memory, decision: Decision, rules: Rules) -> None:
        """Note a decision of the bay, once its command and its grant have been handed to the port."""
        if self.load is None:
            return
        f = Facts.of(now_s, snapshot, memory, rules)
        self.told_s, self.want, self.shown = now_s, demand.want(f, decision), demand.level(f)
        if self.shown is None:
            self.held = ledger.observed(self.held, self.load.top, None)
        elif f.reading is not None and f.reading.t_s > self.in_force_s:
            self._seen(self.shown, f.reading.t_s, self.load.top)
        if self.in_force_s == inf and snapshot.granted == self.held.granted:
            self.in_force_s, self.last = monotonic() + ROUNDED_S, None

    def _seen(self, shown: int, t_s: float, top: int) -> None:
        """Two statuses in a row prove a level, the higher one of both: a charger may follow a command late."""
        last, self.last = self.last, (shown, t_s)
        if last is not None and last[1] < t_s:
            self.held = ledger.observed(self.held, top, ledger.Seen(max(shown, last[0]), t_s))
        elif last is not None:
            self.last = last

    def grant(self, held: Held, why: Cause) -> bool:
        """Take a new grant; True if its level is another one."""
        other = held.granted != self.held.granted
        if held.granted < self.held.granted:
            self.in_force_s = inf
        self.held = held
        if other or not why.same_as(self.why) or any(why.param(x) != (self.why and self.why.param(x)) for x in MOMENTS):
            self.why = why
        return other

    def status(self, clock: WallClock, language: str) -> Supplied:
        """Its part of the bay's status. Any thread: what is held is taken once, as the control loop replaces it."""
        load, held, why = self.load, self.held, self.why
        if load is None or why is None:
            return {}
        told = as_told(clock.told(why), language)
        return {
            "supply": {
                "name": load.supply,
                "granted": held.granted,
                "granted_w": load.draw_w[held.granted],
                "counted_w": load.draw_w[held.counted],
                "cause": told,
                "text": told["text"],
            }
        }


@dataclass(slots=True)
class Feeds:
    """All of them. `say` gets a failure of the allocation, once."""

    supplies: Supplies
    say: Callable[[Cause], None]
    feeds: list[Feed]  #: of all bays, in the order of the station file
    fed: list[int]  #: the numbers of those in a supply, in the order of `supplies`
    last_s: float = -inf
    problem: Cause | None = None

    @classmethod
    def of(cls, station: Station, say: Callable[[Cause], None]) -> "Feeds":
        """Every charger may be running until its stop is verified."""
        supplies, outside = supplies_of(station)
        fed = [number for number, bay in enumerate(station.bays) if bay.name not in outside]
        found = cls(supplies, say, [Feed() for _ in station.bays], fed)
        for number, load in zip(fed, supplies.loads, strict=True):
            found.feeds[number] = Feed(load, ledger.unproved(load.top), why=found._asks(load.supply))
        return found

    def turn(self, now_s: float) -> list[int]:
        """Divide the supplies, if it is time; the numbers of the bays whose level changes, the lowered ones first."""
        if not self.fed or now_s - self.last_s < EVERY_S:
            return []
        self.last_s = now_s
        feeds = [self.feeds[number] for number in self.fed]
        for feed, load in zip(feeds, self.supplies.loads, strict=True):
            if now_s - feed.told_s > QUIET_S:
                feed.held = ledger.observed(feed.held, load.top, None)
        before = [feed.held.granted for feed in feeds]
        try:
            grants = allocate(self.supplies, [feed.want for feed in feeds], [feed.held for feed in feeds], now_s)
        except Exception as error:  # noqa: BLE001 - whatever it is: nothing may rise on what it would have said
            self._failed(error, feeds, now_s)
        else:
            self.problem = None
            for feed, load, one in zip(feeds, self.supplies.loads, grants, strict=True):
                feed.problem = None
                feed.grant(one.held, one.cause or self._asks(load.supply))
        changes = [feed.held.granted - was for feed, was in zip(feeds, before, strict=True)]
        return [number for change, number in sorted(zip(changes, self.fed, strict=True)) if change]

    def _failed(self, error: Exception, feeds: Sequence[Feed], now_s: float) -> None:
        problem = Cause.of("supply_failed", error=repr(error))
        if problem != self.problem:
            self.say(problem)
        self.problem = problem
        for feed, load in zip(feeds, self.supplies.loads, strict=True):
            feed.problem = problem
            verified = feed.shown if feed.held.known and feed.shown is not None else 0
            if verified < feed.held.granted:
                at = self._asks(load.supply)  # a limit says where it stands
                feed.grant(ledger.lowered(feed.held, verified, now_s), replace(problem, key=at.key, place=at.place))

    def _asks(self, name: str) -> Cause:
        """Why no more is granted to a bay that has all that it has asked for."""
        place = next(supply.place for supply in self.supplies.supplies if supply.name == name)
        return Cause.of("supply_asks", key=f"supplies.{name}.limit_w", place=place, supply=name)

    def status(self, language: str) -> Shared:
        """What each supply has promised, and which bays wait in it; nothing where there are none."""
        feeds = [self.feeds[number] for number in self.fed]
        used_w = ledger.used_w(self.supplies, [feed.held for feed in feeds])
        members = list(zip(self.supplies.loads, self.supplies.paths, feeds, strict=True))
        shown = list[SupplyFields]()
        for number, (supply, limit_w) in enumerate(zip(self.supplies.supplies, self.supplies.limits_w, strict=True)):
            waiting = tuple(
                load.bay for load, path, feed in members if number in path and feed.want.top and not feed.held.granted
            )
            promises = Cause.of(
                "supply_promises", key=f"supplies.{supply.name}.limit_w", place=supply.place,
                supply=supply.name, used_w=used_w[number], limit_w=limit_w,
            )  # fmt: skip
            promises = promises.with_(then=Cause.of("supply_waiting", bays=waiting)) if waiting else promises
            told = as_told(promises, language)
            shown.append({
                "name": supply.name, "within": supply.within, "limit_w": limit_w, "promised_w": used_w[number],
                "waiting": list(waiting), "cause": told, "text": told["text"],
            })  # fmt: skip
        return {"supplies": shown} if shown else {}
