"""The verbs of the running service: run it, show its status, and request start, pause, stop or reset of its bays.

Each imports its dependencies when it runs, so that none waits for another's libraries.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import cast

from orchestrator.errors import NoServiceError, ServiceError, UsageError

REQUESTS = {
    "start": "let a bay charge (again) after a stop, a pause or a reset",
    "pause": "stop charging until `start`; the session continues",
    "stop": "stop charging; only `start` lets the bay charge again",
    "reset": "clear latched faults whose cause is gone; `start` then lets the bay charge again",
}


#: The requests that are complete only once the charger is verified in standby, and how long to wait for that: a
#: disobedient charger is uncontrollable after 3 s.
STOPS = ("stop", "pause")
STANDBY_S, LOOK_S = 4.0, 0.1
#: The refresh interval of `status --watch`.
WATCH_S = 1.0


def add_service_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """`run`, `status` and the requests."""
    run = verbs.add_parser("run", help="run the service for a station until told to end")
    run.add_argument("station", nargs="?", help="the station file (default: station.yaml)")
    run.set_defaults(run=_run)
    status = verbs.add_parser("status", help="show what every bay is doing, and why")
    status.add_argument("bay", nargs="?", help="only this bay")
    status.add_argument("--json", action="store_true", help="the status document, for programs")
    status.add_argument("--watch", action="store_true", help="refresh until interrupted")
    _add_socket(status)
    status.set_defaults(run=_status)
    for verb, about in REQUESTS.items():
        request = verbs.add_parser(verb, help=about)
        request.add_argument("bay", nargs="*", help="the bays")
        request.add_argument("--all", action="store_true", help="every bay of the station")
        if verb == "reset":
            request.add_argument("--port", help="forget the charger on this port, which has no bay and is gone")
        _add_socket(request)
        request.set_defaults(run=_request, verb=verb)


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
    from orchestrator.lastresort.asking import ask
    from orchestrator.service.where import find_socket

    path, seen, lost = find_socket(arguments.socket), False, ""
    while True:
        try:
            answer = ask(path, {"verb": "status", "bay": arguments.bay})
        except NoServiceError as error:
            if not (arguments.watch and seen):  # one that has never answered may be the wrong one
                raise
            if not lost:
                lost = str(error)
                print(f"orchestrator: still watching: {error}", file=sys.stderr, flush=True)
        else:
            answer.pop("ok")
            _show_status(answer, as_json=arguments.json, clear=arguments.watch and sys.stdout.isatty())
            if lost:
                print("orchestrator: the service answers again", file=sys.stderr, flush=True)
            seen, lost = True, ""
        if not arguments.watch:
            return 0
        time.sleep(WATCH_S)


def _show_status(document: dict[str, object], *, as_json: bool, clear: bool) -> None:
    from orchestrator.columns import own_width
    from orchestrator.show import own_language, page

    if as_json:
        print(json.dumps(document, ensure_ascii=False), flush=True)
        return
    text = page(document, own_language(), own_width())
    print(f"\x1b[H\x1b[2J{document['station']}\n{text}" if clear else text, flush=True)


def _request(arguments: argparse.Namespace) -> int:
    from orchestrator.lastresort.asking import ask
    from orchestrator.model import Cause
    from orchestrator.service.where import find_socket
    from orchestrator.show import own_language
    from orchestrator.text.catalogue import say
    from orchestrator.text.document import language_of_answer, refusals

    port = getattr(arguments, "port", None)
    given = bool(arguments.bay) + arguments.all + (port is not None)
    if given != 1:
        raise UsageError(
            f"{arguments.verb}: name bays, or --all{', or --port' if arguments.verb == 'reset' else ''}"
            f"{', not more than one of these' if given else ''}"
        )
    bays, path = None if arguments.all else arguments.bay, find_socket(arguments.socket)
    request = {"verb": arguments.verb, "bays": bays} | ({} if port is None else {"port": os.path.abspath(port)})  # noqa: PTH100 - not resolved
    try:
        answer = ask(path, request)
    except NoServiceError as error:
        without = "; to stop chargers without a service: orchestrator estop" if arguments.verb in STOPS else ""
        raise ServiceError(f"{error}{without}") from None
    language = language_of_answer(answer, own_language())
    results = refusals(answer, language)
    accepted = [bay for bay, refusal in results.items() if not refusal]
    unverified: dict[str, str] = {}
    if arguments.verb in STOPS:
        # A stop may be carried out and still be answered with a problem, e.g. not persisted: watch its charger as well.
        looked_at = list(results) if arguments.verb == "stop" else accepted
        unverified = _wait_for_standby(path, looked_at, language, every=arguments.all)
    refused = [Cause.of("bay_refused", bay=bay, why=refusal) for bay, refusal in results.items() if refusal]
    for line in (*unverified.values(), *(say(one, language) for one in refused)):
        print(line, file=sys.stderr, flush=True)  # what to do, before anything else
    for bay in accepted:
        verified = arguments.verb in STOPS and bay not in unverified
        done = Cause.of("accepted_verified" if verified else "accepted", bay=bay, verb=arguments.verb)
        print(say(done, language))
    return 1 if unverified or any(results.values()) else 0


def _wait_for_standby(path: Path, names: Sequence[str], language: str, *, every: bool) -> dict[str, str]:
    """Watch these bays until their chargers are in standby; returns what to do about each that is not in time.

    `every`: also watch chargers without a bay.
    """
    from orchestrator.lastresort.asking import ask
    from orchestrator.model import Cause
    from orchestrator.show import is_alarming, stands_by, strays, what_to_do
    from orchestrator.text.catalogue import say
    from orchestrator.text.document import in_language

    end_s = time.monotonic() + STANDBY_S
    while True:
        try:
            document = in_language(ask(path, {"verb": "status"}, max(end_s - time.monotonic(), LOOK_S)), language)
        except ServiceError as error:
            unseen = {name: Cause.of("not_seen_to_stop", bay=name, error=str(error)) for name in names}
            return {name: say(cause, language) for name, cause in unseen.items()}
        found = cast("list[dict[str, object]]", document["bays"])
        bays = [bay for bay in found if bay["name"] in names and not stands_by(bay)]
        others = strays(document, language) if every else []
        if time.monotonic() >= end_s or (all(map(is_alarming, bays)) and not others):
            return {str(bay["name"]): what_to_do(bay, language) for bay in bays} | {text: text for text in others}
        time.sleep(LOOK_S)
