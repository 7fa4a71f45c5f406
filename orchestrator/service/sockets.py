"""Where the running station is reached: the control socket, what answers on it, and the readers of `watch`."""

from collections.abc import Callable, Sequence
from time import monotonic, time

from orchestrator.config.station import Station
from orchestrator.model import Cause
from orchestrator.service.bay import BayRunner
from orchestrator.service.control import ControlSocket
from orchestrator.service.journal import Journal
from orchestrator.service.published import Published
from orchestrator.service.reload import Reload
from orchestrator.service.request_handler import RequestHandler
from orchestrator.service.station_status import StationStatus
from orchestrator.service.store import Store
from orchestrator.service.strays import Strays
from orchestrator.service.streams import Streams


class Sockets:
    """All of it. `wake` makes the control loop decide the bay with this number."""

    def __init__(
        self,
        station: Station,
        bays: Sequence[BayRunner],
        journal: Journal,
        store: Store,
        strays: Strays,
        reload: Reload,
        wake: Callable[[int], None],
        say: Callable[[Cause], None],
    ) -> None:
        shown = StationStatus(station, bays, journal, store, strays, monotonic)
        self._streams = Streams(Published(bays, shown.parts), monotonic, say)
        self.handler = RequestHandler(shown, bays, journal, store, strays, reload, monotonic, time, wake)
        self.control = ControlSocket(
            station.control.socket, self.handler.answer, monotonic, say, station.language.value, self.handler.refused,
            watch=self._streams.take,
        )  # fmt: skip

    def start(self) -> None:
        """Begin to answer."""
        self._streams.start()
        self.control.start()

    def stalled(self, now_s: float) -> bool:
        """True if nobody can be stopped by request any more."""
        return self.control.stalled(now_s)

    def close(self) -> None:
        """Accept nothing from now on."""
        self.control.close()
        self._streams.close()
