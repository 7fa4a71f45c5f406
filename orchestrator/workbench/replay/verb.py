"""`orchestrator replay`: repeats a journal's decisions and prints the results, line by line."""

from collections.abc import Callable, Collection, Iterable
from pathlib import Path

from orchestrator.config.load import load_policy
from orchestrator.config.policy import Policy
from orchestrator.errors import OrchestratorError
from orchestrator.workbench.replay.again import Again, Repeater
from orchestrator.workbench.replay.otherwise import Comparison, told
from orchestrator.workbench.replay.recording import Recorded, Recording

#: At most this many deviations are shown per bay.
SHOWN = 20
Show = Callable[[str], None]


def replay(
    journals: Iterable[Path], policy: str | None, bays: Collection[str] = (), since: str = "", show: Show = print
) -> int:
    """Replay each bay, or those named; returns 1 if, without `policy`, a decision differs from the recording.

    `since`: only decisions from this time on (RFC 3339, UTC). Raises ConfigError if journals or policy cannot be read,
    OrchestratorError if nothing is recorded.
    """
    other = load_policy(policy) if policy else None
    recording, found = Recording(journals, bays, since), dict[str, _Bay]()
    for recorded in recording:
        if recorded.bay not in found:
            found[recorded.bay] = _Bay(recorded.bay, other, show)
        found[recorded.bay].take(recorded, counts=recorded.wall >= since)
    if recording.broken_count:
        show(f"{recording.broken_count} lines cannot be read and are passed over, the first: {recording.broken[0]}")
    chosen = [bay for name, bay in sorted(found.items()) if bay.count]
    missing = sorted(set(bays) - {bay.name for bay in chosen})
    if missing or not chosen:
        since_then = f" since {since}" if since else ""
        raise OrchestratorError(
            f"nothing is recorded of {', '.join(missing) or 'any bay'}{since_then} "
            f"(recorded: {', '.join(sorted(recording.names)) or 'none'}): "
            "snapshots need journal.snapshots in the station file"
        )
    return max(bay.report() for bay in chosen)


class _Bay:
    """One bay's decisions, repeated as they are read; with another policy, compared."""

    def __init__(self, name: str, other: Policy | None, show: Show) -> None:
        self.name, self._show = name, show
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
            self._show(f"{self.name}  {one.recorded.wall}  {one.wrong}")

    def report(self) -> int:
        """Print the result; returns the exit status."""
        if self._comparison is not None and self._other is not None:
            return self._report_differences(self._comparison, self._other.policy)
        if self._wrong > SHOWN:
            self._show(f"{self.name}  … and {self._wrong - SHOWN} more")
        verdict = f"{self._wrong} are NOT as recorded" if self._wrong else "all as recorded"
        self._show(f"{self.name}: {self.count} decisions in {self._span_s:.0f} s taken again: {verdict}")
        return 1 if self._wrong else 0

    def _report_differences(self, comparison: Comparison, policy: str) -> int:
        for difference in comparison.differences:
            self._show("\n".join((f"{self.name}  {next(lines := told(difference))}", *lines)))
        names = ", ".join(sorted(self._policies))
        self._show(
            f"{self.name}: {self.count} decisions, {len(comparison.differences)} differences ({names} → {policy})"
        )
        return 0
