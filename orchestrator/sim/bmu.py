"""An emulated BMU: `durand` handles CANopen, a pack model provides the values.

durand is a CANopen responder that shares nothing with the `canopen` library, so our client is not tested against its
own code. Two parts are implemented here. TPDOs: durand sends them on every change and has no event timer (sub 5), while
the BMU's manual has only the timer (§2.5). Resets: durand keeps all values, a real BMU forgets its settings.
"""

import asyncio
from collections.abc import Callable
from enum import Enum
from functools import partial

from durand import DatatypeEnum, Node, Record, Variable  # type: ignore[import-untyped]  # it has no annotations
from durand.node import NodeCapabilities  # type: ignore[import-untyped]  # as above
from durand.services.nmt import StateEnum  # type: ignore[import-untyped]  # as above

from orchestrator.sim.can_wire import CanWire, NodePort
from orchestrator.sim.main_loop import MainLoop
from orchestrator.sim.old_pages import REPLY_COB_ID, REQUEST_COB_ID, minutes, pages
from orchestrator.sim.pack import Readout

HEARTBEAT, TPDO_PARAMETERS, TPDO_COB_ID = 0x1017, 0x1800, 0x180
DEVICE_NAME, NAME = 0x1008, b"TABOS battery management unit"  #: longer than the 4 bytes of one answer
SERIAL = 0x1018, 4  #: of the identity object; 0 is none
EMERGENCY, GUARD = 0x080, 0x700
EVENT_TIMER = 5  #: sub-index of a TPDO's period in ms

#: The objects in each TPDO, whole and in order.
TPDOS = ((0x6000, 0x6001), (0x6002, 0x6003), (0x6004,))


class Layout(Enum):
    """The layout of the fields in the words 0x6001 … 0x6003; the document leaves it open."""

    FIRST_HIGH = "first-named field in the most significant bits, as the documented sample of 0x6000 has it"
    FIRST_LOW = "first-named field in the least significant bits"


def words(readout: Readout, layout: Layout) -> dict[int, int]:
    """The five objects as 32-bit words. Values that do not fit are truncated to the field's width, as in firmware."""
    volts, amps = round(readout.voltage_v * 100), round(readout.current_a * 100)
    to_full, to_empty = minutes(readout.time_to_full_min), minutes(readout.time_to_empty_min)
    soc, soh = round(readout.soc_pct), round(readout.soh_pct)
    hundredths_ah, tenths_wh = round(readout.remaining_ah * 100), round(readout.available_wh * 10)
    high = layout is Layout.FIRST_HIGH
    return {
        0x6000: _word([(volts, 16), (amps, 16)], first_high=True),  # the sample fixes this one
        0x6001: _word([(readout.status, 16), (to_full, 16)], first_high=high),
        0x6002: _word([(to_empty, 16), (soc, 8), (soh, 8)], first_high=high),
        0x6003: _word([(hundredths_ah, 16), (tenths_wh, 16)], first_high=high),
        0x6004: round(readout.temperature_c * 10) & 0xFFFF,
    }


def _word(fields: list[tuple[int, int]], *, first_high: bool) -> int:
    word = 0
    for value, width in fields if first_high else reversed(fields):
        word = word << width | value & (1 << width) - 1
    return word


