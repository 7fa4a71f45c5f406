"""A BatteryNode on a bench: hand-made frames, simulated time."""

from collections.abc import Iterable

from orchestrator.config.load import load_map
from orchestrator.config.station import BatteryConfig
from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.model import BatteryLink, BatteryReading
from orchestrator.protocol.objects import ObjectMap

TX, RX = "TX", "RX"
Frame = tuple[int, bytes]
#: Sender, COB-ID, bytes.
Dialogue = Iterable[tuple[str, int, str]]

TABOS = load_map("tabos")

#: The node of the manual's samples (§4).
NODE_ID = 0x10
REQUEST, REPLY, HEARTBEAT, EMERGENCY = 0x610, 0x590, 0x710, 0x090


def config(
    *,
    node_id: int = NODE_ID,
    heartbeat_s: float | None = None,
    tpdo_s: float | None = None,
    object_map: ObjectMap = TABOS,
    sweep_s: float = 0.05,
) -> BatteryConfig:
    return BatteryConfig(
        can="can0", node_id=node_id, map=object_map, heartbeat_s=heartbeat_s, tpdo_s=tpdo_s, sweep_s=sweep_s
    )


class Bench:
    def __init__(self, settings: BatteryConfig | None = None, bitrate: int = 1_000_000) -> None:
        self.now_s = 1000.0
        self.changes = 0
        self.sent: list[Frame] = []
        self.node = BatteryNode("can0", settings or config(), BusBudget(bitrate), self._changed)

    def _changed(self) -> None:
        self.changes += 1

    @property
    def reading(self) -> BatteryReading:
        return self.node.view[0]

    @property
    def link(self) -> BatteryLink:
        return self.node.view[1]

    def hear(self, cob_id: int, data: str) -> None:
        """Pass a frame to the node."""
        self.node.on_frame(cob_id, bytes.fromhex(data), self.now_s)

    def step(self, end_s: float) -> Frame | None:
        """Let time pass, calling the node when it asks, until it sends; None if it has not sent by `end_s`."""
        begin = len(self.sent)
        while max(self.node.next_due_s, self.now_s) <= end_s:
            self.now_s = max(self.node.next_due_s, self.now_s)
            self.node.turn(self.now_s, lambda cob_id, data: self.sent.append((cob_id, data)))
            if len(self.sent) > begin:
                assert len(self.sent) == begin + 1
                return self.sent[-1]
        self.now_s = end_s
        return None

    def run(self, seconds: float) -> list[Frame]:
        """Let this much time pass; returns what the node sent."""
        begin, end_s = len(self.sent), self.now_s + seconds
        while self.step(end_s):
            pass
        return self.sent[begin:]

    def next_frame(self, within_s: float = 5.0) -> Frame:
        """Let time pass until the node sends."""
        frame = self.step(self.now_s + within_s)
        assert frame, f"nothing was sent in {within_s} s"
        return frame

    def play(self, dialogue: Dialogue, latency_s: float = 0.001) -> None:
        """Play it: each TX must be the node's next frame; each RX follows after `latency_s`."""
        for number, (who, cob_id, data) in enumerate(dialogue):
            if who == TX:
                sent_id, sent = self.next_frame()
                expected = f"{cob_id:03X} {bytes.fromhex(data).hex(' ').upper()}"
                assert f"{sent_id:03X} {sent.hex(' ').upper()}" == expected, f"frame {number}"
            else:
                self.now_s += latency_s
                self.hear(cob_id, data)

    def answer_reads(self, seconds: float, words: dict[int, int], latency_s: float = 0.001) -> None:
        """Answer every read and write for this long, like a healthy BMU."""
        end_s = self.now_s + seconds
        while frame := self.step(end_s - latency_s):
            cob_id, data = frame
            self.now_s += latency_s
            if cob_id == REQUEST and data[0] == 0x40:
                word = (ONCE | words)[data[1] | data[2] << 8]
                self.node.on_frame(REPLY, b"\x43" + data[1:4] + word.to_bytes(4, "little"), self.now_s)
            elif cob_id == REQUEST:
                self.node.on_frame(REPLY, b"\x60" + data[1:4] + bytes(4), self.now_s)
        self.now_s = end_s


#: What is read beside them: the heartbeat period in ms, and no serial number.
ONCE = {0x1017: 500, 0x1018: 0}
#: A pack at 23.68 V, −0.08 A, 25.0 °C, 90 %, health 100 %, no status bit set, TTF and TTE not available.
WORDS = {0x6000: 0x0940FFF8, 0x6001: 0x0000FFFF, 0x6002: 0xFFFF5A64, 0x6003: 0x03E807D0, 0x6004: 0x000000FA}
