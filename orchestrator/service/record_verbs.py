"""The verbs of the record of charges: list and show them, the life of a battery, a month.

Each imports its dependencies when it runs, so that none waits for another's libraries.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

#: Journal, other policy, bay, from when, to when → exit status.
Replay = Callable[[Path, str | None, str, str, str], int]


def add_record_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", replay: Replay) -> None:
    """`sessions`, `battery` and `report`."""
    _add_sessions(verbs, replay)
    _add_battery(verbs)
    _add_report(verbs)


def _add_sessions(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", replay: Replay) -> None:
    sessions = verbs.add_parser("sessions", help="list the charges on record: how much, how long, and why they ended")
    sessions.add_argument(
        "words", nargs="*", metavar="show ID|replay ID|rebuild",
        help="'show ID': everything about one charge; the end of its id will do. 'replay ID': decide it again from the "
        "journal. 'rebuild': build the index anew",
    )  # fmt: skip
    sessions.add_argument("--html", type=Path, metavar="FILE", help="of 'show': write a web page that needs no network")
    sessions.add_argument("--policy", metavar="FILE", help="of 'replay': show what this policy would have decided")
    sessions.add_argument("--bay", action="append", default=[], help="only of this bay: a name or a pattern")
    sessions.add_argument("--battery", metavar="ID", help="only of this battery")
    sessions.add_argument("--since", metavar="TIME", help="from then on: 2h, 7d (ago), 2026-11-28, 2026-11-28T06:00")
    sessions.add_argument(
        "--limit", type=int, metavar="N", help="the newest N; 0: all (default: 50 in the table, with --since all)"
    )
    form = sessions.add_mutually_exclusive_group()
    form.add_argument("--csv", action="store_true", help="for a spreadsheet")
    form.add_argument("--json", action="store_true", help="the records, for programs")
    _add_journal(sessions)
    sessions.set_defaults(run=_sessions, replay=replay)


def _add_battery(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    battery = verbs.add_parser("battery", help="list the batteries that were charged, or show the life of one")
    battery.add_argument("battery", nargs="?", metavar="ID", help="the life of this one")
    battery.add_argument("--limit", type=int, metavar="N", help="its newest N charges; 0: all (default: 50)")
    battery.add_argument("--json", action="store_true", help="for programs")
    _add_journal(battery)
    battery.set_defaults(run=_battery)


def _add_report(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    report = verbs.add_parser("report", help="sum up a month: energy, charges, why they ended, batteries to look at")
    report.add_argument("--month", metavar="YYYY-MM", help="which (default: that of the newest charge)")
    form = report.add_mutually_exclusive_group()
    form.add_argument("--html", type=Path, metavar="FILE", help="write a web page that needs no network")
    form.add_argument("--json", action="store_true", help="for programs")
    _add_journal(report)
    report.set_defaults(run=_report)


def _add_journal(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--journal", metavar="DIR", help="the journal's directory (default: that of station.yaml here, else installed)"
    )


def _sessions(arguments: argparse.Namespace) -> int:
    from orchestrator.service.sessions_verb import sessions

    return sessions(arguments)


def _battery(arguments: argparse.Namespace) -> int:
    from orchestrator.service.battery_verb import battery

    return battery(arguments)


def _report(arguments: argparse.Namespace) -> int:
    from orchestrator.service.report_verb import report_month

    return report_month(arguments)
