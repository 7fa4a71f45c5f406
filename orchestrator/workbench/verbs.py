"""The verbs for tuning policies and for analysing recordings. None needs a service or a device.

Each imports its dependencies when it runs: plotting and the like are extras, which a gateway need not have.
"""

import argparse
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType

from orchestrator.errors import OrchestratorError, UsageError
from orchestrator.extras import install_extra
from orchestrator.service.timespan import moment

#: A computation that takes longer shows its progress, this often.
PROGRESS_S = 1.0
PICTURES = ("mermaid", "svg", "png")


def add_workbench_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """`simulate`, `replay` and `diagram`."""
    _add_simulate(verbs)
    replay = verbs.add_parser("replay", help="repeat recorded decisions, with the same policy or another")
    replay.add_argument("journal", nargs="+", type=Path, help="a journal's directory, or its files (may be gzipped)")
    replay.add_argument("--policy", metavar="FILE", help="show what this policy would have decided, and the effect")
    replay.add_argument("--bay", action="append", default=[], help="only this bay (may be repeated)")
    replay.add_argument("--since", metavar="TIME", help="from then on: 2h, 7d (ago), 2026-11-28, 2026-11-28T06:00")
    replay.add_argument("--jobs", type=int, metavar="N", help="processes (default: for a long journal one per core)")
    replay.set_defaults(run=_replay)
    diagram = verbs.add_parser("diagram", help="draw the state machine")
    diagram.add_argument("--policy", metavar="FILE", help="as used by this policy, with its thresholds")
    diagram.add_argument("--format", choices=PICTURES, default=PICTURES[0], help="default: %(default)s, which is text")
    diagram.add_argument("--out", type=Path, metavar="FILE", help="default: standard output")
    diagram.set_defaults(run=_diagram)


