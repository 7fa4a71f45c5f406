"""What the thread of a charger's port needs of the open port."""

from typing import Protocol


class ChargerLine(Protocol):
    """The open port, as `link.serial.SerialLine` is. Every method but `close` may raise LinkError."""

    def write(self, data: bytes) -> None:
        """Hand over a frame."""

    def read(self, timeout_s: float, expected: int = 0) -> bytes:
        """What came in, as soon as `expected` bytes had their time on the wire; b"" after the time-out."""

    def restore(self) -> str:
        """Set the port up again if another program has changed it; what was found, "" where all was well."""

    def locked_by(self) -> str:
        """Which program holds the port's lock instead of us, "" where it is ours."""

    def close(self) -> None:
        """Give the port back."""
