"""The service that may be running beside an `estop`: told to hold the stopped bays, and queried for its readings.

A running service reads the ports, and would receive the answers to anybody else's questions; so its readings are the
proof. As everywhere else, they must be newer than the stop, and there are two witnesses: a charger that shows 0 A while
the BMU sees current is running. All of this has its own thread: no stop waits for a hung or slow service.
"""

import os
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.lastresort.port_owner import services
from orchestrator.lastresort.signing import signed

#: After this long without an answer, the service is asked again.
ANSWER_S = 0.5
#: How often its readings are queried, and how old they may be.
LOOK_S, FRESH_S = 0.1, 1.5
#: The most current that standby may show, at the charger and at the BMU, as everywhere else.
STANDBY_A, BMU_STANDBY_A = 0.5, 1.0
NOBODY = "no service is running"
UNTOLD = "the service has not answered in time: nobody holds its bays"

Bay = Mapping[str, Any]  #: a bay in the status document


class Services:
    """Every service that holds one of these ports, else the one behind `socket`, if given.

    `every_bay`: they must hold all their bays, not only those of these ports. `because`: what they tell of it.
    """

    def __init__(self, names: Iterable[str], socket: str, *, every_bay: bool, because: str = "") -> None:
        self._names, self._named = list(names), socket
        self._made = partial(Service, self._names, every_bay=every_bay, because=because)
        self._found: list[Service] = []
        self._looked = threading.Event()

    def start(self) -> None:
        """Find them, notify them, and keep querying them."""
        threading.Thread(target=self._look, name="services", daemon=True).start()

    def wait(self, end_s: float) -> None:
        """Wait until all have answered, but not beyond `end_s`."""
        self._looked.wait(max(0.0, end_s - time.monotonic()))
        for service in self._found:
            service.told.wait(max(0.0, end_s - time.monotonic()))

    def sees(self, name: str, since_s: float) -> tuple[float, str] | None:
        """The latest reading from the service in touch with this port's charger (see `Service.sees`)."""
        return next((seen for one in self._found if (seen := one.sees(name, since_s)) is not None), None)

    @property
    def said(self) -> list[str]:
        """Each service's result, for people; with its path if there are several."""
        if not self._found:
            return [UNTOLD]
        return [f"{one.path}: {one.said}" if len(self._found) > 1 else one.said for one in self._found]

    @property
    def untold(self) -> bool:
        """Whether a service that holds a port may start its charger again, because it has not accepted the stop."""
        return not self._looked.is_set() or any(one.holds and not one.took for one in self._found)

    def _look(self) -> None:
        paths, mute = services(self._names)
        found = [self._made(path, holds=True) for path in paths]
        if not paths or mute:  # the given socket may belong to one of the invisible services
            found.append(self._made(self._named, mute=mute))
        self._found = found
        self._looked.set()
        for service in self._found:
            service.start()


class Service:
    """The service behind this socket, if any; `holds` if it has one of these ports open.

    `mute`: processes that also have one open and may be behind this socket; their own sockets are not visible.
    """

    def __init__(
        self, names: Iterable[str], socket: str, *, every_bay: bool, because: str = "", holds: bool = False,
        mute: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self.said = UNTOLD  #: the result, for people
        self.told = threading.Event()  #: it has answered, or there is none
        self.took = False  #: it holds its bays, or nobody could start them
        self.path, self.holds, self._mute = Path(socket), holds or bool(mute), mute
        self._ports = {os.path.realpath(name) for name in names}
        self._named, self._every_bay, self._because = socket, every_bay, because
        self._seen: tuple[float, Mapping[str, Bay]] = (0.0, {})
        self._thread = threading.Thread(target=self._run, name="service", daemon=True)

    def start(self) -> None:
        """Notify it, and keep querying it."""
        self._thread.start()

    def sees(self, name: str, since_s: float) -> tuple[float, str] | None:
        """Its latest sample of this port's charger, with "" for standby. None: it is not in touch with the charger."""
        seen_s, bays = self._seen
        bay = bays.get(os.path.realpath(name)) if time.monotonic() - seen_s <= FRESH_S else None
        try:
            return _sample(bay, since_s) if bay else None
        except (LookupError, TypeError):
            return None  # another version of the service

    def _run(self) -> None:
        while True:
            try:
                if not self.told.is_set() and not self._hold():
                    return
                self._seen = time.monotonic(), dict(self._bays())
            except (ServiceError, LookupError, TypeError, ValueError) as error:
                if not self.told.is_set():
                    silent = str(error).startswith("no service answers")
                    why = "it does not answer" if silent else error
                    self.said = f"the service has not taken the stop ({why}): nobody holds its bays"
            time.sleep(LOOK_S)

    def _hold(self) -> bool:
        """Tell it to hold its bays until an operator starts them. False if there is no service."""
        if not _listens(self._named):
            self.said = self._unseen if self._mute else NOBODY
            self.took = not self._mute
            self.told.set()  # a service that starts now stops its chargers first anyway
            return False
        bays = None if self._every_bay else [bay["name"] for port, bay in self._bays() if port in self._ports]
        stop = signed({"verb": "stop", "bays": bays, "means": "estop"}, self._because)
        results = ask(self.path, stop, ANSWER_S)["results"]
        answers = dict(results) if isinstance(results, Mapping) else {}
        refused = [f"{name}: {answer}" for name, answer in answers.items() if answer]
        held = ", ".join(name for name, answer in answers.items() if not answer)
        holds = (
            f"the service holds {held} until an operator starts it" if held else "the service holds none of these ports"
        )
        self.said = "; ".join([holds, *refused])
        self.took = not self._mute or any(port in self._ports for port, _ in self._bays())
        if not self.took:
            self.said = f"{self._unseen}; {self.path}: {self.said}"
        self.told.set()
        return True

    @property
    def _unseen(self) -> str:
        pids = ", ".join(map(str, self._mute))
        return f"a service that holds a port (pid {pids}) was not told: its control socket is not to be found"

    def _bays(self) -> list[tuple[str, Bay]]:
        """Each bay with its port's real path."""
        bays: Any = ask(self.path, {"verb": "status"}, ANSWER_S)["bays"]
        return [(os.path.realpath(bay["port"]), bay) for bay in bays]


def _listens(path: str) -> bool:
    """Whether there may be a service behind this name, even one too busy to accept a connection."""
    import socket  # noqa: PLC0415 - asking.py imports it anyway

    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(ANSWER_S)
        try:
            probe.connect(path)
        except (FileNotFoundError, ConnectionRefusedError):
            return False
        except (OSError, ValueError):
            return bool(path)
    return True


def _sample(bay: Bay, since_s: float) -> tuple[float, str] | None:
    charger, battery = bay["charger"], bay["battery"]
    at_s, amps, bmu_a = charger["t_s"] or 0.0, charger["current_a"] or 0.0, battery.get("current_a") or 0.0
    bmu_sees = f"the BMU sees {bmu_a:.1f} A" if battery["online"] and bmu_a > BMU_STANDBY_A else ""
    if not charger["online"]:
        return (at_s, f"NOT stopped: {bmu_sees}, and the charger does not answer") if bmu_sees else None
    if at_s <= since_s:
        return at_s, "no proof of standby: the service has not heard from the charger since"
    if charger["operation"] == 0 and amps <= STANDBY_A:
        return at_s, f"NOT stopped: the charger says {amps:.1f} A, {bmu_sees}" if bmu_sees else ""
    return at_s, f"NOT stopped: the service says {bay['state']}: {bay['reason']}"
