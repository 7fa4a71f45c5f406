"""What emulated parties need of a clock and of a wire: an asyncio loop and a `CanWire` have it, and a test's own."""

from collections.abc import Callable
from typing import Protocol

Handler = Callable[[int, bytes], None]


class Timer(Protocol):
    """A call that was asked for."""

    def cancel(self) -> None:
        """It is not made any more."""


class Timers(Protocol):
    """A clock that calls."""

    def call_later(self, delay: float, callback: Callable[..., object], *args: object) -> Timer:
        """Call it after so many seconds."""

    def time(self) -> float:
        """Monotonic seconds."""


class Wire(Protocol):
    """A CAN bus: who sends is heard by everybody else, and on some wires by himself as well."""

    def subscribe(self, cob_id: int, owner: object, handler: Handler) -> None:
        """Have the frames with this COB-ID."""

    def subscribe_remote(self, cob_id: int, owner: object, handler: Handler) -> None:
        """Have the remote frames that ask for this COB-ID."""

    def unsubscribe(self, cob_id: int, owner: object) -> None:
        """No more of them."""

    def send(self, cob_id: int, data: bytes) -> None:
        """Put one frame on the bus."""

    def send_remote(self, cob_id: int) -> None:
        """Ask for the frame with this COB-ID."""
