"""The part of `orchestrator probe` that queries a BMU: its identity, and every object, decoded by each object map.

The BMU's document does not specify the layout of values in its objects. So the installer sees the raw words and how
each map decodes them, beside the pages of the BMU's older protocol if it supports that.
"""

from collections.abc import Callable, Mapping
from time import monotonic

from orchestrator.commissioning.compare_maps import comparison, decode
from orchestrator.config.files import MAP
from orchestrator.config.load import load_map
from orchestrator.config.shipped import shipped_names
from orchestrator.config.station import BatteryConfig
from orchestrator.link.can import CanBus
from orchestrator.model import Measurement
from orchestrator.protocol.hextext import hex_of
from orchestrator.protocol.pages import pages_request, pages_request_cob_id, parse_page
from orchestrator.protocol.sdo import (
    NMT_COB_ID,
    NmtCommand,
    NmtState,
    SdoAbort,
    SdoMalformed,
    SdoReply,
    SdoValue,
    heartbeat_cob_id,
    parse_reply,
    read_request,
    reply_cob_id,
    request_cob_id,
)
from orchestrator.protocol.words import Decoded
from orchestrator.text.catalogue import say

Key = tuple[int, int]

#: The first object is requested this often before the BMU counts as silent.
TRIES = 3
#: How long to wait for a boot after a reset, for the pages, and at most for a heartbeat.
BOOT_S, PAGES_S, HEARTBEAT_S = 5.0, 0.3, 3.0

#: Its identity (CiA 301), if the BMU provides it, and its heartbeat setting.
HEARTBEAT_PERIOD: Key = (0x1017, 0)
IDENTITY: Mapping[Key, str] = {
    (0x1000, 0): "device type",
    (0x1018, 1): "vendor",
    (0x1018, 2): "product",
    (0x1018, 3): "revision",
    (0x1018, 4): "serial number",
    HEARTBEAT_PERIOD: "heartbeat period, ms (0: off)",
}


