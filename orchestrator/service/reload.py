"""A changed policy comes into force without a restart: read anew when asked, each bay takes it over when it stands by.

Only policies: what is wired where, and the hard limits, are fixed for as long as the service runs. A file with an error
changes nothing.
"""

import threading
from collections.abc import Callable, Sequence

from orchestrator.config.load import load_station
from orchestrator.config.station import Station
from orchestrator.errors import OrchestratorError
from orchestrator.service.bay import BayRunner


class Reload:
    """Reads the station's files in a thread of its own: the control loop must not wait for a disk.

    However often it is asked meanwhile, it reads once more, and that finds what all of them meant.
    """

    def __init__(self, station: Station, bays: Sequence[BayRunner], say: Callable[[str], None]) -> None:
        self._file, self._bays, self._say = station.source.file, bays, say
        self._asked = threading.Event()
        self._thread = threading.Thread(target=self._run, name="reload", daemon=True)

    def start(self) -> None:
        """Wait to be asked."""
        self._thread.start()

    def ask(self) -> None:
        """Begin; what comes of it is said."""
        self._asked.set()

    def _run(self) -> None:
        while True:
            self._asked.wait()
            self._asked.clear()
            try:
                self.read()
            except Exception as error:  # noqa: BLE001 - the next one may be better
                self._say(f"{self._file}: reload failed, every policy stays as it is: {error!r}")

    def read(self) -> None:
        """Offer each bay what its station file says now."""
        try:
            fresh = {bay.name: bay for bay in load_station(self._file).bays}
        except OrchestratorError as error:
            self._say(f"{error}\n{self._file}: reload refused, every policy stays as it is")
            return
        for runner in self._bays:
            self._say(f"{runner.name}: reload: {runner.policy.offer(fresh.get(runner.name))}")
