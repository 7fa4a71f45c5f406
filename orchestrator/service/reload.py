"""Puts changed policies into force without a restart: rereads them on request; each bay adopts its own in standby.

Policies only: wiring and hard limits are fixed while the service runs. A file with an error changes nothing.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from orchestrator.config.load import load_station
from orchestrator.config.station import Station
from orchestrator.errors import OrchestratorError
from orchestrator.model import Cause
from orchestrator.service.bay import BayRunner
from orchestrator.service.policy_in_force import changes


class Reading:
    """One request to read the files, and its result."""

    def __init__(self) -> None:
        self.done = False
        self.refusal: Cause | None = None  #: why no policy changes at all; None: each has its own answer
        self.answers: dict[str, Cause] = {}  #: by bay; the station's own keys by the file's name


class Reload:
    """Reads the station's files in its own thread: the control loop must not wait for a disk.

    However many requests arrive meanwhile, it reads once more for all of them.
    """

    def __init__(self, station: Station, bays: Sequence[BayRunner], say: Callable[[Cause], None]) -> None:
        self._station, self._file, self._bays, self._say = station, station.source.file, bays, say
        self._asked = threading.Event()
        self._readings: deque[Reading] = deque()  # those that wait for the next time
        self._thread = threading.Thread(target=self._run, name="reload", daemon=True)

    def start(self) -> None:
        """Start waiting for requests."""
        self._thread.start()

    def ask(self) -> Reading:
        """Request a reload; the result is also reported to people."""
        reading = Reading()
        self._readings.append(reading)
        self._asked.set()
        return reading

    def _run(self) -> None:
        while True:
            self._asked.wait()
            self._asked.clear()
            waiting, result = list(self._taken()), Reading()
            try:
                self.read(result)
            except Exception as error:  # noqa: BLE001 - the next attempt may succeed
                result.refusal = Cause.of("reload_failed", file=self._file, error=repr(error))
                self._say(result.refusal)
            for reading in waiting:
                reading.refusal, reading.answers = result.refusal, result.answers
                reading.done = True

    def _taken(self) -> Iterator[Reading]:
        with suppress(IndexError):
            while True:
                yield self._readings.popleft()

    def read(self, result: Reading) -> None:
        """Offer each bay its policy from the present station file."""
        try:
            fresh = load_station(self._file)
        except OrchestratorError as error:
            result.refusal = Cause.of("reload_refused", file=self._file, findings=str(error))
            self._say(result.refusal)
            return
        result.answers = self._offered(fresh)
        for name, what in result.answers.items():
            self._say(Cause.of("reload", bay=name, what=what))

    def _offered(self, fresh: Station) -> dict[str, Cause]:
        new = {bay.name: bay for bay in fresh.bays}
        answers = {runner.name: runner.policy.offer(new.pop(runner.name, None)) for runner in self._bays}
        answers |= {name: Cause.of("needs_restart", changes=Cause("bay_new")) for name in new}
        if replace(fresh, bays=self._station.bays) != self._station:
            file = Path(self._file).name
            answers[file] = Cause.of(
                "needs_restart", changes=changes(self._station, replace(fresh, bays=self._station.bays))
            )
        return answers
