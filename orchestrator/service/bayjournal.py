"""What the journal gets of one bay: its decisions, what they were made from, its contactor."""

from orchestrator.config.station import BayConfig
from orchestrator.core.memory import Memory
from orchestrator.model import Cause, Decision, Snapshot
from orchestrator.service.contactor import Contactor
from orchestrator.service.journal import Journal
from orchestrator.service.records import SnapshotRecorder, decision_lines
from orchestrator.service.status import contactor_fields
from orchestrator.service.wallclock import WallClock


class BayJournal:
    """Writes what is new. Used by the control loop's thread only."""

    def __init__(self, bay: BayConfig, journal: Journal, language: str, *, snapshots: bool) -> None:
        self._name, self._journal, self._language = bay.name, journal, language
        self._recorder = SnapshotRecorder(bay) if snapshots else None
        self._contactor: tuple[Cause | None, bool] | None = None  # problem, closed

    def begin(self, bay: BayConfig) -> None:
        """Another policy is in force from the next decision on."""
        if self._recorder is not None:
            self._recorder.begin(bay)

    def decided(
        self, clock: WallClock, before: Decision | None, decision: Decision, snapshot: Snapshot, memory: Memory
    ) -> None:
        """A decision, and the snapshot and the memory that it was made from."""
        new = before is None or decision != before
        lines = list(decision_lines(before, decision, self._language, clock)) if new else []
        for line in lines:
            self._journal.put(self._name, line, clock.now_s)
        if self._recorder is not None:
            timed = self._recorder.lines(clock.now_s, snapshot, memory, decision.state, news=bool(lines))
            for t_s, snapshot_line in timed:
                self._journal.put(self._name, snapshot_line, t_s)

    def contactor(self, contactor: Contactor) -> None:
        """What the contactor has been told, and why it may not have done it."""
        now = (contactor.problem, contactor.closed_s is not None)
        if now != self._contactor:
            self._contactor = now
            self._journal.put(self._name, ("contactor", contactor_fields(contactor, self._language)))

    def rest(self) -> None:
        """The snapshots that are still to be written, at the end of the service."""
        for t_s, line in self._recorder.rest() if self._recorder is not None else []:
            self._journal.put(self._name, line, t_s)