def _add_simulate(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    simulate = verbs.add_parser("simulate", help="try policies on a scenario: hours of charging in a moment")
    simulate.add_argument("policy", nargs="+", help="policies to compare: shipped names or files")
    simulate.add_argument("--scenario", required=True, help="what happens: a shipped name or a file")
    simulate.add_argument(
        "--sweep", action="append", default=[], metavar="KEY=A..B:N",
        help="try N values of a key in one policy; repeat the option for every combination",
    )  # fmt: skip
    simulate.add_argument("--jobs", type=int, metavar="N", help="processes for a sweep (default: one per core)")
    simulate.add_argument("--dask", metavar="ADDRESS", help="run a sweep on this Dask cluster instead")
    simulate.add_argument("--out", type=Path, metavar="DIR", help="write a page and a picture to this directory")
    simulate.set_defaults(run=_simulate)


def prove_all(files: Sequence[str], jobs: int | None) -> int:
    """`check --exhaustive` for each policy and each kind of bay in files without errors; 1 if a property is broken."""
    from orchestrator.core.rules import Rules
    from orchestrator.workbench.prove.exhaustive import bays_in, prove

    held = True
    for file in files:
        for names, bay in bays_in(file):
            begin_s, tell = time.monotonic(), progress(f"{names}: ")
            proof = prove(Rules.of(bay), tell, jobs)
            tell("")
            for found in proof.counterexamples:
                print(f"{names}: {found}\n", file=sys.stderr)
            came = f"{len(proof.counterexamples)} BROKEN" if proof.counterexamples else "all hold"
            print(
                f"{names}: {proof.properties} properties, {came}; {proof.memories} situations, "
                f"{proof.steps:,} decisions, {time.monotonic() - begin_s:.0f} s",
                flush=True,
            )
            held = held and not proof.counterexamples
    return 0 if held else 1


def _simulate(arguments: argparse.Namespace) -> int:
    from orchestrator.columns import own_width
    from orchestrator.workbench.simulate.verb import as_table, play

    if arguments.sweep:
        return _sweep(arguments)
    runs = play(arguments.policy, arguments.scenario, _share())
    print(as_table(runs, own_width()))
    if arguments.out is not None:
        print("", *_present().save(runs, arguments.out), sep="\n")
    return 0


def _sweep(arguments: argparse.Namespace) -> int:
    from orchestrator.columns import own_width
    from orchestrator.config.load import load_scenario
    from orchestrator.workbench.processes import cores
    from orchestrator.workbench.simulate.sweep import as_table, axis, cluster, played

    if len(arguments.policy) != 1:
        raise UsageError("--sweep: name one policy")
    axes, scenario = [axis(text) for text in arguments.sweep], load_scenario(arguments.scenario)
    with cluster(arguments.dask) if arguments.dask else cores(arguments.jobs) as pool:
        done = played(arguments.policy[0], scenario, axes, pool, _share())
    print(as_table(done, own_width()))
    if arguments.out is not None:
        print("", *_present().save_sweep(done, arguments.out), sep="\n")
    return 0 if any(point.figures for point in done.points) else 1


def _present() -> ModuleType:
    try:
        from orchestrator.workbench.draw import present
    except ImportError as error:
        raise missing("--out", error) from None
    return present


def _share() -> Callable[[str, float], None]:
    """Progress as a share of the whole."""
    tell = progress()
    return lambda what, share: tell(f"{what}: {share:.0%}" if share < 1 else "")


def progress(head: str = "") -> Callable[[str], None]:
    """One line on a terminal, rewritten as a computation goes on, once it takes longer than a second; "" erases it."""
    told_s = time.monotonic()

    def tell(text: str) -> None:
        nonlocal told_s
        if not sys.stderr.isatty() or (text and time.monotonic() - told_s < PROGRESS_S):
            return
        told_s = time.monotonic()
        room = shutil.get_terminal_size().columns - 1 - len(text)  # a line that wraps cannot be rewritten
        print(f"\r\x1b[K{head[:room] if text else ''}{text}", end="", file=sys.stderr, flush=True)

    return tell


def replay_charge(journal: Path, policy: str | None, bay: str, since: str, until: str) -> int:
    """`sessions replay`: what a journal has of one bay between these times."""
    try:
        from orchestrator.workbench.replay.verb import replay
    except ImportError as error:
        raise missing("replay", error) from None
    return replay([journal], policy, [bay], since, until=until)


def _replay(arguments: argparse.Namespace) -> int:
    try:
        from orchestrator.workbench.replay.verb import processes_for, replay
    except ImportError as error:
        raise missing("replay", error) from None
    since = moment("--since", arguments.since or "", time.time())
    jobs = arguments.jobs if arguments.jobs is not None else processes_for(arguments.journal)
    return replay(arguments.journal, arguments.policy, arguments.bay, since, jobs=jobs)


def _diagram(arguments: argparse.Namespace) -> int:
    from orchestrator.config.load import load_policy
    from orchestrator.workbench.draw.diagram import diagram, mermaid

    of = diagram(load_policy(arguments.policy) if arguments.policy else None)
    if arguments.format == "mermaid":
        _give(mermaid(of).encode(), arguments.out)
        return 0
    try:
        from orchestrator.workbench.draw.drawing import draw
    except ImportError as error:
        raise missing(arguments.format, error) from None
    if arguments.out is None and sys.stdout.isatty():
        raise UsageError("a picture is nothing for a terminal: name a file with --out")
    _give(draw(of, arguments.format), arguments.out)
    return 0


def _give(data: bytes, out: Path | None) -> None:
    """Write to a file, or to standard output."""
    if out is None:
        sys.stdout.buffer.write(data)
        sys.stdout.flush()
        return
    try:
        out.write_bytes(data)
    except OSError as error:
        raise OrchestratorError(f"{out}: {error.strerror}") from None


def missing(what: str, error: ImportError, extra: str = "workbench") -> OrchestratorError:
    """The error that says which extra to install for a verb."""
    return OrchestratorError(f"{what} needs the package {error.name}: {install_extra(extra)}")
