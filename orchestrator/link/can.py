"""A CAN bus by python-can and canopen: the only module that uses them.

Both are prescribed. python-can opens, configures, filters and closes every kind of adapter; it also sends and receives
single frames where an adapter has no socket (`link/can_socket.py`). canopen's `Network` dispatches frames by COB-ID and
sends NMT commands; SDO is ours (`devices/sdo_client.py`), because canopen would take a late answer for the answer to
the next request.

There is no Notifier, because the first exception kills it. One thread of ours calls `receive()` and `send()`. Whatever
the libraries raise becomes a LinkError; then the bus is closed and, after a pause, a new one is opened: a Network that
has seen its interface go down stays deaf.
"""

import logging
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any

from orchestrator.errors import LinkError, RefusedError
from orchestrator.link import can_driver, can_filter, can_text
from orchestrator.link.can_echo import CanEcho, marks
from orchestrator.link.can_frames import ERROR, ERROR_CLASS, OWN, Frame, Frames, Messages
from orchestrator.link.can_gate import refusal
from orchestrator.link.can_socket import socket_frames
from orchestrator.model import Cause
from orchestrator.protocol.sdo import NmtCommand

if TYPE_CHECKING:
    import can
    import canopen

FrameCallback = Callable[[int, bytes], None]

#: For a bus without a wire (`virtual`, `udp_multicast`) and without a bit rate in its settings: CANopen's highest.
DEFAULT_BITRATE = 1_000_000
#: After this many unreadable frames in a row, treat it as a failure and reopen the bus.
MAX_GARBAGE = 16


class CanBus:
    """One bus of the station file. It belongs to the thread that called `open()`.

    `settings` are passed to python-can unchanged; nothing comes from the environment or from python-can's own
    configuration files. `nodes` are the only node ids that may be written to (`link/can_gate.py`); `pages`: their older
    protocol may be used as well. `filtered`: the kernel drops frames without a subscriber.
    """

    def __init__(
        self,
        name: str,
        settings: Mapping[str, object],
        nodes: Collection[int],
        *,
        pages: bool = False,
        filtered: bool = True,
    ) -> None:
        self.name = name
        self.trouble: Cause | None = None  #: error-passive, bus-off, nobody acknowledges; None once a frame comes again
        self._settings = can_driver.protected(settings)
        self._nodes = frozenset(nodes)
        self._pages = pages
        self._filtered = filtered and "can_filters" not in settings
        self._echo = CanEcho(settings)
        self._callbacks: dict[int, FrameCallback] = {}
        self._garbage_run = 0
        self._bus: can.BusABC | None = None
        self._frames: Frames | None = None
        self._network: canopen.Network | None = None

    @property
    def bitrate(self) -> int:
        """The wire's bit/s, for the load budget; DEFAULT_BITRATE if the settings do not have it."""
        bitrate = self._settings.get("bitrate")
        return bitrate if isinstance(bitrate, int) else DEFAULT_BITRATE

    def subscribe(self, cob_id: int, callback: FrameCallback) -> None:
        """Call `callback(cob_id, data)` for each data frame with this id, now and after every reopening."""
        self._callbacks[cob_id] = callback

    def open(self) -> None:
        """Open the bus and wrap it in a canopen Network; LinkError if that fails. May take seconds (slcan)."""
        try:
            self._bus = _open_bus(self._settings)
            self._network = _new_network(self._bus, self.send)
            if self._filtered and self._callbacks and self._settings.get("interface") == "socketcan":
                self._bus.set_filters(can_filter.filters(self._callbacks))
            self._frames = socket_frames(self._bus, self._settings) or _messages(self._bus, self._settings)
        except Exception as error:
            self.close()
            raise self._failed(error) from error
        for cob_id, callback in self._callbacks.items():
            self._network.subscribe(cob_id, _without_time(callback))
        self._garbage_run = 0
        self._echo.forget()

    def close(self) -> None:
        """Shut the bus down. Never raises: there is no better way to close a broken bus."""
        bus, frames, self._bus, self._frames, self._network = self._bus, self._frames, None, None, None
        if frames is not None:
            frames.close()
        if bus is not None:
            can_driver.close(bus)

    def nmt(self, node_id: int, command: NmtCommand) -> None:
        """Ask a node to start, stop or reset; RefusedError for a node that is not of this station."""
        if self._network is None:
            raise self._closed()
        master = type(self._network.nmt)(node_id)  # the network's own one speaks to all nodes at once
        master.network = self._network
        master.send_command(command)

    def send(self, cob_id: int, data: bytes) -> None:
        """Write one frame; RefusedError if it must not be written, LinkError if the bus is broken.

        A full transmit queue means a missing BMU, not a broken bus: the frame is lost and `trouble` says so.
        """
        if reason := refusal(cob_id, data, self._nodes, pages=self._pages):
            raise RefusedError(f"CAN bus {self.name}: not sent: {reason}")
        if self._frames is None:
            raise self._closed()
        try:
            self._frames.send(cob_id, data)
            self._echo.sent(cob_id, data)
        except Exception as error:
            if not can_driver.is_queue_full(error):
                raise self._failed(error) from error
            self.trouble = can_text.QUEUE_FULL

    def receive(self, timeout_s: float, pause_s: float = 0.0) -> None:
        """Wait for a frame and dispatch all that have arrived. Exceptions from callbacks propagate.

        For the first `pause_s` nobody waits for a frame: what arrives in that time may be taken together.
        """
        frames, network = self._frames, self._network
        if frames is None or network is None:
            raise self._closed()
        try:
            taken = frames.take(max(timeout_s, 0.0), pause_s)
        except Exception as error:  # noqa: BLE001 - drivers raise anything; it ends here
            self._unreadable(error)
            return
        for one in taken:
            try:
                frame = frames.frame(one)
            except Exception as error:  # noqa: BLE001 - as above
                self._unreadable(error)
                continue
            self._garbage_run = 0
            self._dispatch(frame, network)

    def _dispatch(self, frame: Frame, network: "canopen.Network") -> None:
        can_id, data = frame
        if can_id & ERROR:
            self._error_frame(can_id & ERROR_CLASS, data)
            return
        self.trouble = None
        if can_id in self._callbacks:
            if not self._echo.is_own(frame):
                network.notify(can_id, data, 0.0)  # type: ignore[arg-type]  # data is only passed on
        elif can_id & OWN:
            self._echo.marked()

    def _error_frame(self, error_class: int, data: bytes) -> None:
        said = can_text.error_frame(error_class, data)
        if said is None:
            return
        self.trouble = can_text.trouble(said, self._settings) if said else None
        if self.trouble is not None and said == can_text.BUS_OFF:
            raise LinkError(self.trouble.with_(where=can_text.place(self.name, self._settings)))

    def _unreadable(self, error: Exception) -> None:
        """A single frame that the driver cannot read is noise; an errno, or many in a row, is a failure."""
        self._garbage_run += 1
        if can_text.errno_of(error) is not None or self._garbage_run >= MAX_GARBAGE:
            raise self._failed(error) from error
        flush = getattr(self._bus, "flush", None)
        if flush is not None:  # slcan keeps what it could not decode, and would fail on it again
            try:
                flush()
            except Exception as broken:
                raise self._failed(broken) from broken

    def _closed(self) -> LinkError:
        return LinkError(Cause.of("can_not_open", where=can_text.place(self.name, self._settings)))

    def _failed(self, error: Exception) -> LinkError:
        return LinkError(can_text.failure(self.name, self._settings, error))


