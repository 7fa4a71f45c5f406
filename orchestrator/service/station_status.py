"""The status document of the running station, for everything that shows it."""

from collections.abc import Callable, Sequence

from orchestrator.config.station import Station
from orchestrator.model.bay_document import Status
from orchestrator.service.bay import BayRunner
from orchestrator.service.journal import Journal
from orchestrator.service.status import station_status
from orchestrator.service.store import Store
from orchestrator.service.strays import Strays
from orchestrator.service.supply import Feeds


class StationStatus:
    """Describes the station. Any thread."""

    def __init__(
        self,
        station: Station,
        bays: Sequence[BayRunner],
        journal: Journal,
        store: Store,
        strays: Strays,
        feeds: Feeds,
        clock: Callable[[], float],
        wall: Callable[[], float],
    ) -> None:
        self.language = station.language.value  #: of its texts
        self._station, self._bays = station, bays
        self._journal, self._store, self._strays, self._feeds = journal, store, strays, feeds
        self._clock, self._wall = clock, wall

    def document(self, bays: Sequence[BayRunner], *, closely: bool = False) -> Status:
        """With these bays; `closely`: with what costs too much for every bay of every answer."""
        now_s, shown = self._clock(), [bay.status(closely=closely) for bay in bays]
        problem, not_persisted = self._journal.problem(now_s), self._store.not_persisted(now_s)
        alarm = max(self._strays.alarm, *(bay.alarm for bay in self._bays))
        strays = self._strays.status(self.language)
        found = station_status(self._station, alarm, shown, problem, not_persisted, strays, self._wall())
        return {**found, **self._feeds.status(self.language)}

    def parts(self) -> dict[str, object]:
        """Everything but the bays."""
        return {name: part for name, part in self.document([]).items() if name != "bays"}
