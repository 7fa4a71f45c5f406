"""A python-can bus served by an asyncio loop, and one node's access to it, with the node's faults."""

import asyncio
import threading
from dataclasses import dataclass, field
from functools import partial

import can

from orchestrator.sim.can_noise import Bus, BusNoise
from orchestrator.sim.main_loop import MainLoop
from orchestrator.sim.timers import Handler, Timers, Wire

#: The length of every SDO frame.
SDO_BYTES = 8
#: How often the thread of a bus without a file descriptor checks whether to end.
LOOK_S = 0.02
PERFECT = Bus()
#: How long to wait before reading a failed bus again.
DOWN_S = 0.2


class CanWire:
    """Delivers the frames of one bus to the subscribers of their COB-ID. Belongs to the loop's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, bus: can.BusABC, kind: Bus = PERFECT) -> None:
        self.frames = 0  #: received, including our own echo if the bus returns it
        self._loop = loop
        self._noise = BusNoise(kind)
        self._bus = bus
        self._subscribers: dict[int, dict[object, Handler]] = {}
        self._remote: dict[int, dict[object, Handler]] = {}
        self._closing = False
        self._thread: threading.Thread | None = None
        try:
            self._fd = bus.fileno()
        except NotImplementedError:
            self._fd = -1
        if self._fd >= 0:
            loop.add_reader(self._fd, self._on_readable)
        else:
            self._thread = threading.Thread(target=self._listen, name="emulated bus", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Stop serving; the bus itself still belongs to its creator."""
        self._closing = True
        if self._thread is not None:
            self._thread.join()
        elif self._fd >= 0:
            self._loop.remove_reader(self._fd)

    def subscribe(self, cob_id: int, owner: object, handler: Handler) -> None:
        """Receive frames with this COB-ID. Several owners may share one: NMT and SYNC are for all."""
        self._subscribers.setdefault(cob_id, {})[owner] = handler

    def unsubscribe(self, cob_id: int, owner: object) -> None:
        """Stop delivering frames with this COB-ID to this owner."""
        self._subscribers.get(cob_id, {}).pop(owner, None)

    def subscribe_remote(self, cob_id: int, owner: object, handler: Handler) -> None:
        """Receive the remote frames for this COB-ID."""
        self._remote.setdefault(cob_id, {})[owner] = handler

    def send_remote(self, cob_id: int) -> None:
        """Request the frame with this COB-ID by a remote frame."""
        self._put(can.Message(arbitration_id=cob_id, is_remote_frame=True, is_extended_id=False))

    def send(self, cob_id: int, data: bytes) -> None:
        """Put one frame on the bus; if the bus refuses it, it is lost, as for a node without a listener."""
        self._put(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def _put(self, whole: can.Message) -> None:
        message = self._noise.spoil(whole)
        if message is None:
            return
        try:
            self._bus.send(message)
        except can.CanError:
            return

    def _on_readable(self) -> None:
        try:
            while (message := self._bus.recv(0)) is not None:
                self._deliver(message)
        except can.CanError:  # down, or garbage on it: try again later instead of spinning
            self._loop.remove_reader(self._fd)
            self._loop.call_later(DOWN_S, self._resume)

    def _resume(self) -> None:
        if not self._closing:
            self._loop.add_reader(self._fd, self._on_readable)

    def _listen(self) -> None:
        while not self._closing:
            try:
                message = self._bus.recv(LOOK_S)
            except can.CanError:
                message = None
            if message is not None:
                self._loop.call_soon_threadsafe(self._deliver, message)

    def _deliver(self, heard: can.Message) -> None:
        self.frames += 1
        message = self._noise.spoil(heard)
        if message is None or message.is_extended_id or message.is_error_frame:
            return
        handlers = (self._remote if message.is_remote_frame else self._subscribers).get(message.arbitration_id)
        if handlers:
            for handler in tuple(handlers.values()):
                handler(message.arbitration_id, bytes(message.data))


@dataclass(slots=True)
class NodeFaults:
    """Faults in a node's answers."""

    mute: bool = False  #: neither receives nor sends anything
    delay_s: float = 0.0  #: delay of SDO answers
    aborts: dict[int, int] = field(default_factory=dict)  #: object index → abort code, for reads
    short: set[int] = field(default_factory=set)  #: object indexes whose reads declare 2 bytes instead of 4


class NodePort:
    """What durand calls a network, for one node: sends, subscribes, and applies the node's faults."""

    def __init__(self, wire: Wire, timers: Timers, main_loop: MainLoop | None = None) -> None:
        self.faults = NodeFaults()
        self.reads = 0  #: SDO requests received
        self._wire = wire
        self._timers = timers
        self._main_loop = main_loop

    def add_subscription(self, cob_id: int, callback: Handler) -> None:
        """Called by durand."""

        def hear(cob_id: int, data: bytes) -> None:
            if self.faults.mute:
                return
            if cob_id & 0x780 == 0x600:
                if len(data) != SDO_BYTES:  # CANopenNode ignores other lengths; durand would answer with an abort
                    return
                self.reads += 1
            if self._main_loop is None:
                self._handle(callback, cob_id, data)
            else:
                self._main_loop.take(partial(self._handle, callback), cob_id, data)

        self._wire.subscribe(cob_id, self, hear)

    def add_guard(self, cob_id: int, callback: Handler) -> None:
        """Receive the remote frames for this COB-ID."""
        self._wire.subscribe_remote(cob_id, self, lambda cob_id, data: self._handle(callback, cob_id, data))

    def _handle(self, callback: Handler, cob_id: int, data: bytes) -> None:
        if self.faults.mute or (cob_id & 0x780 == 0x600 and self._refuse(cob_id, data)):
            return
        callback(cob_id, data)

    def remove_subscription(self, cob_id: int) -> None:
        """Called by durand."""
        self._wire.unsubscribe(cob_id, self)

    def send(self, cob_id: int, msg: bytes) -> None:
        """Called by durand."""
        faults = self.faults
        if faults.mute:
            return
        if cob_id & 0x780 != 0x580:
            self._wire.send(cob_id, msg)
            return
        if faults.short and msg[0] == 0x43 and int.from_bytes(msg[1:3], "little") in faults.short:
            msg = b"\x4b" + msg[1:6] + b"\0\0"
        if faults.delay_s:
            self._timers.call_later(faults.delay_s, self._wire.send, cob_id, msg)
        else:
            self._wire.send(cob_id, msg)

    def _refuse(self, cob_id: int, data: bytes) -> bool:
        index = int.from_bytes(data[1:3], "little")
        if data[:1] != b"\x40" or index not in self.faults.aborts:
            return False
        self.send(cob_id - 0x80, b"\x80" + data[1:4] + self.faults.aborts[index].to_bytes(4, "little"))
        return True
