"""Where the running station is reached: the control socket, the view socket, and the readers of `watch` on both."""

from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic, time

from orchestrator.config.station import Station
from orchestrator.model import Cause
from orchestrator.service.bay import BayRunner
from orchestrator.service.control import ControlSocket
from orchestrator.service.journal import Journal
from orchestrator.service.published import Published
from orchestrator.service.reload import Reload
from orchestrator.service.request_handler import RequestHandler
from orchestrator.service.request_log import RequestLog
from orchestrator.service.station_status import StationStatus
from orchestrator.service.store import Store
from orchestrator.service.strays import Strays
from orchestrator.service.streams import Streams
from orchestrator.service.supply import Feeds
from orchestrator.service.viewer import Viewer


class Sockets:
    """All of it. `wake` makes the control loop decide the bay with this number."""

    def __init__(
        self,
        station: Station,
        bays: Sequence[BayRunner],
        journal: Journal,
        store: Store,
        strays: Strays,
        feeds: Feeds,
        reload: Reload,
        wake: Callable[[int], None],
        say: Callable[[Cause], None],
    ) -> None:
        shown = StationStatus(station, bays, journal, store, strays, feeds, monotonic, time)
        self._streams = Streams(Published(bays, shown.parts, time), monotonic, say)
        self.handler = RequestHandler(shown, bays, journal, store, strays, reload, monotonic, time, wake)
        viewer = Viewer(self.handler.answer, RequestLog(journal, monotonic, shown.language), time)

        def opened(path: Path, answering: RequestHandler | Viewer, group: str | None) -> ControlSocket:
            return ControlSocket(
                path, answering.answer, monotonic, say, shown.language, answering.refused,
                watch=self._streams.take, group=group,
            )  # fmt: skip

        named = station.control
        self.control = opened(named.socket, self.handler, named.group)
        self._view = opened(named.view_socket, viewer, named.view_group) if named.view_socket is not None else None

    def start(self) -> None:
        """Begin to answer."""
        self._streams.start()
        self.control.start()
        if self._view is not None:
            self._view.start()

    def stalled(self, now_s: float) -> bool:
        """True if no bay can be stopped by request any more. A view socket that hangs is no reason to end."""
        return self.control.stalled(now_s)

    def close(self) -> None:
        """Accept nothing from now on."""
        self.control.close()
        if self._view is not None:
            self._view.close()
        self._streams.close()
