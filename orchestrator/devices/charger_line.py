"""The interface of an open port, as used by the thread of a charger's port."""

from typing import Protocol

from orchestrator.model import Cause


class ChargerLine(Protocol):
    """An open port, such as `link.serial.SerialLine`. Every method except `close` may raise LinkError."""

    def write(self, data: bytes) -> None:
        """Hand over a frame."""

    def read(self, timeout_s: float, expected: int = 0) -> bytes:
        """Received bytes, once `expected` bytes have had their time on the wire; b"" after the time-out."""

    def restore(self) -> Cause | None:
        """Set the port up again if another program has changed it; what was found, None where all was well."""

    def locked_by(self) -> Cause | None:
        """Which program holds the port's lock instead of us, None where it is ours."""

    def close(self) -> None:
        """Release the port."""
