"""The naive controller: the script an integrator would write today, as a yardstick. Never run it on real devices.

One thread. For each bay in turn: canopen's own SDO client, then pyserial, then a decision; then `sleep(0.2)`.
"""

import json
import struct
import sys
import time

import canopen
import serial


def frame(command: int, *data: int) -> bytes:
    body = bytes((0x90, len(data) + 3, command, 0x90, *data))
    return b"\xaf\xfa" + body + bytes((sum(body) & 0xFF,)) + b"\xaf\xa0"


STATUS = frame(0x01, 0x13, 0x1F)
STOP = (frame(0x10, 0), frame(0x02, 0x01, 0))
START = (frame(0x10, 1), frame(0x02, 0x02, 4), frame(0x02, 0x04, 4), frame(0x02, 0x08, 0), frame(0x02, 0x01, 1))


class Bay:
    def __init__(self, port: str, node: canopen.RemoteNode) -> None:
        self.port = serial.Serial(port, 19200, timeout=0.12)
        self.node = node
        self.charging: bool | None = None

    def turn(self) -> None:
        try:
            _amps, centivolts = struct.unpack("<hH", self.node.sdo.upload(0x6000, 0))
            _soh, soc, _minutes = struct.unpack("<BBH", self.node.sdo.upload(0x6002, 0))
            (decicelsius,) = struct.unpack("<h", self.node.sdo.upload(0x6004, 0)[:2])
        except (canopen.SdoCommunicationError, canopen.SdoAbortedError) as error:
            print(f"BMU {self.node.id}: {error}")  # it may answer next time
            return
        self.port.write(STATUS)
        reply = self.port.read(25)
        if len(reply) < 25:
            print(f"{self.port.port}: no answer")
            return
        _volts, _amps, _manual, _running, _step, mode, _precharge, connection = struct.unpack(">8H", reply[6:22])
        good = 0 <= decicelsius < 450 and centivolts < 5520 and connection == 1 and mode not in {6, 7, 8}
        wanted = good and soc < 100
        if wanted != self.charging:
            self.send(START if wanted else STOP)
            self.charging = wanted

    def send(self, frames: tuple[bytes, ...]) -> None:
        for each in frames:
            self.port.write(each)
            time.sleep(0.02)


def main() -> None:
    networks, bays = {}, []
    for wiring in json.loads(sys.argv[1]):
        key = json.dumps(wiring["can"])
        if key not in networks:
            networks[key] = canopen.Network().connect(**wiring["can"])
        node = networks[key].add_node(wiring["node_id"], canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
        bays.append(Bay(wiring["port"], node))
    while True:
        for bay in bays:
            bay.turn()
        time.sleep(0.2)


if __name__ == "__main__":
    main()
