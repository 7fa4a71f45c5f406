"""A BMU made of the manual's bytes and python-can's raw frames; it shares no code with the product.

python fake_bmu.py CHANNEL PORT NODE_ID…      on udp_multicast, until killed
"""

import struct
import sys
import threading
import time

import can

WORDS = {0x6000: 0x0940FFF8, 0x6001: 0x0000FFFF, 0x6002: 0xFFFF5A64, 0x6003: 0x03E807D0, 0x6004: 0x000000FA}


class FakeBmu:
    def __init__(self, bus: can.BusABC, node_id: int) -> None:
        self.bus, self.node_id = bus, node_id
        self.words = dict(WORDS)
        self.mute = False
        self.requests: list[bytes] = []
        self.boot()

    def boot(self) -> None:
        self.state, self.heartbeat_s, self.next_heartbeat_s = 0x7F, 0.0, 0.0
        self.tpdo_s, self.next_tpdo_s = 0.0, 0.0
        self.say(0x700, b"\x00")

    def say(self, base: int, data: bytes) -> None:
        self.bus.send(can.Message(arbitration_id=base + self.node_id, data=data, is_extended_id=False))

    def hear(self, message: can.Message) -> None:
        data = bytes(message.data)
        if message.arbitration_id == 0 and data[1] == self.node_id:
            if data[0] in (0x81, 0x82):
                self.boot()
            else:
                self.state = {0x01: 0x05, 0x02: 0x04, 0x80: 0x7F}[data[0]]
        elif message.arbitration_id == 0x600 + self.node_id and not self.mute and self.state != 0x04:
            self.requests.append(data)
            self.answer(data)

    def answer(self, data: bytes) -> None:
        index, sub = struct.unpack_from("<HB", data, 1)
        if data[0] == 0x40 and index in self.words and sub == 0:
            self.say(0x580, b"\x43" + data[1:4] + struct.pack("<I", self.words[index]))
        elif data[0] == 0x2B and (index, sub) == (0x1017, 0):
            self.heartbeat_s = struct.unpack_from("<H", data, 4)[0] / 1000
            self.say(0x580, b"\x60" + data[1:4] + bytes(4))
        elif data[0] == 0x2B and index in (0x1800, 0x1801, 0x1802) and sub == 5:
            self.tpdo_s = struct.unpack_from("<H", data, 4)[0] / 1000
            self.say(0x580, b"\x60" + data[1:4] + bytes(4))
        else:
            self.say(0x580, b"\x80" + data[1:4] + struct.pack("<I", 0x06020000))

    def tick(self, now_s: float) -> None:
        if self.heartbeat_s and now_s >= self.next_heartbeat_s and not self.mute:
            self.next_heartbeat_s = now_s + self.heartbeat_s
            self.say(0x700, bytes((self.state,)))
        if self.tpdo_s and now_s >= self.next_tpdo_s and self.state == 0x05 and not self.mute:
            self.next_tpdo_s = now_s + self.tpdo_s
            words = [struct.pack("<I", self.words[0x6000 + i]) for i in range(5)]
            self.say(0x180, words[0] + words[1])
            self.say(0x280, words[2] + words[3])
            self.say(0x380, words[4])


class Bmus(threading.Thread):
    """Several BMUs on one bus."""

    def __init__(self, bus: can.BusABC, node_ids: list[int]) -> None:
        super().__init__(daemon=True)
        self.bus, self.ending = bus, threading.Event()
        self.nodes = [FakeBmu(bus, node_id) for node_id in node_ids]

    def run(self) -> None:
        while not self.ending.is_set():
            message = self.bus.recv(0.01)
            for node in self.nodes:
                if message is not None and not message.is_error_frame:
                    node.hear(message)
                node.tick(time.monotonic())

    def close(self) -> None:
        self.ending.set()
        self.join()


if __name__ == "__main__":
    channel, port, *ids = sys.argv[1:]
    with can.Bus(interface="udp_multicast", channel=channel, port=int(port), hop_limit=0) as udp:
        bmus = Bmus(udp, [int(node_id) for node_id in ids])
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        bmus.run()
