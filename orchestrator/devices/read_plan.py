"""Chooses the next object of a BMU to read: the most overdue one that may be requested."""

from math import inf

from orchestrator.config.station import BatteryConfig
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.devices.polled import Fields, Polled
from orchestrator.devices.sdo_client import Key, SdoClient
from orchestrator.protocol.objects import Sweep, TpdoEntry

AGAIN_S = 0.2  #: the delay before a read is repeated: all that a lost frame costs, besides its time-out
TPDO_PERIODS = 3  #: an object that no TPDO carried for this many periods is read every sweep again


class ReadPlan:
    """The objects of one BMU, by the map of its station file, and their periods, by the budget of the bus."""

    __slots__ = ("_budget", "_by_key", "_share", "_tpdo_s", "objects")

    def __init__(self, config: BatteryConfig, budget: BusBudget) -> None:
        self.objects = tuple(Polled(entry) for entry in config.map.objects)
        self._by_key = {polled.key: polled for polled in self.objects}
        self._budget = budget
        self._tpdo_s = config.tpdo_s
        kinds = [entry.sweep for entry in config.map.objects]
        self._share = budget.join({sweep: kinds.count(sweep) for sweep in Sweep}, config.sweep_s)

    def __getitem__(self, key: Key) -> Polled:
        return self._by_key[key]

    def get(self, key: Key) -> Polled | None:
        """The object with this key, if it is one of ours."""
        return self._by_key.get(key)

    def restart(self, now_s: float) -> None:
        """The node booted: everything is due, and its earlier values no longer count."""
        for polled in self.objects:
            polled.forget(due_s=now_s)

    @property
    def closely(self) -> bool:
        """Whether the fast objects are read every sweep."""
        return self._share.closely

    def watch(self, *, closely: bool) -> None:
        """Read the fast objects at once and then every sweep, or as rarely as the others."""
        self._budget.watch(self._share, closely=closely)
        for polled in self.objects if closely else ():
            if polled.entry.sweep is Sweep.FAST:
                polled.due_s = -inf

    @property
    def fast_s(self) -> float:
        """How often the fast objects are read."""
        return self._budget.period_s(self._share, Sweep.FAST)

    def choose(self, now_s: float, client: SdoClient) -> Polled | float:
        """The object to read now, or the time at which to call this again."""
        due = self._most_overdue()
        if due.due_s > now_s:
            return due.due_s
        if client.may_ask(due.key):
            return due
        # An answer about any other object will prove that no answer about this one can still arrive.
        others = [polled for polled in self.objects if client.may_ask(polled.key)]
        if others:
            return min(others, key=_due_s)
        if now_s < client.quiet_s:
            return client.quiet_s
        client.clear()
        return due

    @property
    def due_s(self) -> float:
        """When the next object is to be read."""
        return self._most_overdue().due_s

    def _most_overdue(self) -> Polled:
        first = self.objects[0]
        for polled in self.objects:  # three times as fast as min(); runs twice per read of every node
            if polled.due_s < first.due_s:
                first = polled
        return first

    def unanswered(self, key: Key, now_s: float) -> None:
        """Its request was not answered: repeat it soon, whatever its period. Ignores objects that are not read."""
        if key in self._by_key:
            polled = self._by_key[key]
            polled.due_s = min(polled.due_s, now_s + AGAIN_S)

    def asked(self, polled: Polled, now_s: float) -> None:
        """It is being read now; schedule the next time."""
        by_tpdo = self._tpdo_s is not None and now_s - polled.tpdo_t_s < TPDO_PERIODS * self._tpdo_s
        polled.due_s = now_s + self._budget.period_s(self._share, Sweep.SLOW if by_tpdo else polled.entry.sweep)

    def from_tpdo(self, tpdo: TpdoEntry, data: bytes, now_s: float) -> list[Fields] | None:
        """The values of each object in a TPDO; None if its length does not fit."""
        objects = [self._by_key[index, 0] for index in tpdo.objects]
        if len(data) != sum(polled.entry.size for polled in objects):
            return None
        values, begin = [], 0
        for polled in objects:
            end = begin + polled.entry.size
            values.append(polled.from_tpdo(int.from_bytes(data[begin:end], "little"), now_s))
            begin = end
        return values


def _due_s(polled: Polled) -> float:
    return polled.due_s
