"""Judges whether the frames with one node id look like those of a single healthy node."""

from orchestrator.devices.sdo_client import Verdict
from orchestrator.model import Cause

BABBLE_HZ = 500  #: frames per second; a node that is read as fast as allowed sends a tenth of that
#: Second answers add to a sum, proper answers subtract: with a second node on the id every exchange has one too many,
#: and the sum climbs; a single frame repeated by the bus fades again.
_STRAY, _CLEAN, _DOUBLED, _MOST = 2, 1, 6, 8


#: Answers explained by another master.
NOT_OURS = (Verdict.THEIRS, Verdict.FRAGMENT, Verdict.UNCLEAR)


class NodeHealth:
    """Counts a node's irregularities."""

    __slots__ = ("_babbling", "_doubled", "_frames", "_last", "_strays", "_why", "_window_s")

    def __init__(self) -> None:
        self._frames = 0
        self._window_s = 0.0
        self._babbling = False
        self._strays = 0
        self._doubled = False
        self._last: Verdict | None = None
        self._why: Cause | None = None

    def frame(self, now_s: float) -> None:
        """A frame of any kind came."""
        self._frames += 1
        elapsed_s = now_s - self._window_s
        if elapsed_s >= 1.0:
            self._babbling = self._frames > BABBLE_HZ * elapsed_s
            self._frames, self._window_s = 0, now_s

    def excuse(self) -> None:
        """That frame was another master's, or an answer to one: those are not babble, however many there are."""
        self._frames -= 1

    def answer(self, verdict: Verdict, why: Cause | None = None) -> None:
        """An SDO answer came; `why` says what is wrong with a malformed one."""
        if verdict in NOT_OURS:
            self.excuse()
            return
        self._last, self._why = verdict, why
        if verdict in (Verdict.STRAY, Verdict.SECOND):
            self._strays = min(_MOST, self._strays + _STRAY)
        elif verdict is Verdict.ACCEPTED and self._strays:
            self._strays = max(0, self._strays - _CLEAN)
        self._doubled = self._strays >= _DOUBLED or (self._doubled and self._strays > 0)

    def problem(self, node_id: int, bus: str) -> Cause | None:
        """Why its answers must not be relied upon, although it answers; None if nothing is odd."""
        if self._doubled:
            return Cause.of("bmu_doubled", node_id=node_id, bus=bus)
        if self._babbling:
            return Cause.of("bmu_babbles", node_id=node_id, bus=bus, limit_hz=BABBLE_HZ)
        return None

    def silence(self, node_id: int, bus: str, timeout_s: float) -> Cause:
        """The most likely reason that no answer was accepted for some time."""
        if self._last is Verdict.LATE:
            return Cause.of("bmu_late", node_id=node_id, bus=bus, timeout_s=timeout_s)
        if self._last is Verdict.MALFORMED:
            return Cause.of("bmu_garbled", node_id=node_id, bus=bus, why=self._why)
        return Cause.of("bmu_unreachable", node_id=node_id, bus=bus)
