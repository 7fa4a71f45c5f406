"""Judges whether the frames with one node id look like those of a single healthy node."""

from orchestrator.devices.sdo_client import Verdict

BABBLE_HZ = 500  #: frames per second; a node that is read as fast as allowed sends a tenth of that
#: Second answers add to a sum, proper answers subtract: with a second node on the id every exchange has one too many,
#: and the sum climbs; a single frame repeated by the bus fades again.
_STRAY, _CLEAN, _DOUBLED, _MOST = 2, 1, 6, 8


#: Answers explained by another master.
NOT_OURS = (Verdict.THEIRS, Verdict.FRAGMENT, Verdict.UNCLEAR)


class NodeHealth:
    """Counts a node's irregularities."""

    __slots__ = ("_babbling", "_doubled", "_frames", "_last", "_reason", "_strays", "_window_s")

    def __init__(self) -> None:
        self._frames = 0
        self._window_s = 0.0
        self._babbling = False
        self._strays = 0
        self._doubled = False
        self._last: Verdict | None = None
        self._reason = ""

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

    def answer(self, verdict: Verdict, reason: str = "") -> None:
        """Count an SDO answer; `reason` says what is wrong with a malformed one."""
        if verdict in NOT_OURS:
            self.excuse()
            return
        self._last, self._reason = verdict, reason
        if verdict in (Verdict.STRAY, Verdict.SECOND):
            self._strays = min(_MOST, self._strays + _STRAY)
        elif verdict is Verdict.ACCEPTED:
            self._strays = max(0, self._strays - _CLEAN)
        self._doubled = self._strays >= _DOUBLED or (self._doubled and self._strays > 0)

    @property
    def problem(self) -> str:
        """Why its answers must not be relied on, although it answers; "" if all is well."""
        if self._doubled:
            return "requests are answered twice: two BMUs have this node id, or something else answers for this one"
        if self._babbling:
            return f"it sends more than {BABBLE_HZ} frames a second"
        return ""

    def silence(self, timeout_s: float) -> str:
        """The most likely reason that no answer was accepted for some time."""
        if self._last is Verdict.LATE:
            return f"its answers come later than {timeout_s:g} s (sdo_timeout_s)"
        if self._last is Verdict.MALFORMED:
            return f"its newest answer is not understood: {self._reason}"
        return "check its power, the cable, the bit rate and its node switch (node id = switch + 0x10)"
