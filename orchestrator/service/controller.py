"""The controller process, as the guardian starts it: `python -m orchestrator.service.controller FD STATION`.

Theory of operation. A charger may be running, so whatever it takes to stop it comes first: the station file, then the
ports. Everything else is imported while the ports stop their chargers; python-can and canopen, which take longest, by
the threads that need them (`link/can.py`).

A foreseen error ends it with a sentence; if it has touched no port, it tells the guardian that there is nothing to
stop. After any other error, be it in an import, the guardian stops the chargers: on the ports that it was given, and on
all that the station file names.
"""

import gc
import os
import sys

if __name__ == "__main__":
    gc.disable()  # until all is imported: none of it is garbage, and looking for some takes a tenth of that time
    from orchestrator.lastresort.unforeseen import say_unforeseen

    sys.excepthook = say_unforeseen  # even an import may fail

from orchestrator.config.load import load_station
from orchestrator.errors import CauseError, ConfigError, OrchestratorError, StartError
from orchestrator.lastresort.descriptors import raised
from orchestrator.model import Cause
from orchestrator.service.guarded import GuardianLink
from orchestrator.service.ports import ChargerPorts
from orchestrator.service.rivals import refuse_shared

#: Open files besides bays and buses: streams, sockets, journal, clients.
SHARED = 32


def main(fd: int, station: str) -> int:
    """Run the service for a station file; 0 if every charger was verified at the end."""
    language = "en"
    guardian = GuardianLink(fd)  # stays open to the very end: closing it signals the end of this process
    try:
        loaded = load_station(station)
        language = loaded.language.value
        check_limit(len(loaded.bays), len(loaded.can))
        refuse_shared(bay.charger.port for bay in loaded.bays)
        ports = ChargerPorts(loaded, guardian)
        ports.start()
        from orchestrator.service.supervisor import Supervisor  # noqa: PLC0415 - the ports must not wait for this

        gc.enable()
        return Supervisor(loaded, guardian, ports).run()
    except ConfigError as error:
        print(error, file=sys.stderr)  # noqa: T201 - what people read
    except CauseError as error:
        from orchestrator.text.catalogue import say  # noqa: PLC0415 - as above

        print(f"orchestrator: {say(error.cause, language)}", file=sys.stderr)  # noqa: T201
    except OrchestratorError as error:
        print(f"orchestrator: {error}", file=sys.stderr)  # noqa: T201
    if not guardian.holds:
        guardian.done()  # no charger was touched: one that runs may be another service's
    return 1


def check_limit(bays: int, buses: int) -> None:
    """Raise the limit as far as may be; StartError where a station of this size needs more.

    A bay needs its port, its contactor, and one more file while one of them is being opened; the rest is shared.
    """
    needed, limit = SHARED + 3 * bays + 4 * buses, os.sysconf("SC_OPEN_MAX")
    if 0 <= limit < needed and 0 <= (limit := raised(limit)) < needed:
        raise StartError(Cause.of("files_limited", limit=limit, needed=needed))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2]))
