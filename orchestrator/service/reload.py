"""Puts changed policies into force without a restart: rereads them on request; each bay adopts its own in standby.

Policies only: wiring and hard limits are fixed while the service runs. A file with an error changes nothing.
"""

import threading
from collections.abc import Callable, Sequence

from orchestrator.config.load import load_station
from orchestrator.config.station import Station
from orchestrator.errors import OrchestratorError
from orchestrator.model import Cause
from orchestrator.service.bay import BayRunner


class Reload:
    """Reads the station's files in its own thread: the control loop must not wait for a disk.

    However many requests arrive meanwhile, it reads once more for all of them.
    """

    def __init__(self, station: Station, bays: Sequence[BayRunner], say: Callable[[Cause], None]) -> None:
        self._file, self._bays, self._say = station.source.file, bays, say
        self._asked = threading.Event()
        self._thread = threading.Thread(target=self._run, name="reload", daemon=True)

    def start(self) -> None:
        """Start waiting for requests."""
        self._thread.start()

    def ask(self) -> None:
        """Request a reload; the result is reported to people."""
        self._asked.set()

    def _run(self) -> None:
        while True:
            self._asked.wait()
            self._asked.clear()
            try:
                self.read()
            except Exception as error:  # noqa: BLE001 - the next attempt may succeed
                self._say(Cause.of("reload_failed", file=self._file, error=repr(error)))

    def read(self) -> None:
        """Offer each bay its policy from the present station file."""
        try:
            fresh = {bay.name: bay for bay in load_station(self._file).bays}
        except OrchestratorError as error:
            self._say(Cause.of("reload_refused", file=self._file, findings=str(error)))
            return
        for runner in self._bays:
            self._say(Cause.of("reload", bay=runner.name, what=runner.policy.offer(fresh.get(runner.name))))
