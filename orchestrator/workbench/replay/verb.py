"""`orchestrator replay`: repeats a journal's decisions and prints the results, line by line."""

from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path

from orchestrator.config.load import load_policy
from orchestrator.config.policy import Policy
from orchestrator.errors import OrchestratorError
from orchestrator.workbench.replay.again import again
from orchestrator.workbench.replay.otherwise import compare, told
from orchestrator.workbench.replay.recording import Recorded, read

#: At most this many deviations are shown per bay.
SHOWN = 20
Show = Callable[[str], None]


def replay(journals: Iterable[Path], policy: str | None, bays: Iterable[str] = (), show: Show = print) -> int:
    """Replay each bay, or those named; returns 1 if, without `policy`, a decision differs from the recording.

    Raises ConfigError if journals or policy cannot be read, OrchestratorError if nothing is recorded.
    """
    other = load_policy(policy) if policy else None
    record = read(journals)
    recorded = record.bays
    if record.broken:
        lines = (
            "1 line cannot be read and is"
            if len(record.broken) == 1
            else f"{len(record.broken)} lines cannot be read and are"
        )
        show(f"{lines} passed over, the first: {record.broken[0]}")
    chosen = {name: recorded.get(name, []) for name in bays} or recorded
    if record.broken and not recorded:
        raise OrchestratorError(
            "there is no journal in these files: name a journal's directory, or its snapshots.jsonl"
        )
    missing = [name for name, steps in chosen.items() if not steps]
    if missing or not chosen:
        raise OrchestratorError(
            f"nothing is recorded of {', '.join(missing) or 'any bay'} "
            f"(recorded: {', '.join(recorded) or 'none'}): snapshots need journal.snapshots in the station file"
        )
    outcomes = [
        _otherwise(bay, steps, other, show) if other else _same(bay, steps, show) for bay, steps in chosen.items()
    ]
    return max(outcomes)


def _same(bay: str, steps: list[Recorded], show: Show) -> int:
    wrong = [one for one in again(steps) if one.wrong]
    for one in wrong[:SHOWN]:
        show(f"{bay}  {one.recorded.wall}  {one.wrong}")
    if len(wrong) > SHOWN:
        show(f"{bay}  … and {len(wrong) - SHOWN} more")
    span_s = sum(max(after.at_s - before.at_s, 0.0) for before, after in pairwise(steps) if not after.gap)
    verdict = f"{len(wrong)} are NOT as recorded" if wrong else "all as recorded"
    show(f"{bay}: {len(steps)} decisions in {span_s:.0f} s taken again: {verdict}")
    return 1 if wrong else 0


def _otherwise(bay: str, steps: list[Recorded], policy: Policy, show: Show) -> int:
    differences = compare(again(steps), policy)
    for difference in differences:
        show("\n".join((f"{bay}  {next(lines := told(difference))}", *lines)))
    names = {one.rules.policy.policy for one in steps if one.rules is not None}
    found = f"{len(differences)} difference{'s' * (len(differences) != 1)}"
    show(f"{bay}: {len(steps)} decisions, {found} ({', '.join(names)} → {policy.policy})")
    return 0
