"""Recognises our own frames that an interface echoes back."""

from collections import deque
from collections.abc import Mapping

from orchestrator.link.can_frames import Frame

#: At most this many may still be on their way back.
MAX_ECHO = 256
#: Interfaces that always echo our own frames, unmarked; others do so on request.
ECHOING = frozenset({"udp_multicast"})


def marks(settings: Mapping[str, object]) -> bool:
    """Whether a frame that the driver marks as sent is ours. SocketCAN marks what any program on this machine sends."""
    return settings.get("interface") != "socketcan"


class CanEcho:
    """The frames sent on a bus with these settings that have not come back yet."""

    __slots__ = ("_comes", "_sent")

    def __init__(self, settings: Mapping[str, object]) -> None:
        self._comes = settings.get("interface") in ECHOING or bool(settings.get("receive_own_messages"))
        self._sent: deque[Frame] = deque(maxlen=MAX_ECHO)

    def sent(self, cob_id: int, data: bytes) -> None:
        """Record a frame that has gone out."""
        if self._comes:
            self._sent.append((cob_id, data))

    def forget(self) -> None:
        """The bus was reopened: nothing comes back any more."""
        self._sent.clear()

    def marked(self) -> None:
        """The driver itself marks our frames: nothing to remember."""
        self._comes = False
        self._sent.clear()

    def is_own(self, frame: Frame) -> bool:
        """Whether this is our own frame. Echoes arrive in the order of sending: those before it are lost.

        Only their number distinguishes echoes from identical frames by somebody else.
        """
        if not self._sent or frame not in self._sent:
            return False
        while self._sent.popleft() != frame:
            pass
        return True
