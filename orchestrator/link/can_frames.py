"""CAN frames as an interface delivers them, and the two ways to exchange them: python-can's, or directly on a socket.

python-can serves every interface (`Messages`). If an interface has a socket whose frame format we know,
`link/can_socket.py` sends and receives in a third of the CPU time.
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from orchestrator.protocol.sdo import FRAME_BYTES

#: Id and data. The id of a data frame with a standard id is its COB-ID; any other frame has one of the bits below.
Frame = tuple[int, bytes]

EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000  # as linux/can.h has them
FOREIGN = 0x1_0000_0000  #: CAN FD, or longer than a CANopen frame
OWN = 0x2_0000_0000  #: the driver marks it as sent by us
ERROR_CLASS = 0x1FFF_FFFF

#: Longer than any driver needs to take one frame; a stalled line must not stall the thread.
SEND_TIMEOUT_S = 0.02


class Frames(Protocol):
    """One way to exchange frames on an open bus. Exceptions propagate unchanged."""

    def send(self, cob_id: int, data: bytes) -> None:
        """Write one frame."""

    def take(self, timeout_s: float, pause_s: float) -> Sequence[Any]:
        """What has arrived, in the interface's own format; nothing, if nothing arrives in time.

        It may take `pause_s`, so that frames that arrive close together are taken together.
        """

    def frame(self, taken: Any) -> Frame:  # noqa: ANN401 - each way has its own type
        """Decode one taken item; raises if it is unreadable."""

    def close(self) -> None:
        """Close what does not belong to the driver."""


class Message(Protocol):
    """The attributes of python-can's `Message` used here."""

    arbitration_id: int
    data: bytearray
    dlc: int
    is_error_frame: bool
    is_extended_id: bool
    is_fd: bool
    is_remote_frame: bool
    is_rx: bool


class Driver(Protocol):
    """A bus opened by python-can."""

    def send(self, msg: Any, timeout: float) -> None:  # noqa: ANN401 - python-can's own `Message`
        """May raise anything."""

    def recv(self, timeout: float) -> Message | None:
        """May raise anything."""


class Messages:
    """The way through python-can, one frame at a time."""

    def __init__(self, driver: Driver, message: Callable[[int, bytes], Any], *, marks: bool) -> None:
        self._driver, self._message, self._marks = driver, message, marks

    def send(self, cob_id: int, data: bytes) -> None:
        """Waits briefly if the driver has no room."""
        self._driver.send(self._message(cob_id, data), SEND_TIMEOUT_S)

    def take(self, timeout_s: float, _pause_s: float) -> Sequence[Message]:
        """At most one: only some drivers can tell cheaply whether there are more."""
        message = self._driver.recv(timeout_s)
        return () if message is None else (message,)

    def frame(self, taken: Message) -> Frame:
        """Decode a message, with its kind in the id."""
        can_id = taken.arbitration_id
        if taken.is_error_frame:
            return ERROR | can_id, bytes(taken.data)
        if taken.is_extended_id or taken.is_remote_frame or taken.is_fd or taken.dlc > FRAME_BYTES:
            return FOREIGN | can_id, b""
        return OWN | can_id if self._marks and not taken.is_rx else can_id, bytes(taken.data)

    def close(self) -> None:
        """Everything here belongs to the driver."""
