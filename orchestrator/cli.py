"""The command line: `orchestrator VERB`. Exit status 0: well; 1: the answer is no; 2: used wrongly.

Each verb imports what it needs when it runs, so that none waits for another's libraries.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

from orchestrator import __version__
from orchestrator.errors import ConfigError, HexError, NoServiceError, OrchestratorError, ServiceError, UsageError
from orchestrator.workbench.verbs import add_workbench_verbs, missing, prove_all

if TYPE_CHECKING:
    from orchestrator.config.station import Station


REQUESTS = {
    "start": "let a bay charge (again): after a stop, a pause or a reset",
    "pause": "stop charging until `start`; the session goes on",
    "stop": "stop charging; only `start` begins again",
    "reset": "clear latched faults whose cause is gone; `start` then begins again",
}


#: Those that are done only when the charger was seen to stand by, and how long that is waited for: a charger that does
#: not obey is uncontrollable after 3 s.
STOPS = ("stop", "pause")
STANDBY_S, LOOK_S = 4.0, 0.1
#: `status --watch` looks this often.
WATCH_S = 1.0


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit status."""
    arguments = _parser().parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 1
    except OrchestratorError as error:
        print(f"orchestrator: {error}", file=sys.stderr)
        return 2 if isinstance(error, UsageError | HexError) else 1
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:  # a full disk behind our output, as a rule
        print(f"orchestrator: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="orchestrator",
        description="Supervises battery charging bays: reads BMUs over CANopen, drives chargers over RS-232/RS-485.",
    )
    parser.add_argument("--version", action="version", version=f"orchestrator {__version__}")
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB")
    _add_service_verbs(verbs)
    _add_estop(verbs)
    _add_tool_verbs(verbs)
    return parser


def _add_service_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    run = verbs.add_parser("run", help="run the service for a station, until it is told to end")
    run.add_argument("station", nargs="?", default="station.yaml", help="the station file (default: %(default)s)")
    run.set_defaults(run=_run)
    status = verbs.add_parser("status", help="what every bay does, and why")
    status.add_argument("bay", nargs="?", help="only this bay")
    status.add_argument("--json", action="store_true", help="the status document, for programs")
    status.add_argument("--watch", action="store_true", help="again and again, until interrupted")
    _add_socket(status)
    status.set_defaults(run=_status)
    for verb, about in REQUESTS.items():
        request = verbs.add_parser(verb, help=about)
        request.add_argument("bay", nargs="*", help="the bays")
        request.add_argument("--all", action="store_true", help="every bay of the station")
        if verb == "reset":
            request.add_argument("--port", help="forget the charger on this port, which no bay has and which is gone")
        _add_socket(request)
        request.set_defaults(run=_request, verb=verb)