class BmuProbe:
    """One BMU on a bus that is not open yet. `run` shows its findings line by line."""

    def __init__(self, bus: CanBus, config: BatteryConfig, show: Callable[[str], None]) -> None:
        self._bus, self._config, self._show = bus, config, show
        self._node_id = config.node_id
        self.volts: float | None = None  #: the pack's, by the bay's own map
        self._frames: list[tuple[int, bytes]] = []
        self._maps = {name: load_map(name) for name in shipped_names(MAP.folder)}
        if config.map not in self._maps.values():
            self._maps[f"{config.map.map} (yours)"] = config.map
        for cob_id in range(0x800):  # every standard COB-ID: the pages may arrive on any of them
            bus.subscribe(cob_id, lambda cob_id, data: self._frames.append((cob_id, data)))

    def run(self, nmt: NmtCommand | None, *, old_protocol: bool) -> bool:
        """Query everything; False if the BMU does not answer. LinkError if the bus fails."""
        if nmt is not None:
            self._command(nmt)
        keys = dict.fromkeys((entry.index, entry.sub) for each in self._maps.values() for entry in each.objects)
        first, *others = keys
        replies: dict[Key, SdoReply | None] = {first: self._read(first, TRIES)}
        place = f"BMU 0x{self._node_id:02X} on {self._bus.name}"
        if replies[first] is None:
            self._show(f"{place}: no answer: {self._why_silent()}")
            return False
        self._show(f"{place}: answers")
        self._introduce()
        replies |= {key: self._read(key) for key in others}
        for key, reply in replies.items():
            self._show(f"  0x{key[0]:04X}:{key[1]:02X}  {_said(reply)}")
        pages = self._pages() if old_protocol else {}
        words = {key: (reply.value, reply.size) for key, reply in replies.items() if isinstance(reply, SdoValue)}
        volts = decode(self._config.map, words).get("voltage_v")
        self.volts = volts.value if isinstance(volts, Measurement) else None
        for line in comparison(self._maps, self._config.map, words, pages):
            self._show(f"  {line}")
        return None not in replies.values()

    # --- questions ---

    def _listen(self, seconds: float, cob_id: int, wanted: Callable[[bytes], bool]) -> bytes | None:
        """The next wanted frame on this COB-ID; None if none arrives in time."""
        seen, end_s = len(self._frames), monotonic() + seconds
        while True:
            for heard, data in self._frames[seen:]:
                if heard == cob_id and wanted(data):
                    return data
            seen, left_s = len(self._frames), end_s - monotonic()
            if left_s <= 0:
                return None
            self._bus.receive(left_s)

    def _read(self, key: Key, tries: int = 1) -> SdoReply | None:
        """The answer to a read of this object; None if there is none."""

        def wanted(data: bytes) -> bool:
            reply = parse_reply(data)
            return not isinstance(reply, SdoMalformed) and (reply.index, reply.sub) == key

        for _ in range(tries):
            self._bus.send(request_cob_id(self._node_id), read_request(*key))
            answer = self._listen(self._config.sdo_timeout_s, reply_cob_id(self._node_id), wanted)
            if answer is not None:
                return parse_reply(answer)
        return None

    def _command(self, nmt: NmtCommand) -> None:
        self._bus.nmt(self._node_id, nmt)
        resets = nmt in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)
        boot = self._listen(BOOT_S if resets else PAGES_S, heartbeat_cob_id(self._node_id), lambda data: data == b"\0")
        said = "it booted" if boot else f"no boot-up frame within {BOOT_S:g} s" if resets else "sent"
        self._show(f"NMT {nmt.name.lower().replace('_', ' ')} to node 0x{self._node_id:02X}: {said}")

    def _introduce(self) -> None:
        for key, name in IDENTITY.items():
            reply = self._read(key)
            self._show(f"  {name}: {_said(reply)}")
            if key == HEARTBEAT_PERIOD and isinstance(reply, SdoValue) and reply.value:
                period_s = min(1.5 * reply.value / 1000, HEARTBEAT_S)
                self._listen(period_s, heartbeat_cob_id(self._node_id), lambda data: len(data) == 1)
        self._show(f"  NMT state: {self._state() or 'unknown, no heartbeat came'}")

    def _state(self) -> str:
        """The state in the newest heartbeat."""
        for cob_id, data in reversed(self._frames):
            if cob_id == heartbeat_cob_id(self._node_id) and len(data) == 1:
                known = {int(state): state.name.lower().replace("_", "-") for state in NmtState}
                return known.get(data[0], f"0x{data[0]:02X}, which is not documented")
        return ""

    def _pages(self) -> dict[str, Decoded]:
        """Query by the older protocol."""
        before = len(self._frames)
        self._bus.send(pages_request_cob_id(self._node_id), pages_request(self._node_id))
        self._listen(PAGES_S, -1, lambda _: False)
        values: dict[str, Decoded] = {}
        for cob_id, data in self._frames[before:]:
            page = parse_page(self._node_id, data)
            if page:
                self._show(f"  older protocol, COB-ID 0x{cob_id:03X}, page {data[1]}: {hex_of(data)}")
                values |= page
        if not values:
            self._show(f"  older protocol: no page within {PAGES_S:g} s; this BMU does not speak it")
        return values

    def _why_silent(self) -> str:
        ours = {NMT_COB_ID, request_cob_id(self._node_id), pages_request_cob_id(self._node_id)}
        others = sorted({cob_id for cob_id, _ in self._frames} - ours)  # some buses echo sent frames
        if self._state() == "stopped":
            return "an NMT command has stopped it; --nmt start wakes it"
        if others:
            heard = ", ".join(f"0x{cob_id:03X}" for cob_id in others[:8])
            return (
                f"but other frames come in (COB-ID {heard}), so wiring and bit rate are right: "
                "check its node switch (node id = switch + 0x10) and battery.node_id"
            )
        return say(self._bus.trouble) or (
            "nothing at all is heard: check its power, the cable, the terminators, the bit rate "
            "and its node switch (node id = switch + 0x10)"
        )


def _said(reply: SdoReply | None) -> str:
    if isinstance(reply, SdoValue):
        raw = reply.value.to_bytes(reply.size, "little")
        return f"{hex_of(raw):11} = 0x{reply.value:0{2 * reply.size}X} = {reply.value}, {reply.size} bytes"
    if isinstance(reply, SdoAbort):
        return say(reply.cause).partition(" ")[2]  # without the object, which stands before it
    return "no answer"
