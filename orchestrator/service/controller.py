"""The controller process, as the guardian starts it: `python -m orchestrator.service.controller FD STATION`."""

import sys

from orchestrator.config.load import load_station
from orchestrator.errors import ConfigError, OrchestratorError
from orchestrator.service.guarded import GuardianLink
from orchestrator.service.supervisor import Supervisor


def main(fd: int, station: str) -> int:
    """Run the service for a station file; 0 if every charger was verified at the end."""
    guardian = GuardianLink(fd)  # stays open to the last word: its end is the sign that this process has ended
    try:
        return Supervisor(load_station(station), guardian).run()
    except ConfigError as error:
        print(error, file=sys.stderr)  # noqa: T201 - what people read
    except OrchestratorError as error:
        print(f"orchestrator: {error}", file=sys.stderr)  # noqa: T201
    return 1


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2]))
