"""`orchestrator replay`: repeats a journal's decisions and prints the results, line by line."""

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.config.load import load_policy
from orchestrator.config.policy import Policy
from orchestrator.errors import Finding, OrchestratorError
from orchestrator.service.journal_files import files_of
from orchestrator.workbench.processes import cores
from orchestrator.workbench.replay.again import Again, Repeater
from orchestrator.workbench.replay.otherwise import Comparison, told
from orchestrator.workbench.replay.recording import Recorded, Recording, bays_in

#: At most this many deviations are shown per bay.
SHOWN = 20
#: A journal of more bytes is long.
LONG = 500_000
Show = Callable[[str], None]


def replay(
    journals: Iterable[Path],
    policy: str | None,
    bays: Collection[str] = (),
    since: str = "",
    show: Show = print,
    *,
    until: str = "",
    jobs: int = 1,
) -> int:
    """Replay each bay, or those named; returns 1 if, without `policy`, a decision differs from the recording.

    `since`, `until`: only decisions between these times (RFC 3339, UTC). `jobs`: as many processes share the bays.
    Raises ConfigError if journals or policy cannot be read, OrchestratorError if nothing is recorded.
    """
    paths, other, span = tuple(journals), load_policy(policy) if policy else None, Span(since, until)
    recorded = bays_in(paths)
    chosen = sorted(set(bays) or recorded)
    shares = [share for number in range(jobs) if (share := chosen[number::jobs])]
    results = _all_shares(paths, other, shares, span)
    broken = sorted({finding for result in results for finding in result.broken})
    if broken:
        lines = "1 line cannot be read and is" if len(broken) == 1 else f"{len(broken)} lines cannot be read and are"
        show(f"{lines} passed over, the first: {broken[0]}")
    if broken and not recorded:
        raise OrchestratorError(
            "there is no journal in these files: name a journal's directory, or its snapshots.jsonl"
        )
    found = {outcome.bay: outcome for result in results for outcome in result.outcomes}
    missing = [name for name in chosen if name not in found]
    if (missing and bays) or not found:
        raise OrchestratorError(
            f"nothing is recorded of {', '.join(missing) or 'any bay'}{span} "
            f"(recorded: {', '.join(sorted(recorded)) or 'none'}): "
            "snapshots need journal.snapshots in the station file"
        )
    for _, outcome in sorted(found.items()):
        for line in outcome.lines:
            show(line)
    return max(outcome.status for outcome in found.values())


def processes_for(journals: Iterable[Path]) -> int:
    """One per core, unless the journal is replayed sooner than they have begun."""
    size = sum(path.stat().st_size for path in files_of(journals) if path.is_file())
    return len(os.sched_getaffinity(0)) if size > LONG else 1


@dataclass(frozen=True, slots=True)
class Span:
    """From when to when, RFC 3339 in UTC; "" for no bound."""

    since: str
    until: str

    def __str__(self) -> str:
        return "".join(f" {word} {time}" for word, time in (("since", self.since), ("until", self.until)) if time)


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result for one bay."""

    bay: str
    status: int
    lines: list[str]  #: for people


@dataclass(frozen=True, slots=True)
class Share:
    """The results for some bays, and the lines that could not be read meanwhile."""

    outcomes: list[Outcome]
    broken: list[Finding]


def _all_shares(paths: Sequence[Path], other: Policy | None, shares: list[list[str]], span: Span) -> list[Share]:
    """The first share is ours, the others are for other processes."""
    if len(shares) < 2:
        return [replay_share(paths, other, share, span) for share in shares or [[]]]
    with cores(len(shares) - 1) as pool:
        others = [pool.submit(replay_share, paths, other, share, span) for share in shares[1:]]
        return [replay_share(paths, other, shares[0], span), *(one.result() for one in others)]


def replay_share(paths: Sequence[Path], other: Policy | None, bays: Collection[str], span: Span) -> Share:
    """Replay these bays."""
    recording, found = Recording(paths, bays, span.since), dict[str, _Bay]()
    for recorded in recording:
        if span.until and recorded.wall > span.until:
            break
        if recorded.bay not in found:
            found[recorded.bay] = _Bay(recorded.bay, other)
        found[recorded.bay].take(recorded, counts=recorded.wall >= span.since)
    return Share([bay.outcome() for bay in found.values() if bay.count], recording.broken)


class _Bay:
    """One bay's decisions, repeated as they are read; with another policy, compared."""

    def __init__(self, name: str, other: Policy | None) -> None:
        self.name = name
        self._lines: list[str] = []
        self.count = 0  #: decisions repeated, of those asked for
        self._other, self._comparison = other, Comparison(other) if other is not None else None
        self._repeater = Repeater()
        self._policies: set[str] = set()
        self._wrong = 0
        self._span_s, self._last_s = 0.0, 0.0

    def take(self, recorded: Recorded, *, counts: bool) -> None:
        """Repeat this decision; one that does not count only leads up to those that do."""
        one = self._repeater.take(recorded)
        if not counts:
            return
        if self.count and not recorded.gap:
            self._span_s += max(recorded.at_s - self._last_s, 0.0)
        self.count, self._last_s = self.count + 1, recorded.at_s
        if self._comparison is not None:
            self._policies.add(one.rules.policy.policy)
            self._comparison.take(one)
        elif one.wrong:
            self._deviates(one)

    def _deviates(self, one: Again) -> None:
        self._wrong += 1
        if self._wrong <= SHOWN:
            self._lines.append(f"{self.name}  {one.recorded.wall}  {one.wrong}")

    def outcome(self) -> Outcome:
        """The result, with a summary."""
        if self._comparison is not None and self._other is not None:
            return Outcome(self.name, 0, list(self._differences(self._comparison, self._other.policy)))
        more = [f"{self.name}  … and {self._wrong - SHOWN} more"] if self._wrong > SHOWN else []
        verdict = f"{self._wrong} are NOT as recorded" if self._wrong else "all as recorded"
        summary = f"{self.name}: {self.count} decisions in {self._span_s:.0f} s taken again: {verdict}"
        return Outcome(self.name, 1 if self._wrong else 0, [*self._lines, *more, summary])

    def _differences(self, comparison: Comparison, policy: str) -> Iterator[str]:
        for difference in comparison.differences:
            yield "\n".join((f"{self.name}  {next(lines := told(difference))}", *lines))
        names = ", ".join(sorted(self._policies))
        count = len(comparison.differences)
        yield f"{self.name}: {self.count} decisions, {count} difference{'s' * (count != 1)} ({names} → {policy})"
