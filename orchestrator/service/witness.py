"""The service that may be running beside an `estop`: told to hold what was stopped, and asked what it sees.

While it runs it reads the ports, and would get the answers to anybody else's questions; so its readings are the proof.
They must be newer than the stop, as everywhere else.
"""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from orchestrator.errors import ServiceError
from orchestrator.link.holder import control_socket
from orchestrator.service.control import ask

#: A service that hangs must not keep `estop` from verifying by itself. Its own guardian gives it as long.
ANSWER_S = 0.5
#: Standby may show so much, as everywhere else.
STANDBY_A = 0.5

Bay = Mapping[str, Any]  #: of the status document


class Service:
    """The service that holds one of these ports, else the one behind `socket`, if one is named.

    `every_bay`: it is to hold all its bays, not only those of these ports.
    """

    def __init__(self, names: Iterable[str], socket: str, *, every_bay: bool) -> None:
        self.said = ""  #: what became of it, for people
        self._ports = {os.path.realpath(name) for name in names}
        self._named, self._every_bay = socket, every_bay
        self._path = Path(socket)
        self._told = self._there = False

    def hold(self) -> None:
        """Tell it to hold its bays until an operator starts them. To be called until it has been there."""
        if self._told:
            return
        self._there = False
        found = next(filter(None, map(control_socket, self._ports)), self._named)
        if not found:
            self.said = "no service holds these ports"
            return
        self._path = Path(found)
        try:
            bays = None if self._every_bay else [bay["name"] for port, bay in self._bays() if port in self._ports]
            results = ask(self._path, {"verb": "stop", "bays": bays}, ANSWER_S)["results"]
        except (ServiceError, LookupError, TypeError) as error:
            self.said = f"no service was told: {error}"
            return
        self._told = self._there = True
        answers = dict(results) if isinstance(results, Mapping) else {}
        refused = [f"{name}: {answer}" for name, answer in answers.items() if answer]
        held = ", ".join(name for name, answer in answers.items() if not answer)
        holds = (
            f"the service holds {held} until an operator starts it" if held else "the service holds none of these ports"
        )
        self.said = "; ".join([holds, *refused])

    def sees(self, names: Iterable[str], since_s: float) -> dict[str, str]:
        """Of these ports, those whose chargers the service is in touch with: "" for standby shown since then."""
        if not self._there:
            return {}
        try:
            bays = dict(self._bays())
            found = {name: bays.get(os.path.realpath(name)) for name in names}
            return {name: _doubt(bay, since_s) for name, bay in found.items() if bay and bay["charger"]["online"]}
        except (ServiceError, LookupError, TypeError):
            return {}  # it has ended meanwhile

    def _bays(self) -> list[tuple[str, Bay]]:
        """Each bay with its port's real name."""
        bays: Any = ask(self._path, {"verb": "status"}, ANSWER_S)["bays"]
        return [(os.path.realpath(bay["port"]), bay) for bay in bays]


def _doubt(bay: Bay, since_s: float) -> str:
    charger = bay["charger"]
    if charger["t_s"] <= since_s:
        return "no proof of standby: the service has not heard from the charger since"
    if charger["operation"] == 0 and charger["current_a"] <= STANDBY_A:
        return ""
    return f"NOT stopped: the service says {bay['state']}: {bay['reason']}"
