"""The command line: `orchestrator VERB`. Exit status 0: success; 1: the answer is no; 2: no answer.

Nothing answers a usage error, and nobody answers where no service runs.

Each verb imports its dependencies when it runs, so that none waits for another's libraries.
"""

import argparse
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from orchestrator import __version__, output
from orchestrator.errors import (
    CauseError,
    ConfigError,
    HexError,
    NoServiceError,
    OrchestratorError,
    ServiceError,
    UsageError,
)
from orchestrator.northbound.verbs import add_northbound_verbs
from orchestrator.service.verbs import add_service_verbs
from orchestrator.shell.commands import with_examples
from orchestrator.shell.verbs import add_shell_verbs
from orchestrator.workbench.verbs import add_workbench_verbs, missing, prove_all, replay_charge

if TYPE_CHECKING:
    from orchestrator.config.station import Station


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit status."""
    words = sys.argv[1:] if argv is None else argv
    arguments = argparse.Namespace()
    try:
        with output.delivered():
            with output.gathered():
                arguments = _parser().parse_args(words)
            return int(arguments.run(arguments))
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 1
    except OrchestratorError as error:
        print(f"orchestrator: {_said(error, arguments, words)}", file=sys.stderr)
        return 2 if isinstance(error, UsageError | HexError | NoServiceError) else 1
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader of our output has gone, e.g. `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        print(f"orchestrator: {output.problem(error)}", file=sys.stderr)
        return 1


def _said(error: OrchestratorError, arguments: argparse.Namespace, words: Sequence[str]) -> str:
    """The message to print, in the reader's language if the error carries its cause as data."""
    from orchestrator.show import own_language
    from orchestrator.text.catalogue import say
    from orchestrator.text.document import said

    if isinstance(error, CauseError):
        return say(error.cause, own_language())
    if isinstance(error, NoServiceError):
        from orchestrator.service.unreachable import unreachable

        if cause := unreachable(error.told, getattr(arguments, "socket", None), words):
            return say(cause, own_language())
    return said(error.told, str(error), own_language()) if isinstance(error, ServiceError) else str(error)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="orchestrator",
        description="Supervises battery charging bays: reads BMUs over CANopen, drives chargers over RS-232/RS-485.",
    )
    parser.add_argument("--version", action="version", version=f"orchestrator {__version__}")
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB")
    add_service_verbs(verbs, replay_charge)
    _add_estop(verbs)
    add_northbound_verbs(verbs)
    _add_tool_verbs(verbs)
    add_shell_verbs(verbs, _parser)
    return with_examples(parser)


