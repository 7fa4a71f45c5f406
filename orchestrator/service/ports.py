"""The chargers' ports: the first part of the service to start, before the rest is even imported.

Each port stops its charger as soon as it is open (`devices/charger.py`). Nothing that comes later, such as the import
of a library, an unreadable disk or a CAN adapter that hangs, can delay that stop.
"""

import signal
from collections.abc import Callable
from functools import partial
from queue import Empty, SimpleQueue
from time import monotonic

from orchestrator.config.station import ChargerConfig, Limits, Rs485, Station
from orchestrator.devices.charger import ChargerPort
from orchestrator.link.serial import SerialLine
from orchestrator.service.guarded import GuardedLine, GuardianLink

#: The rest of the service waits this long for the first stops: Python runs one thread at a time, and importing takes it
#: from the ports. A port takes a millisecond or two; one whose driver hangs is not waited for any longer.
STOPS_S = 0.1
#: What ends the service, or lets it reread its policies.
REQUESTS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
#: The problems of a port that is still to write its first stop.
BEGINNINGS = ("port_not_opened", "port_opened")


class ChargerPorts:
    """The port of every bay, in their order. When something has changed, each calls `changed` with its bay's number.

    At first that puts the number into `news`; who reads it may put something in between that lets less through.
    """

    def __init__(self, station: Station, guardian: GuardianLink) -> None:
        self.news: SimpleQueue[int | None] = SimpleQueue()
        self.changed: Callable[[int], None] = self.news.put
        self.all = tuple(
            charger_port(bay.charger, bay.limits, partial(self._changed, number), guardian)
            for number, bay in enumerate(station.bays)
        )

    def _changed(self, number: int) -> None:
        self.changed(number)

    def start(self) -> None:
        """Stop every charger; returns once each open port has written its stop, or after STOPS_S.

        From now on an end must be orderly: REQUESTS wait until the control loop can obey them.
        """
        signal.pthread_sigmask(signal.SIG_BLOCK, REQUESTS)
        for port in self.all:
            port.start()
        waiting, end_s = set(range(len(self.all))), monotonic() + STOPS_S
        while waiting and (left_s := end_s - monotonic()) > 0:
            try:
                number = self.news.get(timeout=left_s)
            except Empty:
                return
            if number is not None and _has_begun(self.all[number]):
                waiting.discard(number)


def _has_begun(port: ChargerPort) -> bool:
    """Whether the port has written its first stop, or has failed."""
    _, link = port.view
    return link.sent is not None or link.problem is None or link.problem.id not in BEGINNINGS


def charger_port(
    charger: ChargerConfig, limits: Limits, poke: Callable[[], None], guardian: GuardianLink
) -> ChargerPort:
    """The port of one charger, not started; `poke` is called for every reading."""
    port, kernel = charger.port, charger.rs485 is Rs485.KERNEL
    return ChargerPort(
        charger,
        limits,
        open_line=partial(GuardedLine, port, partial(SerialLine.open, port, kernel_rs485=kernel), guardian),
        clock=monotonic,
        on_change=poke,
    )
