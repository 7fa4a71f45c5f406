"""The verbs of the running service: run it, show its status, and request start, pause, stop or reset of its bays.

Each imports its dependencies when it runs, so that none waits for another's libraries.
"""

import argparse
from pathlib import Path

from orchestrator.errors import UsageError

REQUESTS = {
    "start": "let a bay charge (again) after a stop, a pause or a reset",
    "pause": "stop charging until `start`; the session continues",
    "stop": "stop charging; only `start` lets the bay charge again",
    "reset": "clear latched faults whose cause is gone; `start` then lets the bay charge again",
}


#: How bays are named on a command line.
NAMES = "names, or patterns such as 'bay-0*'"


def add_service_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """`run`, `status`, `sessions` and the requests."""
    run = verbs.add_parser("run", help="run the service for a station until told to end")
    run.add_argument("station", nargs="?", help="the station file (default: station.yaml)")
    run.set_defaults(run=_run)
    status = verbs.add_parser("status", help="show what every bay is doing, and why")
    status.add_argument("bay", nargs="*", help=f"only these bays: {NAMES}")
    _add_except(status)
    status.add_argument("--problems", action="store_true", help="only bays that need a person")
    status.add_argument(
        "--check", action="store_true", help="exit status 1 if something needs a person, 2 if nobody can tell"
    )
    status.add_argument("--json", action="store_true", help="the status document, for programs")
    status.add_argument("--watch", action="store_true", help="refresh until interrupted")
    _add_socket(status)
    status.set_defaults(run=_status)
    _add_sessions(verbs)
    for verb, about in REQUESTS.items():
        request = verbs.add_parser(verb, help=about)
        request.add_argument("bay", nargs="*", help=f"the bays: {NAMES}")
        request.add_argument("--all", action="store_true", help="every bay of the station")
        _add_except(request)
        if verb == "reset":
            request.add_argument("--port", help="forget the charger on this port, which has no bay and is gone")
        _add_socket(request)
        request.set_defaults(run=_request, verb=verb)


def _add_sessions(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sessions = verbs.add_parser("sessions", help="list the charges on record: how much, how long, and why they ended")
    sessions.add_argument("show", nargs="*", help="'show ID': everything about one charge; the end of its id will do")
    sessions.add_argument("--bay", action="append", default=[], help="only of this bay: a name or a pattern")
    sessions.add_argument("--battery", metavar="ID", help="only of this battery")
    sessions.add_argument("--since", metavar="TIME", help="from then on: 2h, 7d (ago), 2026-11-28, 2026-11-28T06:00")
    sessions.add_argument("--limit", type=int, metavar="N", help="at most so many, the newest ones")
    form = sessions.add_mutually_exclusive_group()
    form.add_argument("--csv", action="store_true", help="for a spreadsheet")
    form.add_argument("--json", action="store_true", help="the records, for programs")
    sessions.add_argument(
        "--journal", metavar="DIR", help="the journal's directory (default: that of station.yaml here, else installed)"
    )
    sessions.set_defaults(run=_sessions)


def _add_except(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--except", dest="excepted", nargs="+", default=[], metavar="BAY", help="not these bays: names or patterns"
    )


def _add_socket(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--socket",
        help="the service's control socket (default: $ORCHESTRATOR_SOCKET, else that of station.yaml here, else of the "
        "installed service)",
    )


def _run(arguments: argparse.Namespace) -> int:
    from orchestrator.lastresort.guardian import guard

    if arguments.station is None and not Path("station.yaml").exists():
        raise UsageError(
            "run: there is no station.yaml in this directory: name the station file, orchestrator run FILE"
        )
    return guard([arguments.station or "station.yaml"])


def _status(arguments: argparse.Namespace) -> int:
    from orchestrator.service.status_verb import status

    return status(arguments)


def _sessions(arguments: argparse.Namespace) -> int:
    from orchestrator.service.sessions_verb import sessions

    return sessions(arguments)


def _request(arguments: argparse.Namespace) -> int:
    from orchestrator.service.request_verb import request

    return request(arguments)