def _add_estop(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """For the list of verbs only: `__main__` runs it before any of this is imported."""
    verbs.add_parser("estop", help="stop every charger now; needs no running service", add_help=False)


def _add_tool_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    check = verbs.add_parser("check", help="every error of policies, stations and object maps, with its line")
    check.add_argument("file", nargs="+", help="files; what each is, it says itself")
    check.add_argument(
        "--exhaustive", action="store_true", help="explore all that can happen under a policy, too: a minute for each"
    )
    check.add_argument("--jobs", type=int, metavar="N", help="processes for that (default: one for each core)")
    check.set_defaults(run=_check)
    schema = verbs.add_parser("schema", help="JSON Schema of a kind of file, so that an editor completes and checks")
    schema.add_argument("kind", choices=SCHEMAS, help="which kind")
    schema.set_defaults(run=_schema)
    decode = verbs.add_parser("decode", help="explain frames of the charger's protocol")
    decode.add_argument("hex", nargs="+", help="bytes in hexadecimal, e.g. AF FA 90 04 10 90 00 34 AF A0")
    decode.add_argument("--kinds", type=_kinds, metavar="K1,K2", help="which values a reply holds, e.g. 03,04")
    decode.add_argument("--json", action="store_true", help="for programs")
    decode.set_defaults(run=_decode)
    probe = verbs.add_parser("probe", help="ask the devices of a station once and show everything they say")
    probe.add_argument("station", help="the station file")
    probe.add_argument("--bay", action="append", default=[], help="only this bay (may be repeated)")
    probe.add_argument("--nmt", choices=NMT, help="first send this NMT command to the bay's BMU")
    probe.add_argument(
        "--old-protocol", action="store_true", help="ask for the BMU's older, undocumented pages as well"
    )
    probe.set_defaults(run=_probe)
    add_workbench_verbs(verbs)
    demo = verbs.add_parser("demo", help="charge an emulated battery over real wire bytes, in about a minute")
    demo.add_argument("--fault", metavar="NAME", help="inject a fault in mid-charge; 'list' shows the names")
    demo.add_argument("--plain", action="store_true", help="lines instead of a live picture")
    demo.set_defaults(run=_demo)


SCHEMAS = ("policy", "station", "map", "scenario")
NMT = ("start", "stop", "reset-node", "reset-communication")


def _add_socket(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--socket",
        help="the service's control socket (default: $ORCHESTRATOR_SOCKET, else that of station.yaml here, else of the "
        "installed service)",
    )


def _kinds(text: str) -> tuple[int, int]:
    """Two masks in hexadecimal, as a status request has them; argparse makes a message of a ValueError."""
    first, second = bytes.fromhex(text.replace("0x", "").replace(",", " "))
    return first, second


def _run(arguments: argparse.Namespace) -> int:
    from orchestrator.lastresort.guardian import guard

    return guard([arguments.station])


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
    from orchestrator.show import own_language, own_width, page

    if as_json:
        print(json.dumps(document, ensure_ascii=False), flush=True)
        return
    text = page(document, own_language(), own_width())
    print(f"\x1b[H\x1b[2J{document['station']}\n{text}" if clear else text, flush=True)


def _request(arguments: argparse.Namespace) -> int:
    from orchestrator.lastresort.asking import ask
    from orchestrator.service.where import find_socket
    from orchestrator.show import own_language
    from orchestrator.text.document import refusals

    port = getattr(arguments, "port", None)
    if bool(arguments.bay) + arguments.all + (port is not None) != 1:
        raise UsageError(f"{arguments.verb}: name bays, or --all{', or --port' if arguments.verb == 'reset' else ''}")
    bays, path = None if arguments.all else arguments.bay, find_socket(arguments.socket)
    request = {"verb": arguments.verb, "bays": bays} | ({} if port is None else {"port": os.path.abspath(port)})  # noqa: PTH100 - not resolved
    try:
        results = refusals(ask(path, request), own_language())
    except NoServiceError as error:
        without = "; to stop chargers without a service: orchestrator estop" if arguments.verb in STOPS else ""
        raise ServiceError(f"{error}{without}") from None
    accepted = [bay for bay, refusal in results.items() if not refusal]
    unverified, then = {}, ""
    if arguments.verb in STOPS:
        # A stop that is done can be answered with a complaint, that it is not kept, say: its charger is looked at, too.
        looked_at = list(results) if arguments.verb == "stop" else accepted
        unverified, then = _wait_for_standby(path, looked_at, every=arguments.all), "; stands by, verified"
    for line in (*unverified.values(), *(f"{bay}: {refusal}" for bay, refusal in results.items() if refusal)):
        print(line, file=sys.stderr, flush=True)  # what is to be done, before anything else
    for bay in accepted:
        print(f"{bay}: {arguments.verb} accepted{'' if bay in unverified else then}")
    return 1 if unverified or any(results.values()) else 0


def _wait_for_standby(path: Path, names: Sequence[str], *, every: bool) -> dict[str, str]:
    """Look at these bays until their chargers stand by; what to do about each that was not seen to in time.

    `every`: and at chargers that are no bay's any more.
    """
    from orchestrator.lastresort.asking import ask
    from orchestrator.show import is_alarming, own_language, stands_by, strays, what_to_do
    from orchestrator.text.document import in_language

    end_s, language = time.monotonic() + STANDBY_S, own_language()
    while True:
        try:
            document = in_language(ask(path, {"verb": "status"}, max(end_s - time.monotonic(), LOOK_S)), language)
        except ServiceError as error:
            return {name: f"{name}: NOT verified, run `orchestrator estop`: {error}" for name in names}
        found = cast("list[dict[str, object]]", document["bays"])
        bays = [bay for bay in found if bay["name"] in names and not stands_by(bay)]
        others = strays(document, language) if every else []
        if time.monotonic() >= end_s or (all(map(is_alarming, bays)) and not others):
            return {str(bay["name"]): what_to_do(bay, language) for bay in bays} | {text: text for text in others}
        time.sleep(LOOK_S)


def _check(arguments: argparse.Namespace) -> int:
    from orchestrator.config.load import check
    from orchestrator.devices.bus_load import slow_buses
    from orchestrator.workbench.prove.lint import LINT

    findings = check(arguments.file, LINT)
    for finding in findings:
        print(finding, file=sys.stderr)
    if any(finding.severity == "error" for finding in findings):
        return 1
    for station in filter(None, map(_station, arguments.file)):
        for warning in slow_buses(station):
            print(warning, file=sys.stderr)
    return prove_all(arguments.file, arguments.jobs) if arguments.exhaustive else 0


def _station(file: str) -> "Station | None":
    """The station in a file; None where it is a policy or an object map."""
    from orchestrator.config.load import load_station

    try:
        return load_station(file)
    except ConfigError:
        return None


def _schema(arguments: argparse.Namespace) -> int:
    from orchestrator.config.files import KINDS
    from orchestrator.config.json_schema import json_schema

    kind = next(kind for kind in KINDS if kind.key == arguments.kind)
    print(json.dumps(json_schema(kind), ensure_ascii=False, indent=1))
    return 0


def _decode(arguments: argparse.Namespace) -> int:
    from orchestrator.protocol.explain import explain

    explained = explain(" ".join(arguments.hex), arguments.kinds)
    if arguments.json:
        print(json.dumps([item.facts for item in explained], ensure_ascii=False))
    else:
        print("\n\n".join(item.text for item in explained))
    return 0 if all(item.ok for item in explained) else 1


def _probe(arguments: argparse.Namespace) -> int:
    from orchestrator.commissioning.probe import probe
    from orchestrator.config.load import load_station

    station = load_station(arguments.station)
    return probe(station, arguments.bay, arguments.nmt, old_protocol=arguments.old_protocol)


def _demo(arguments: argparse.Namespace) -> int:
    try:
        from orchestrator.demo.run import demo
    except ImportError as error:
        raise missing("the demo", error, "demo") from None
    return demo(arguments.fault, plain=arguments.plain)
