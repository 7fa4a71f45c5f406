"""The controller process, as the guardian starts it: `python -m orchestrator.service.controller FD STATION`."""

import os
import sys

from orchestrator.config.load import load_station
from orchestrator.errors import ConfigError, OrchestratorError, ServiceError
from orchestrator.lastresort.descriptors import raised
from orchestrator.service.guarded import GuardianLink
from orchestrator.service.supervisor import Supervisor

#: Open files besides bays and buses: streams, sockets, journal, clients.
SHARED = 32


def main(fd: int, station: str) -> int:
    """Run the service for a station file; 0 if every charger was verified at the end."""
    guardian = GuardianLink(fd)  # stays open to the very end: closing it signals the end of this process
    try:
        loaded = load_station(station)
        check_limit(len(loaded.bays), len(loaded.can))
        return Supervisor(loaded, guardian).run()
    except ConfigError as error:
        print(error, file=sys.stderr)  # noqa: T201 - what people read
    except OrchestratorError as error:
        print(f"orchestrator: {error}", file=sys.stderr)  # noqa: T201
    return 1


def check_limit(bays: int, buses: int) -> None:
    """Raise the limit as far as permitted; ServiceError if a station of this size needs more.

    A bay needs its port, its contactor, and one more file while one of them is being opened; the rest is shared.
    """
    needed, limit = SHARED + 3 * bays + 4 * buses, os.sysconf("SC_OPEN_MAX")
    if 0 <= limit < needed and 0 <= (limit := raised(limit)) < needed:
        raise ServiceError(
            f"at most {limit} files may be open at once, and this station needs {needed}: raise LimitNOFILE= of the "
            "unit, or ulimit -n"
        )


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2]))