# --- the libraries; imported late, by the thread of a bus: it takes 0.2 s, which nothing else must wait for -----------


def _open_bus(settings: Mapping[str, Any]) -> "can.BusABC":
    import can  # noqa: PLC0415 - see above

    # A LinkError reports once what they would log.
    logging.getLogger("can").setLevel(logging.CRITICAL)
    timing = settings.get("timing")
    if isinstance(timing, Mapping):
        kind = can.BitTimingFd if "nom_brp" in timing else can.BitTiming
        settings = {**settings, "timing": kind(**timing)}
    return can.Bus(ignore_config=True, **settings)


def _new_network(bus: "can.BusABC", send: FrameCallback) -> "canopen.Network":
    import canopen  # noqa: PLC0415 - see above

    logging.getLogger("canopen").setLevel(logging.CRITICAL)

    class Network(canopen.Network):
        """Sends everything that canopen sends by itself through our own `send`, and so through the gate."""

        def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:  # noqa: FBT001, FBT002 - its own
            if remote:
                raise RefusedError(f"remote frame 0x{can_id:X}: never sent")
            send(can_id, bytes(data))

        def notify(self, can_id: int, data: bytearray, timestamp: float) -> None:
            """As in canopen, without its search through all nodes."""
            for callback in self.subscribers.get(can_id, ()):
                callback(can_id, data, timestamp)

    network = Network(bus)
    # LSS is not used here, and canopen would keep every frame with its COB-ID for ever.
    network.unsubscribe(network.lss.LSS_RX_COBID)
    return network


def _messages(bus: "can.BusABC", settings: Mapping[str, object]) -> Messages:
    import can  # noqa: PLC0415 - see above

    def message(cob_id: int, data: bytes) -> can.Message:
        return can.Message(arbitration_id=cob_id, is_extended_id=False, data=data)

    return Messages(bus, message, marks=marks(settings))


def _without_time(callback: FrameCallback) -> Callable[[int, bytearray, float], None]:
    """Drop the frame's own time stamp, which is wall-clock time; the reader of the frame takes a monotonic one."""
    return lambda cob_id, data, _timestamp: callback(cob_id, bytes(data))
