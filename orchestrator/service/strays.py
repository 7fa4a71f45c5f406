"""Chargers in hand that no bay has any more: an earlier run had them run, on a port that the station file lacks now.

Whoever stops, stops those too. Each is stopped on the port that was written down, until two status replies in a row
show that it stands by, and is watched for a little longer; then its port is given back. What was known of its bay stays
written down, and holds it if it ever comes back.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from math import inf
from os.path import abspath
from threading import Thread

from orchestrator.devices.charger import ChargerPort
from orchestrator.errors import RequestError
from orchestrator.model import STOP, Alarm, Cause, ChargerReading, Operation
from orchestrator.service.closing import close_all
from orchestrator.service.past import Place, shown
from orchestrator.service.store import Store
from orchestrator.text.catalogue import fields, say

#: A charger that delivers no more than this delivers nothing: its measurement is no better.
STANDBY_A = 0.5
#: One that runs again within this was not stopped (FAULTS C30).
WATCHED_S = 10.0


@dataclass
class _Stray:
    """One such charger."""

    place: Place
    port: ChargerPort
    ran_s: float = -inf  #: when it was last seen to run
    stop_s: float | None = None  #: when the first stop after that was sent
    seen_s: float | None = None  #: when it was first asked and showed standby after that
    verified_s: float | None = None  #: when it had shown it twice
    closed: bool = False


class Strays:
    """All of them. `open_port` makes a port that is not started yet; `say` tells people. Used by the control loop."""

    def __init__(self, store: Store, open_port: Callable[[Place], ChargerPort], say: Callable[[Cause], None]) -> None:
        self._store, self._open_port, self._say = store, open_port, say
        self._strays: list[_Stray] = []

    def begin(self) -> None:
        """Begin to stop each of them."""
        for place in self._store.strays():
            port = self._open_port(place)
            port.order(STOP)
            port.start()
            self._strays.append(_Stray(place, port))
            self._tell("stray_found", place)

    def look(self, now_s: float) -> None:
        """See how far they have come."""
        for stray in self._strays:
            if not stray.closed:
                self._look(stray, now_s)

    def _look(self, stray: _Stray, now_s: float) -> None:
        reading, link = stray.port.view
        if reading is None or not link.online:
            stray.seen_s = None
            return
        if reading.operation is not Operation.STOPPED or reading.current_a > STANDBY_A:
            self._runs(stray, reading)
        elif stray.stop_s is None:
            if link.stop_sent_s is not None and link.stop_sent_s > stray.ran_s:
                stray.stop_s = link.stop_sent_s
        elif reading.t_s < stray.stop_s:
            pass  # it is older than the stop
        elif stray.seen_s is None:
            stray.seen_s = reading.t_s
        elif stray.verified_s is None and reading.t_s > stray.seen_s:
            stray.verified_s = now_s
            self._tell("stray_verified", stray.place)
            self._remember(stray, running=False)
        elif stray.verified_s is not None and now_s - stray.verified_s >= WATCHED_S:
            stray.closed = True
            close_all([stray.port.close], 0.0)

    def _runs(self, stray: _Stray, reading: ChargerReading) -> None:
        if stray.verified_s is not None:
            self._tell("stray_runs", stray.place)
            self._remember(stray, running=True)
        stray.ran_s, stray.stop_s, stray.seen_s, stray.verified_s = reading.t_s, None, None, None

    def _remember(self, stray: _Stray, *, running: bool) -> int:
        persisted = self._store.past(stray.place)
        why = Cause.of("stray_ran", port=shown(stray.place.port))
        return self._store.put(stray.place, replace(persisted, running=running, hold=persisted.hold or why))

    def drop(self, port: str) -> tuple[str, int]:
        """A person says that a charger is gone for good: forget it. What was forgotten, and the revision that keeps it.

        Nothing else is lost: its bay stays held if it ever comes back. RequestError where it is not gone.
        """
        wanted = Place("", abspath(port))  # noqa: PTH100 - not resolved
        stray = next((one for one in self._strays if one.verified_s is None and one.place.is_port_of(wanted)), None)
        if stray is None:
            there = tuple(shown(one.place.port) for one in self._strays if one.verified_s is None)
            raise RequestError(Cause.of("stray_unknown" if there else "stray_none", port=shown(port), ports=there))
        if stray.port.view[1].online:
            raise RequestError(_cause("stray_answers", stray.place))
        self._strays = [one for one in self._strays if one is not stray]
        revision = self._remember(stray, running=False)
        self._tell("stray_dropped", stray.place)
        Thread(target=stray.port.close, name="drop", daemon=True).start()  # its driver may take its time
        return str(stray.place), revision

    def _tell(self, id_: str, place: Place) -> None:
        self._say(_cause(id_, place))

    @property
    def unverified(self) -> list[Cause]:
        """Those that may be running still."""
        return [_cause("stray", stray.place) for stray in self._strays if stray.verified_s is None]

    @property
    def alarm(self) -> Alarm:
        """Somebody must find out why such a charger is there, also when it stands by."""
        if self.unverified:
            return Alarm.DANGER
        return Alarm.ATTENTION if self._strays else Alarm.NONE

    @property
    def ports(self) -> Iterable[ChargerPort]:
        """To be closed at the end."""
        return [stray.port for stray in self._strays]

    def status(self, language: str = "en") -> list[dict[str, object]]:
        """For the status document."""
        return [
            {
                "bay": stray.place.bay,
                "port": stray.place.port,
                "state": "STOPPING" if stray.verified_s is None else "HELD",
                "verified": stray.verified_s is not None,
                "problem": say(stray.port.view[1].problem, language),
                "cause": fields(stray.port.view[1].problem, language),
            }
            for stray in self._strays
        ]


def _cause(id_: str, place: Place) -> Cause:
    return Cause.of(id_, bay=place.bay, port=shown(place.port))
