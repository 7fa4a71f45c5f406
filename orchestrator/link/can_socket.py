"""Exchanges frames directly on the socket that python-can opened: one system call per frame.

There is no `Message`, no `select` before each frame, no time stamp and no interface name. All that has arrived is
taken at once, so that answers close together cost one wake-up.
"""

import os
import select
import struct
import time
from collections.abc import Callable, Mapping
from socket import MSG_DONTWAIT, socket
from typing import Any, Protocol

from orchestrator.link.can_frames import ERROR, ERROR_CLASS, EXTENDED, FOREIGN, REMOTE, Frame
from orchestrator.protocol.sdo import FRAME_BYTES

LARGEST = 4096  #: more than any datagram that is a frame
MOST = 128  #: taken at once; then due requests go out before any more is taken
KNOWN = 1024  #: five objects of each of 128 nodes, and some more
MULTICAST_PORT = 43113  #: python-can's default


class Codec(Protocol):
    """How an interface encodes frames in datagrams."""

    def packed(self, cob_id: int, data: bytes) -> bytes:
        """Encode a frame of ours."""

    def unpacked(self, datagram: bytes) -> Frame:
        """Decode any frame; raises if it is not one."""


class SocketCan:
    """`struct can_frame` of linux/can.h: id, length, two bytes of padding, the DLC, data."""

    _FRAME = struct.Struct("=IB2xB8s")

    def packed(self, cob_id: int, data: bytes) -> bytes:
        """Encode a standard frame: we send no others."""
        return self._FRAME.pack(cob_id, len(data), 0, data)

    def unpacked(self, datagram: bytes) -> Frame:
        """Decode a frame; a CAN FD frame has another size. The id includes the kernel's flag bits."""
        if len(datagram) != self._FRAME.size:
            return FOREIGN, b""
        can_id, length, dlc, data = self._FRAME.unpack(datagram)
        return (FOREIGN, b"") if dlc > FRAME_BYTES or length > FRAME_BYTES else (can_id, data[:length])


class Multicast:
    """python-can's `udp_multicast`: the attributes of a `Message` as a msgpack map."""

    _KINDS: Mapping[str, int] = {
        "is_extended_id": EXTENDED, "is_remote_frame": REMOTE, "is_error_frame": ERROR, "is_fd": FOREIGN,
    }  # fmt: skip

    def __init__(self) -> None:
        import msgpack  # noqa: PLC0415 - needed and installed for this interface only

        self._pack, self._unpack = msgpack.packb, msgpack.unpackb
        self._ours: dict[Frame, bytes] = {}  # the same requests repeat, and all of them are echoed
        self._echoes: dict[bytes, Frame] = {}
        self._message = {  # python-can's peers require all of these
            "timestamp": 0.0, "arbitration_id": 0, "is_extended_id": False, "is_remote_frame": False,
            "is_error_frame": False, "channel": None, "dlc": 0, "data": b"", "is_fd": False,
            "bitrate_switch": False, "error_state_indicator": False,
        }  # fmt: skip

    def packed(self, cob_id: int, data: bytes) -> bytes:
        """Encode a standard frame: we send no others."""
        packed = self._ours.get((cob_id, data))
        if packed is None:
            packed = self._pack(self._message | {"arbitration_id": cob_id, "dlc": len(data), "data": data})
            if len(self._ours) >= KNOWN:
                self._ours, self._echoes = {}, {}
            self._ours[cob_id, data], self._echoes[packed] = packed, (cob_id, data)
        return packed

    def unpacked(self, datagram: bytes) -> Frame:
        """Decode a datagram; anybody in the group may send anything."""
        if echo := self._echoes.get(datagram):
            return echo
        message = self._unpack(datagram)
        can_id, data = message["arbitration_id"], message["data"]
        if not isinstance(can_id, int) or not isinstance(data, bytes) or not 0 <= can_id <= ERROR_CLASS:
            raise ValueError("not a CAN frame")
        for kind, bit in self._KINDS.items():
            if message[kind]:
                can_id |= bit
        return (FOREIGN, b"") if len(data) > FRAME_BYTES else (can_id, data)


CODECS: Mapping[object, Callable[[], Codec]] = {"socketcan": SocketCan, "udp_multicast": Multicast}


class SocketFrames:
    """Exchanges frames on a socket; raises OSError."""

    def __init__(self, fd: int, codec: Codec, to: tuple[str, int] | None = None) -> None:
        self._socket, self._to = socket(fileno=fd), to
        self._packed, self.frame = codec.packed, codec.unpacked
        self._poll = select.poll()
        self._poll.register(fd, select.POLLIN)

    def send(self, cob_id: int, data: bytes) -> None:
        """Never waits: BlockingIOError if there is no room."""
        if self._to is None:
            self._socket.send(self._packed(cob_id, data), MSG_DONTWAIT)
        else:
            self._socket.sendto(self._packed(cob_id, data), MSG_DONTWAIT, self._to)

    def take(self, timeout_s: float, pause_s: float) -> list[bytes]:
        """Sleep for `pause_s` and take all that has arrived; if nothing has, wait for the rest of `timeout_s`."""
        if pause_s > 0:
            time.sleep(min(pause_s, timeout_s))
        taken = self._all()
        if not taken and timeout_s > pause_s and self._poll.poll(1000 * (timeout_s - pause_s)):
            taken = self._all()
        return taken

    def _all(self) -> list[bytes]:
        taken: list[bytes] = []
        try:
            while len(taken) < MOST:
                taken.append(self._socket.recv(LARGEST, MSG_DONTWAIT))
        except BlockingIOError:
            pass
        return taken

    def close(self) -> None:
        """Close our descriptor; the driver closes its own."""
        self._socket.close()


class Driver(Protocol):
    """A bus opened by python-can."""

    def fileno(self) -> int:
        """NotImplementedError if it has none."""


def socket_frames(driver: Driver, settings: Mapping[str, Any]) -> SocketFrames | None:
    """A second descriptor for the driver's socket; None if it has none, or one whose frame format we do not know.

    Where python-can itself must filter, or choose among interfaces, it keeps doing that.
    """
    interface, channel = settings.get("interface"), settings.get("channel")
    multicast = interface == "udp_multicast"
    if interface not in CODECS or not channel or (multicast and not {"can_filters", "fd"}.isdisjoint(settings)):
        return None
    try:
        fd = os.dup(driver.fileno())
    except NotImplementedError:
        return None
    to = (str(channel), int(settings.get("port", MULTICAST_PORT))) if multicast else None
    return SocketFrames(fd, CODECS[interface](), to)
