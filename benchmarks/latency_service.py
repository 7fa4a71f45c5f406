"""The unchanged service with two timestamps: when a decoded reading means stop, and when the stop was written.

    python -m benchmarks.latency_service STATION HOT_C

Guardian and controller, as in `orchestrator run`. Ends on SIGTERM; then the controller prints a JSON line for each bay:
{"bay", "hot_s", "stop_s", "free_s"}.
"""

import json
import os
import socket
import sys
from collections.abc import Callable
from time import monotonic
from unittest.mock import patch

from orchestrator.config.load import load_station
from orchestrator.config.station import BatteryConfig, Station
from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.lastresort.guardian import Guardian
from orchestrator.link.serial import SerialLine
from orchestrator.protocol.charger import STOP_FRAME
from orchestrator.service import ports, supervisor
from orchestrator.service.guarded import GuardianLink

CONTROLLER_ARGUMENTS = 3  #: more arguments than this: the guardian's socket is the last


class Times:
    """Of one bay, monotonic seconds."""

    def __init__(self) -> None:
        self.hot_s: float | None = None  #: the first reading of a hot pack is decoded and visible
        self.stop_s: float | None = None  #: the first stop frame after it was handed to the port
        self.free_s = 0.0  #: the last read of a poll's answer before the stop returned


def main() -> int:
    """The guardian, which starts this again as the controller."""
    if len(sys.argv) > CONTROLLER_ARGUMENTS:
        return control(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]))
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.set_inheritable(True)
    command = [sys.executable, "-m", "benchmarks.latency_service", *sys.argv[1:], str(theirs.fileno())]
    child = os.posix_spawn(sys.executable, command, os.environ)
    theirs.close()
    return Guardian(child, ours).run()


def control(path: str, hot_c: float, fd: int) -> int:
    """Serve, then report."""
    station = load_station(path)
    of_port = {bay.charger.port: Times() for bay in station.bays}
    with (
        patch.object(ports, "SerialLine", _line_class(of_port)),
        patch.object(supervisor, "BatteryNode", _node_class(station, of_port, hot_c)),
    ):
        guardian = GuardianLink(fd)
        chargers = ports.ChargerPorts(station, guardian)
        chargers.start()
        status = supervisor.Supervisor(station, guardian, chargers).run()
    for bay in station.bays:
        times = of_port[bay.charger.port]
        print(json.dumps({"bay": bay.name, **vars(times)}))
    return status


def _line_class(of_port: dict[str, Times]) -> type[SerialLine]:
    class TimedLine(SerialLine):
        """Timestamps frames handed over and returning reads."""

        @property
        def times(self) -> Times:
            return of_port[str(self._port.port)]

        def write(self, data: bytes) -> None:
            super().write(data)
            times = self.times
            if data == STOP_FRAME and times.hot_s is not None and times.stop_s is None:
                times.stop_s = monotonic()

        def read(self, timeout_s: float, expected: int = 0) -> bytes:
            data = super().read(timeout_s, expected)
            if self.times.stop_s is None:
                self.times.free_s = monotonic()
            return data

    return TimedLine


def _node_class(station: Station, of_port: dict[str, Times], hot_c: float) -> type[BatteryNode]:
    place = {(bay.battery.can, bay.battery.node_id): of_port[bay.charger.port] for bay in station.bays}

    class TimedNode(BatteryNode):
        """Timestamps the moment its view first shows a hot pack, before it is reported."""

        def __init__(self, bus: str, config: BatteryConfig, budget: BusBudget, on_change: Callable[[], None]) -> None:
            times = place[bus, config.node_id]

            def stamped() -> None:
                temperature = self.view[0].temperature_c
                if times.hot_s is None and temperature is not None and temperature.value >= hot_c:
                    times.hot_s = monotonic()
                on_change()

            super().__init__(bus, config, budget, stamped)

    return TimedNode


if __name__ == "__main__":
    sys.exit(main())
