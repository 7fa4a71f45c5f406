"""`orchestrator estop`: stops chargers without a service, or beside one that hangs or runs.

Each port is opened by its own thread, ignoring the lock that a service holds, and the first stops go out before
anything else happens. Standard library only, plus PyYAML if a station file has to be read.
"""

import os
import sys
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial

from orchestrator.lastresort.bareport import HELD
from orchestrator.lastresort.contactors import Contactors
from orchestrator.lastresort.descriptors import Turns, room
from orchestrator.lastresort.estop_options import USAGE, Options
from orchestrator.lastresort.laststop import LastStop

Contactor = tuple[str, int, bool]  #: chip, line, active low
#: A contactor's driver that has not answered this long after the end hangs.
OPEN_S = 0.5
UNTOLD = "a service that holds a port could not be told: it may start its chargers again"
HURRIED = "interrupted: every charger was sent its stop, but not each was given the time to prove it: run this again"
LOST = "every charger that was found is told of here, but it may have named more, and those may run"
#: How long to wait for the proof of standby, and for a service's answer.
VERIFY_S = 3.0
#: How long a charger in standby is watched: one that runs again was not stopped.
WATCH_S = 1.0
#: How long a slow reader of our output may delay us.
READER_S = 2.0
#: How long to wait for the service's files: their disk may hang.
READ_S = 1.0


def main(words: list[str], catch: Callable[[Callable[[], None]], None] = lambda _: None) -> int:
    """Stop, verify and report; returns the exit status. `catch` receives the function that asks this to end early."""
    if "-h" in words or "--help" in words:
        _say(1, USAGE.rstrip())
        return 0
    options = Options(words)
    if options.wrong:
        _say(2, f"orchestrator estop: {options.wrong}\n{USAGE.rstrip()}")
        return 2
    stop = EmergencyStop(options)
    catch(stop.hurry)
    stop.stop(dict.fromkeys(options.ports, ""))
    if options.stations or not options.ports:
        stop.by_station()
    return stop.finish()


