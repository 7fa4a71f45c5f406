"""The clock and wire interfaces that emulated parties need: an asyncio loop and a `CanWire` have them, or a test."""

from collections.abc import Callable
from typing import Protocol

Handler = Callable[[int, bytes], None]


class Timer(Protocol):
    """A scheduled call."""

    def cancel(self) -> None:
        """Cancel the call."""


class Timers(Protocol):
    """A clock that schedules calls."""

    def call_later(self, delay: float, callback: Callable[..., object], *args: object) -> Timer:
        """Call it after this many seconds."""

    def time(self) -> float:
        """Monotonic seconds."""


class Wire(Protocol):
    """A CAN bus: everybody else receives each frame, and on some wires its sender does too."""

    def subscribe(self, cob_id: int, owner: object, handler: Handler) -> None:
        """Receive the frames with this COB-ID."""

    def subscribe_remote(self, cob_id: int, owner: object, handler: Handler) -> None:
        """Receive the remote frames for this COB-ID."""

    def unsubscribe(self, cob_id: int, owner: object) -> None:
        """Stop receiving them."""

    def send(self, cob_id: int, data: bytes) -> None:
        """Put one frame on the bus."""

    def send_remote(self, cob_id: int) -> None:
        """Request the frame with this COB-ID by a remote frame."""