class Bmu:
    """One BMU on a bus; it sends its boot-up frame on creation. Belongs to the loop's thread."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        wire: CanWire,
        node_id: int,
        readout: Callable[[], Readout],
        *,
        layout: Layout = Layout.FIRST_HIGH,
        main_loop: bool = False,
        serial: int = 0,
    ) -> None:
        self.port = NodePort(wire, loop, MainLoop(loop, seed=node_id) if main_loop else None)
        self.layout = layout
        self._loop = loop
        self._readout = readout
        self._timers: dict[int, asyncio.TimerHandle] = {}
        self._node = Node(self.port, node_id, capabilities=NodeCapabilities(sdo_servers=1, rpdos=1, tpdos=0))
        self._dictionary = self._node.object_dictionary
        self._dictionary.write(DEVICE_NAME, 0, NAME)
        self._dictionary.write(*SERIAL, serial)
        for index in (index for tpdo in TPDOS for index in tpdo):
            self._dictionary[index] = Variable(DatatypeEnum.UNSIGNED32, "ro")
            self._dictionary.set_read_callback(index, 0, partial(self._read, index))
        for number in range(len(TPDOS)):
            self._add_tpdo(number)
        self._node.nmt.state_callbacks.add(self._on_state)
        self.port.add_subscription(REQUEST_COB_ID + node_id, self._on_old_request)
        self._toggle = 0
        self.port.add_guard(GUARD + node_id, self._on_guard)

    @property
    def node_id(self) -> int:
        """Its CANopen node id."""
        return int(self._node.node_id)

    def reboot(self) -> None:
        """Boot up, with all settings forgotten."""
        self._node.nmt.reset()

    def emergency(self, code: int, register: int = 1) -> None:
        """Send an EMCY frame; code 0 is "error reset"."""
        self._node.emcy.set(code, register)

    def short_emergency(self, code: int) -> None:
        """Send an EMCY frame of two bytes, as some stacks do."""
        self.port.send(EMERGENCY + self.node_id, code.to_bytes(2, "little"))

    def close(self) -> None:
        """Fall silent permanently."""
        self._forget()
        self.port.faults.mute = True

    def _on_old_request(self, _: int, request: bytes) -> None:
        for page in pages(self.node_id, request, self._readout()):
            self.port.send(REPLY_COB_ID + self.node_id, page)

    def _on_guard(self, cob_id: int, _: bytes) -> None:
        """Node guarding (CiA 301, §7.2.8.3.2.1): the state, and a bit that alternates."""
        self.port.send(cob_id, bytes((self._toggle | int(self._node.nmt.state),)))
        self._toggle ^= 0x80

    # --- objects ---

    def _read(self, index: int) -> int:
        return words(self._readout(), self.layout)[index]

    def _on_state(self, state: int) -> None:
        if state == StateEnum.INITIALISATION:
            self._toggle = 0
            self._forget()

    def _forget(self) -> None:
        self._dictionary.write(HEARTBEAT, 0, 0)
        for number in range(len(TPDOS)):
            self._dictionary.write(TPDO_PARAMETERS + number, EVENT_TIMER, 0)

    # --- TPDOs ---

    def _add_tpdo(self, number: int) -> None:
        record = Record(name=f"TPDO {number + 1} communication parameter")
        cob_id = TPDO_COB_ID + 0x100 * number + self.node_id
        record[1] = Variable(DatatypeEnum.UNSIGNED32, "rw", cob_id)
        record[2] = Variable(DatatypeEnum.UNSIGNED8, "rw", 0xFF)
        record[EVENT_TIMER] = Variable(DatatypeEnum.UNSIGNED16, "rw", 0)
        self._dictionary[TPDO_PARAMETERS + number] = record
        self._dictionary.update_callbacks[TPDO_PARAMETERS + number, EVENT_TIMER].add(partial(self._set_timer, number))

    def _set_timer(self, number: int, period_ms: int) -> None:
        timer = self._timers.pop(number, None)
        if timer is not None:
            timer.cancel()
        if period_ms:
            self._timers[number] = self._loop.call_later(period_ms / 1000, self._send_tpdo, number, period_ms)

    def _send_tpdo(self, number: int, period_ms: int) -> None:
        self._set_timer(number, period_ms)
        if self._node.nmt.state == StateEnum.OPERATIONAL:
            all_words = words(self._readout(), self.layout)
            data = b"".join(all_words[index].to_bytes(4, "little") for index in TPDOS[number])
            self.port.send(TPDO_COB_ID + 0x100 * number + self.node_id, data)