class EmergencyStop:
    """One emergency stop, from the first port to the report."""

    def __init__(self, options: Options) -> None:
        self._options, self._socket = options, options.socket
        self._began_s = time.monotonic()
        self._stopping = LastStop(leave_held=options.leave_held, watch_s=WATCH_S, turns=Turns(room()))
        self._bays: dict[str, str] = {}  # by port: the bay's name, if any
        self._real: dict[str, str] = {}  # a port's real path → the name given for it
        self._contactors: tuple[Contactor, ...] = ()
        self._opened = Contactors()
        self._notes: list[str] = []
        self._doubts: list[str] = []  # why this may be incomplete, although every known charger is in standby

    def stop(self, bays: Mapping[str, str]) -> None:
        """Stop the chargers on these ports; a port with two names is stopped once."""
        new = {}
        for port, bay in bays.items():
            real = os.path.realpath(port)
            if real not in self._real:
                self._real[real] = port
                new[port] = bay
            elif bay and not self._bays.get(self._real[real], bay):
                self._bays[self._real[real]] = bay
        self._bays.update(new)
        self._stopping.stop(dict.fromkeys(new))

    def hurry(self) -> None:
        """End early: as soon as every charger has been sent its stop, with a report of what is known."""
        self._stopping.hurried = True

    def by_station(self) -> None:
        """Stop the ports that a station file names, and other ports in hand."""
        journals = self._take_any() if not self._options.stations else [self._take(self._options.stations[0])]
        readings = [threading.Thread(target=self._take_in_hand, args=(name,), daemon=True) for name in journals if name]
        end_s = time.monotonic() + READ_S
        for reading in readings:
            reading.start()
        for reading in readings:
            reading.join(max(0.0, end_s - time.monotonic()))
        if any(reading.is_alive() for reading in readings):
            self._notes.append("the journal cannot be read in time: ports that it may name besides were not stopped")

    def _take_any(self) -> list[str]:
        """Find the station file if none is named; if several services run, take all of theirs."""
        from orchestrator.lastresort.inhand import stations  # noqa: PLC0415 - only where it is needed

        for together in stations():
            journals = []
            for station in together:
                before = len(self._bays)
                journals.append(self._take(station))
                if journals[-1] or len(self._bays) > before:
                    self._notes.append(f"station file: {os.path.abspath(station)}")  # noqa: PTH100 - pathlib has none
            if self._bays or any(journals):
                return journals
        return []

    def _take(self, station: str) -> str:
        """Stop the ports that this file names, as far as it can be read; returns the journal's directory."""
        from pathlib import Path  # noqa: PLC0415 - only where it is needed

        from orchestrator.config.ports import wiring  # noqa: PLC0415 - PyYAML

        try:
            found = wiring(Path(station))
        except OSError as error:
            notes = self._doubts if self._options.ports else self._notes
            notes.append(f"{station}: {error.strerror}")
            return ""
        self.stop(found.ports)
        if found.damaged:
            self._doubts.append(f"{station} is damaged: {LOST}")
        self._socket, self._contactors = self._socket or found.socket, found.contactors
        return found.journal

    def _take_in_hand(self, journal: str) -> None:
        from orchestrator.lastresort.inhand import ports_in_hand  # noqa: PLC0415 - the first stops are out now

        self.stop(ports_in_hand(journal))

    def finish(self) -> int:
        """Verify all of them, with whatever help is available, and report each result; returns the exit status."""
        if not self._bays:
            return self._without_ports()
        if self._options.leave_held:
            whys = self._stopping.finish(VERIFY_S, on_round=self._isolate)
        else:
            whys = self._with_services()
        self._opened.wait(OPEN_S)
        if self._stopping.hurried:
            self._doubts.append(HURRIED)
        return self._tell(whys)

    def _without_ports(self) -> int:
        """Have a running service stop all its bays: it may know ports that the station file no longer names."""
        if self._socket and not self._options.leave_held:
            self._with_services()
        for note in self._notes + self._doubts:
            _say(2, note)
        _say(2, "no port to stop: name a station file or --port PATH")
        return 1

    def _with_services(self) -> dict[str, str]:
        """Notify the services, and verify with their readings."""
        try:
            from orchestrator.lastresort.running_service import Services  # noqa: PLC0415 - the first stops are out now
        except OSError as error:
            self._doubts.append(f"{UNTOLD} ({error.strerror})")
            return self._stopping.finish(VERIFY_S, on_round=self._isolate)
        every_bay = bool(self._options.stations) or not self._options.ports
        services = Services(self._bays, self._socket, every_bay=every_bay, because=self._options.because)
        self._stopping.witness = services.sees
        services.start()
        whys = self._stopping.finish(VERIFY_S, on_round=self._isolate) if self._bays else {}
        services.wait(self._began_s + VERIFY_S)
        self._notes += services.said
        if services.untold:
            self._doubts.append(UNTOLD)
        return whys

    def _isolate(self) -> None:
        """Open the contactors, independently of each other."""
        for contactor in self._contactors:
            self._opened.open(contactor, partial(_open, contactor))

    def _tell(self, whys: Mapping[str, str]) -> int:
        """Report the results, what to do first; returns the exit status."""
        names = {port: f"{bay} ({port})" if (bay := self._bays[port]) else port for port in whys}
        running = [names[port] for port, why in whys.items() if why not in ("", HELD)]
        they = "it stands" if len(running) == 1 else "they stand"
        lines = [f"CUT THE MAINS of {', '.join(running)}: nothing proves that {they} by"] if running else []
        lines += [f"{names[port]}: {why or 'standby verified'}" for port, why in whys.items()]
        became = self._opened.became
        lines += [f"contactor on {one[0]} line {one[1]}: {became[one]}" for one in self._contactors if one in became]
        lines += self._doubts
        if not any(whys.values()) and not self._doubts:
            lines.append("every charger stands by, verified")
        _say(1, "\n".join(lines))
        for note in self._notes:
            _say(2, note)
        return 1 if any(whys.values()) or self._doubts else 0


def _open(contactor: Contactor) -> str:
    from orchestrator.lastresort.lastopen import request  # noqa: PLC0415 - the first stops are out now

    chip, number, active_low = contactor
    return request(chip, number, active_low=active_low)


def _say(fd: int, text: str) -> None:
    """Print; a terminal that lacks a character, is stopped or gone must not change the outcome."""
    from orchestrator.lastresort.notify import put  # noqa: PLC0415 - the first stops are out now

    stream = sys.stdout if fd == 1 else sys.stderr
    encoding = getattr(stream, "encoding", None) or "ascii"
    put(fd, f"{text}\n".encode(encoding, errors="backslashreplace"), READER_S)
