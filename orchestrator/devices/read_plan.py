"""Chooses the next object of a BMU to read: the most overdue one that may be requested."""

from orchestrator.config.station import BatteryConfig
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.devices.polled import Fields, Polled
from orchestrator.devices.sdo_client import Key, SdoClient
from orchestrator.protocol.objects import Sweep, TpdoEntry

AGAIN_S = 0.2  #: the delay before a read is repeated: all that a lost frame costs, besides its time-out
TPDO_PERIODS = 3  #: an object that no TPDO carried for this many periods is read every sweep again


class ReadPlan:
    """The objects of one BMU, by the map of its station file, and their periods, by the budget of the bus."""

    __slots__ = ("_budget", "_by_key", "_sweep_s", "_tpdo_s", "objects")

    def __init__(self, config: BatteryConfig, budget: BusBudget) -> None:
        self.objects = tuple(Polled(entry) for entry in config.map.objects)
        self._by_key = {polled.key: polled for polled in self.objects}
        self._budget = budget
        self._sweep_s, self._tpdo_s = config.sweep_s, config.tpdo_s
        fast = sum(entry.sweep is Sweep.FAST for entry in config.map.objects)
        budget.join(fast, len(self.objects) - fast, config.sweep_s)

    def __getitem__(self, key: Key) -> Polled:
        return self._by_key[key]

    def get(self, key: Key) -> Polled | None:
        """The object with this key, if it is one of ours."""
        return self._by_key.get(key)

    def restart(self, now_s: float) -> None:
        """The node booted: everything is due, and its earlier values no longer count."""
        for polled in self.objects:
            polled.forget(due_s=now_s)

    def choose(self, now_s: float, client: SdoClient) -> Polled | float:
        """The object to read now, or the time at which to call this again."""
        due = min(self.objects, key=_due_s)
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

    def unanswered(self, key: Key, now_s: float) -> None:
        """Its request was not answered: repeat it soon, whatever its period. Ignores objects that are not read."""
        if key in self._by_key:
            polled = self._by_key[key]
            polled.due_s = min(polled.due_s, now_s + AGAIN_S)

    def asked(self, polled: Polled, now_s: float) -> None:
        """It is being read now; schedule the next time."""
        by_tpdo = self._tpdo_s is not None and now_s - polled.tpdo_t_s < TPDO_PERIODS * self._tpdo_s
        slow = by_tpdo or polled.entry.sweep is Sweep.SLOW
        polled.due_s = now_s + (self._budget.slow_s if slow else self._budget.fast_s(self._sweep_s))

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
