"""A CAN bus between two processes without a network: python-can's `serial` frames over a pseudo-terminal.

A network bus (`udp_multicast`) listens on all interfaces of the machine. This one is a file: the other end opens it by
name with `can.Bus(interface="serial", channel=NAME)`. One frame is AA, the time (4 bytes), the length, the id (4 bytes,
with SocketCAN's flags), the data, BB; little-endian (python-can's documentation, "CAN over Serial").
"""

import os
import struct
import tty
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import can

START, END = 0xAA, 0xBB
_HEAD = struct.Struct("<BIBI")  #: start, time, length, id
_EXTENDED, _REMOTE, _ERROR = 0x80000000, 0x40000000, 0x20000000
MAX_DATA = 8


class PtyBus(can.BusABC):
    """Our end of the bus; `channel` becomes a symbolic link to the other end."""

    def __init__(self, channel: str) -> None:
        self.channel_info = f"pty {channel}"
        self._heard = bytearray()
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)  # we keep it open too, so that the line stays up while nobody else has it open
        os.set_blocking(self._master, False)
        self._link = Path(channel)
        self._link.unlink(missing_ok=True)
        self._link.symlink_to(os.ttyname(self._slave))
        super().__init__(channel)

    def fileno(self) -> int:
        """The descriptor for an event loop."""
        return self._master

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002 - python-can's signature
        """Write one frame; without a reader it is lost, as on a bus without a listener."""
        flags = _EXTENDED * msg.is_extended_id | _REMOTE * msg.is_remote_frame | _ERROR * msg.is_error_frame
        frame = _HEAD.pack(START, 0, len(msg.data), msg.arbitration_id | flags) + bytes(msg.data) + bytes((END,))
        try:
            os.write(self._master, frame)
        except OSError as error:
            raise can.CanOperationError(f"{self.channel_info}: {error.strerror}") from None

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:  # noqa: ARG002 - as above
        """One of the received frames; skips anything that is not a frame. Never blocks."""
        with suppress(BlockingIOError):
            self._heard += os.read(self._master, 4096)
        while self._heard:
            size = self._size()
            if size is None:
                del self._heard[0]
            elif len(self._heard) < size:
                break
            else:
                frame = bytes(self._heard[:size])
                del self._heard[:size]
                return _message(frame), False
        return None, False

    def _size(self) -> int | None:
        """The size of the frame at the start of the buffer; None if there is none."""
        heard = self._heard
        if heard[0] != START:
            return None
        if len(heard) < _HEAD.size:
            return _HEAD.size
        size = _HEAD.size + heard[5] + 1
        whole = heard[5] <= MAX_DATA and (len(heard) < size or heard[size - 1] == END)
        return size if whole else None

    def shutdown(self) -> None:
        """Remove the bus and its name."""
        if not self._is_shutdown:
            super().shutdown()
            self._link.unlink(missing_ok=True)
            os.close(self._master)
            os.close(self._slave)


def open_bus(keys: Mapping[str, Any]) -> can.BusABC:
    """The bus for python-can's keys, plus one more interface: our `pty`."""
    settings = dict(keys)
    return can.Bus(**settings) if settings.get("interface") != "pty" else PtyBus(settings["channel"])


def _message(frame: bytes) -> can.Message:
    _, _, _, can_id = _HEAD.unpack_from(frame)
    return can.Message(
        arbitration_id=can_id & 0x1FFFFFFF,
        is_extended_id=bool(can_id & _EXTENDED),
        is_remote_frame=bool(can_id & _REMOTE),
        is_error_frame=bool(can_id & _ERROR),
        data=frame[_HEAD.size : -1],
    )
