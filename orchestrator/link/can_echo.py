"""Our own frames that an interface brings back: nobody else has sent them."""

from collections import deque
from collections.abc import Mapping
from typing import Protocol

#: So many may still be on their way back.
MAX_ECHO = 256
#: Interfaces that always bring back what we send ourselves, and do not mark it; others do where they are told to.
ECHOING = frozenset({"udp_multicast"})


class Message(Protocol):
    """What of `can.Message` is looked at here."""

    arbitration_id: int
    data: bytearray
    is_rx: bool


class CanEcho:
    """What was sent on a bus with these settings and has not come back yet."""

    __slots__ = ("_comes", "_sent")

    def __init__(self, settings: Mapping[str, object]) -> None:
        self._comes = settings.get("interface") in ECHOING or bool(settings.get("receive_own_messages"))
        self._sent: deque[tuple[int, bytes]] = deque(maxlen=MAX_ECHO)

    def sent(self, cob_id: int, data: bytes) -> None:
        """A frame has gone out."""
        if self._comes:
            self._sent.append((cob_id, data))

    def forget(self) -> None:
        """The bus was opened anew: nothing comes back any more."""
        self._sent.clear()

    def is_own(self, message: Message) -> bool:
        """Our own frame has come back. Echoes come in the order of sending: those before it are lost.

        A frame just like it by somebody else is told from it by their number only, unless the driver marks echoes.
        """
        if not message.is_rx:
            self._comes = False
            self._sent.clear()
            return True
        if not self._sent or (frame := (message.arbitration_id, bytes(message.data))) not in self._sent:
            return False
        while self._sent.popleft() != frame:
            pass
        return True
