"""Chargers in hand without a bay: an earlier run had them running, on a port that the station file no longer has.

Every stop includes those. Each is stopped on its recorded port until two consecutive status replies show standby, and
watched for a little longer; then its port is released. Its bay's persisted state stays, and holds the bay if it ever
comes back.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from math import inf
from os.path import abspath
from threading import Thread

from orchestrator.devices.charger import ChargerPort
from orchestrator.errors import RequestError
from orchestrator.model import STOP, Alarm, Cause, ChargerReading, Operation
from orchestrator.model.bay_document import Stray
from orchestrator.service.closing import close_all
from orchestrator.service.past import Place, shown
from orchestrator.service.store import Store
from orchestrator.text.catalogue import fields, say

#: Up to this current a charger delivers nothing: its measurement is no better.
STANDBY_A = 0.5
#: A charger that runs again within this was not stopped (FAULTS C30).
WATCHED_S = 10.0


@dataclass
class _Stray:
    """One such charger."""

    place: Place
    port: ChargerPort
    ran_s: float = -inf  #: when it was last seen running
    stop_s: float | None = None  #: when the first stop after that was sent
    seen_s: float | None = None  #: the request time of the first reply after that which showed standby
    verified_s: float | None = None  #: when it had shown it twice
    closed: bool = False


class Strays:
    """All of them. `open_port` creates a port without starting it; `say` informs people. Used by the control loop."""

    def __init__(self, store: Store, open_port: Callable[[Place], ChargerPort], say: Callable[[Cause], None]) -> None:
        self._store, self._open_port, self._say = store, open_port, say
        self._strays: list[_Stray] = []

    def begin(self) -> None:
        """Begin to stop each of them."""
        for place in self._store.strays():
            port = self._open_port(place)
            port.command(STOP)
            port.start()
            self._strays.append(_Stray(place, port))
            self._tell("stray_found", place)

    def look(self, now_s: float) -> None:
        """Check their progress."""
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
            pass  # the reading is older than the stop
        elif stray.seen_s is None:
            stray.seen_s = reading.t_s
        elif stray.verified_s is None and reading.t_s > stray.seen_s:
            stray.verified_s = now_s
            self._tell("stray_verified", stray.place)
            self._remember(stray, running=False)
        elif stray.verified_s is not None and now_s - stray.verified_s >= WATCHED_S:
            stray.closed = True
            self._remember(stray, running=False, lasts=True)
            close_all([stray.port.close], 0.0)

    def _runs(self, stray: _Stray, reading: ChargerReading) -> None:
        if stray.verified_s is not None:
            self._tell("stray_runs", stray.place)
            self._remember(stray, running=True)
        stray.ran_s, stray.stop_s, stray.seen_s, stray.verified_s = reading.t_s, None, None, None

    def _remember(self, stray: _Stray, *, running: bool, lasts: bool = False) -> int:
        """Persist what it does now; `lasts`: its standby is believed."""
        persisted = self._store.past(stray.place)
        why = Cause.of("stray_ran", port=shown(stray.place.port))
        out = None if lasts else persisted.uncontrollable
        kept = replace(persisted, running=running, uncontrollable=out, hold=persisted.hold or why)
        return self._store.put(stray.place, kept)

    def drop(self, port: str) -> tuple[str, int]:
        """Forget a charger that a person reports gone for good. Returns its name, and the revision that persists that.

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
        revision = self._remember(stray, running=False, lasts=True)
        self._tell("stray_dropped", stray.place)
        Thread(target=stray.port.close, name="drop", daemon=True).start()  # its driver may be slow
        return str(stray.place), revision

    def _tell(self, id_: str, place: Place) -> None:
        self._say(_cause(id_, place))

    @property
    def unverified(self) -> list[Cause]:
        """Those that may still be running."""
        return [_cause("stray", stray.place) for stray in self._strays if stray.verified_s is None]

    @property
    def alarm(self) -> Alarm:
        """The alarm level: somebody must find out why such a charger exists, even if it is in standby."""
        if self.unverified:
            return Alarm.DANGER
        return Alarm.ATTENTION if self._strays else Alarm.NONE

    @property
    def ports(self) -> Iterable[ChargerPort]:
        """The ports to close at the end."""
        return [stray.port for stray in self._strays]

    def status(self, language: str = "en") -> list[Stray]:
        """The entries for the status document."""
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
