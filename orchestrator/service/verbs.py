"""The verbs of the running service: run it, show its status and history, name a battery, request start, pause, stop …

Each imports its dependencies when it runs, so that none waits for another's libraries.
"""

import argparse
from pathlib import Path

from orchestrator.errors import UsageError
from orchestrator.service.record_verbs import Replay, add_record_verbs

REQUESTS = {
    "start": "let a bay charge (again) after a stop, a pause or a reset",
    "pause": "stop charging until `start`; the session continues",
    "stop": "stop charging; only `start` lets the bay charge again",
    "reset": "clear latched faults whose cause is gone; `start` then lets the bay charge again",
}


#: How bays are named on a command line.
NAMES = "names, or patterns such as 'bay-0*'"


def add_service_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", replay: Replay) -> None:
    """`run`, `status`, `history`, the record of charges, and the requests; `replay` decides a stretch of time again."""
    run = verbs.add_parser("run", help="run the service for a station until told to end")
    run.add_argument("station", nargs="?", help="the station file (default: station.yaml)")
    run.set_defaults(run=_run)
    status = verbs.add_parser("status", help="show what every bay is doing, and why")
    status.add_argument("bay", nargs="*", help=f"only these bays: {NAMES}")
    _add_except(status)
    status.add_argument("--group", action="store_true", help="the bays in groups by what they do: for many bays")
    status.add_argument("--problems", action="store_true", help="only bays that need a person")
    status.add_argument(
        "--check", action="store_true", help="exit status 1 if something needs a person, 2 if nobody can tell"
    )
    status.add_argument("--json", action="store_true", help="the status document, for programs")
    status.add_argument("--watch", action="store_true", help="refresh until interrupted")
    _add_socket(status)
    status.set_defaults(run=_status)
    _add_history(verbs)
    add_record_verbs(verbs, replay)
    for verb, about in REQUESTS.items():
        request = verbs.add_parser(verb, help=about)
        request.add_argument("bay", nargs="*", help=f"the bays: {NAMES}")
        request.add_argument("--all", action="store_true", help="every bay of the station")
        _add_except(request)
        _add_because(request)
        if verb == "start":
            _add_terms(request)
        if verb == "reset":
            request.add_argument("--port", help="forget the charger on this port, which has no bay and is gone")
        _add_socket(request)
        request.set_defaults(run=_request, verb=verb)
    _add_identify(verbs)
    _add_reload(verbs)


def percent(text: str) -> float:
    """A SOC as people write it, with its sign or without; ValueError if it is no number."""
    return float(text.removesuffix("%"))


def _add_terms(start: argparse.ArgumentParser) -> None:
    start.add_argument(
        "--to", type=percent, metavar="PCT", help="charge once to this SOC, whatever the policy's target says"
    )
    start.add_argument("--at", metavar="TIME", help="start then: 22:00 (today or tomorrow), or 2026-11-28T22:00")
    start.add_argument(
        "--force", action="store_true", help="with --all or patterns: also bays that another person has stopped"
    )


def _add_reload(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    reload = verbs.add_parser("reload", help="reread the policies; each bay adopts its own in standby")
    _add_because(reload)
    _add_socket(reload)
    reload.set_defaults(run=_reload)


def _add_history(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    history = verbs.add_parser("history", help="show what happened, newest last")
    history.add_argument("bay", nargs="*", help=f"only these bays: {NAMES}")
    history.add_argument(
        "--station", action="store_true", help="only the station itself: its begins, ends and failures"
    )
    history.add_argument("--since", metavar="TIME", help="from then on: 2h, 7d (ago), 2026-11-28, 2026-11-28T06:00")
    history.add_argument("--until", metavar="TIME", help="up to then")
    history.add_argument(
        "--limit", type=int, metavar="N", help="only the last N events; 0: all (default: 50, with --since all)"
    )
    history.add_argument("--json", action="store_true", help="a JSON object on each line, for programs")
    history.add_argument(
        "--journal", metavar="DIRECTORY", help="the journal (default: that of station.yaml here, else of the service)"
    )
    _add_socket(history)
    history.set_defaults(run=_history)


def _add_identify(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    identify = verbs.add_parser("identify", help="say which battery is in a bay whose BMU tells no serial number")
    identify.add_argument("bay", help="the bay's name")
    identify.add_argument("--battery", required=True, metavar="ID", help="what is written on it, e.g. B-0042")
    _add_socket(identify)
    identify.set_defaults(run=_identify)


def _add_except(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--except", dest="excepted", nargs="+", default=[], metavar="BAY", help="not these bays: names or patterns"
    )


def _add_because(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--because", default="", metavar="TEXT", help="the reason, for the journal and whoever asks why; one short line"
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


def _history(arguments: argparse.Namespace) -> int:
    from orchestrator.service.history_verb import history

    return history(arguments)


def _request(arguments: argparse.Namespace) -> int:
    from orchestrator.service.request_verb import request

    return request(arguments)


def _reload(arguments: argparse.Namespace) -> int:
    from orchestrator.service.reload_verb import reload

    return reload(arguments)


def _identify(arguments: argparse.Namespace) -> int:
    from orchestrator.service.identify_verb import identify

    return identify(arguments)