def _add_estop(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Only for help, manual and completion: `__main__` runs it before importing any of this."""
    estop = verbs.add_parser("estop", help="stop every charger now; needs no running service")
    estop.add_argument("station", nargs="?", help="the station file (default: the one that is found)")
    estop.add_argument("--port", nargs="+", metavar="PATH", help="these ports, without a station file or besides it")
    estop.add_argument("--socket", metavar="PATH", help="the service's control socket, if it is not the station file's")
    estop.add_argument("--leave-held", action="store_true", help="leave alone ports that a running service holds")


def _add_tool_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    check = verbs.add_parser(
        "check", help="report every error in policies, stations, object maps, scenarios and northbound files"
    )
    check.add_argument("file", nargs="+", help="files of any kind; a key in each identifies its kind")
    check.add_argument(
        "--exhaustive", action="store_true", help="also explore all that can happen under a policy: a minute for each"
    )
    check.add_argument("--jobs", type=int, metavar="N", help="processes for that (default: one per core)")
    check.set_defaults(run=_check)
    schema = verbs.add_parser("schema", help="print the JSON Schema of a kind of file, for editors, or of the status")
    schema.add_argument("kind", choices=SCHEMAS, help="the kind of file; status: what `status --json` prints")
    schema.set_defaults(run=_schema)
    decode = verbs.add_parser("decode", help="explain frames of the charger's protocol")
    decode.add_argument("hex", nargs="+", help="bytes in hexadecimal, e.g. AF FA 90 04 10 90 00 34 AF A0")
    decode.add_argument("--kinds", type=_kinds, metavar="K1,K2", help="the values in a reply, e.g. 03,04")
    decode.add_argument("--json", action="store_true", help="JSON output, for programs")
    decode.set_defaults(run=_decode)
    probe = verbs.add_parser("probe", help="query the devices of a station once and show everything they report")
    probe.add_argument("station", help="the station file")
    probe.add_argument("--bay", action="append", default=[], help="only this bay (may be repeated)")
    probe.add_argument("--nmt", choices=NMT, help="first send this NMT command to the bay's BMU")
    probe.add_argument("--old-protocol", action="store_true", help="also request the BMU's older, undocumented pages")
    probe.set_defaults(run=_probe)
    add_workbench_verbs(verbs)
    demo = verbs.add_parser("demo", help="charge an emulated battery over real wire bytes, in about a minute")
    demo.add_argument("--fault", metavar="NAME", help="inject a fault in mid-charge; 'list' shows the names")
    demo.add_argument("--plain", action="store_true", help="lines instead of a live picture")
    demo.add_argument("--page", action="store_true", help="show it in a browser, too, until Ctrl-C")
    demo.set_defaults(run=_demo)


SCHEMAS = ("policy", "station", "map", "scenario", "northbound", "status")
NMT = ("start", "stop", "reset-node", "reset-communication")


def _kinds(text: str) -> tuple[int, int]:
    """Two masks in hexadecimal, as in a status request."""
    try:
        first, second = bytes.fromhex(text.replace("0x", "").replace(",", " "))
    except ValueError:
        from orchestrator.protocol.charger import Kind1, Kind2

        one, two = (
            ", ".join(f"{kind.value:02X} {(kind.name or '').lower().replace('_', ' ')}" for kind in kinds)
            for kinds in (Kind1, Kind2)
        )
        raise argparse.ArgumentTypeError(
            f"{text!r}: write two bytes in hexadecimal, e.g. 03,04, each a sum of kinds; "
            f"the first of {one}; the second of {two}"
        ) from None
    return first, second


def _check(arguments: argparse.Namespace) -> int:
    from orchestrator.config.load import examine
    from orchestrator.show import own_language
    from orchestrator.text.checked import summary
    from orchestrator.workbench.prove.lint import LINT

    checked = examine(arguments.file, LINT)
    for finding in checked.findings:
        print(finding, file=sys.stderr)
    found = Counter(finding.severity for finding in checked.findings)
    for severity, line in () if found["error"] else _around(arguments.file):
        print(line, file=sys.stderr if severity else sys.stdout)
        found[severity] += 1
    looked_at = +Counter(checked.looked_at) or {"file": len(arguments.file)}
    print(summary(looked_at, found["error"], found["warning"], own_language()), flush=True)
    if found["error"]:
        return 1
    return prove_all(arguments.file, arguments.jobs) if arguments.exhaustive else 0


def _around(files: Sequence[str]) -> Iterator[tuple[str, str]]:
    """What else there is to say of the stations in files without errors: its severity, "" for a note, and the line."""
    from orchestrator.config.occupied import occupied
    from orchestrator.devices.bus_load import slow_buses
    from orchestrator.service.reach import reach

    for station in filter(None, map(_station, files)):
        for severity, lines in (("error", occupied(station)), ("warning", slow_buses(station)), ("", reach(station))):
            yield from ((severity, line) for line in lines)


def _station(file: str) -> "Station | None":
    """The station in a file; None if it is another kind of file."""
    from orchestrator.config.load import load_station

    try:
        return load_station(file)
    except ConfigError:
        return None


def _schema(arguments: argparse.Namespace) -> int:
    from orchestrator.columns import json_text
    from orchestrator.config.files import KINDS
    from orchestrator.config.json_schema import json_schema
    from orchestrator.model.document_schema import status_schema

    if arguments.kind == "status":
        print(json_text(status_schema(), indent=1))
        return 0
    kind = next(kind for kind in KINDS if kind.key == arguments.kind)
    print(json_text(json_schema(kind), indent=1))
    return 0


def _decode(arguments: argparse.Namespace) -> int:
    from orchestrator.columns import json_text
    from orchestrator.protocol.explain import explain

    explained = explain(" ".join(arguments.hex), arguments.kinds)
    if arguments.json:
        print(json_text([item.facts for item in explained]))
    else:
        print("\n\n".join(item.text for item in explained))
    return 0 if all(item.ok for item in explained) else 1


def _probe(arguments: argparse.Namespace) -> int:
    from orchestrator.commissioning.probe import probe
    from orchestrator.config.load import load_station

    station = load_station(arguments.station)
    return probe(station, arguments.bay, arguments.nmt, old_protocol=arguments.old_protocol)


def _demo(arguments: argparse.Namespace) -> int:
    from orchestrator.demo.run import demo

    try:
        return demo(arguments.fault, plain=arguments.plain, page=arguments.page)
    except ImportError as error:
        raise missing("the demo", error, "demo") from None
