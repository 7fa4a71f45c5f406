"""A floor for processor time: the bytes of the service in bare loops. Nothing is decoded, decided, checked or stopped.

    python -m benchmarks.bare '[{"port", "node_id", "can": {…}}, …]' SDO_READS_PER_SECOND_ON_EACH_BUS

One thread per bus (python-can) and one per port (pyserial), as in the service.
"""

import json
import sys
import threading
import time
from itertools import cycle
from typing import Any

import can
import serial

STATUS_REQUEST = bytes.fromhex("AF FA 90 05 01 90 13 1F 58 AF A0")
REPLY_BYTES = 25
SLOT_S = 0.2
WIRE_S = (len(STATUS_REQUEST) + REPLY_BYTES) * 10 / 19200
OBJECTS = (0x6000, 0x6001, 0x6002, 0x6003, 0x6004)


def main() -> None:
    """Until a signal ends it."""
    wirings, reads_per_s = json.loads(sys.argv[1]), float(sys.argv[2])
    buses = {json.dumps(wiring["can"]): wiring["can"] for wiring in wirings}
    for text, settings in buses.items():
        nodes = [wiring["node_id"] for wiring in wirings if json.dumps(wiring["can"]) == text]
        threading.Thread(target=read_objects, args=(settings, nodes, 1 / reads_per_s), daemon=True).start()
    for wiring in wirings:
        threading.Thread(target=poll, args=(wiring["port"],), daemon=True).start()
        time.sleep(SLOT_S / len(wirings))
    threading.Event().wait()


def read_objects(settings: dict[str, Any], nodes: list[int], period_s: float) -> None:
    """One SDO read after another, from one node after another."""
    bus = can.Bus(**settings)
    next_s = time.monotonic()
    for node, index in cycle([(node, index) for index in OBJECTS for node in nodes]):
        request = b"\x40" + index.to_bytes(2, "little") + bytes(5)
        bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
        while (message := bus.recv(0.1)) is not None and message.arbitration_id != 0x580 + node:
            pass
        next_s += period_s
        time.sleep(max(0.0, next_s - time.monotonic()))


def poll(path: str) -> None:
    """One status request per slot, as cheaply as a thread can: it sleeps while the bytes are on the wire."""
    port = serial.Serial(path, 19200, timeout=0.1)
    next_s = time.monotonic()
    while True:
        port.write(STATUS_REQUEST)
        time.sleep(WIRE_S)
        port.read(REPLY_BYTES)
        next_s += SLOT_S
        time.sleep(max(0.0, next_s - time.monotonic()))


if __name__ == "__main__":
    main()
