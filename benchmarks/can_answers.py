"""Emulated BMUs for `can_reads.py`: they answer SDO reads one after the other, as fast as a wire of 1 Mbit/s lets them.

    python -m benchmarks.can_answers multicast GROUP PORT
    python -m benchmarks.can_answers socket FD

Without the wire's time an answer would be there before anybody could wait for it. Each line on standard input is
answered with the number of reads so far.
"""

import socket
import struct
import sys
import threading
import time
from collections.abc import Callable

import msgpack

REQUESTS, REPLIES = range(0x600, 0x680), 0x580 - 0x600
READ, VALUE = 0x40, 0x43
#: A pack at rest: 23.68 V and -0.08 A, no status bit, 90 %, 25.0 °C. Values that do not change cost no decision.
WORDS = {0x6000: 0x0940FFF8, 0x6001: 0x0000FFFF, 0x6002: 0xFFFF5A64, 0x6003: 0x03E807D0, 0x6004: 0x000000FA}
#: Two frames of 8 bytes.
WIRE_S = 270 / 1_000_000
FRAME = struct.Struct("=IB3x8s")  #: struct can_frame


class Count:
    """Reads that were answered."""

    reads = 0


def answer(cob_id: int, data: bytes) -> tuple[int, bytes] | None:
    """The answer to a frame, if it is a read of one of the objects."""
    if cob_id not in REQUESTS or data[0] != READ:
        return None
    time.sleep(WIRE_S)
    Count.reads += 1
    word = WORDS.get(data[1] | data[2] << 8, 0)  # such as no serial number
    return cob_id + REPLIES, bytes((VALUE,)) + data[1:4] + word.to_bytes(4, "little")


def on_socket(wire: socket.socket) -> Callable[[], None]:
    """The code path of SocketCAN: its frames, on a pair of sockets."""

    def turn() -> None:
        cob_id, _length, data = FRAME.unpack(wire.recv(FRAME.size))
        if reply := answer(cob_id, data):
            wire.send(FRAME.pack(reply[0], 8, reply[1]))

    return turn


def on_multicast(group: str, port: int) -> Callable[[], None]:
    """python-can's `udp_multicast`."""
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    wire.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    wire.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    wire.bind(("", port))
    member = socket.inet_aton(group) + struct.pack("@I", socket.INADDR_ANY)
    wire.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)

    def turn() -> None:
        message = msgpack.unpackb(wire.recv(4096))
        if reply := answer(message["arbitration_id"], message["data"]):
            message["arbitration_id"], message["data"] = reply
            wire.sendto(msgpack.packb(message), (group, port))

    return turn


def main(kind: str, *where: str) -> None:
    """Until standard input ends."""
    turn = (
        on_multicast(where[0], int(where[1])) if kind == "multicast" else on_socket(socket.socket(fileno=int(where[0])))
    )

    def answers() -> None:
        while True:
            turn()

    threading.Thread(target=answers, daemon=True).start()
    print("ready", flush=True)
    for _ in sys.stdin:
        print(Count.reads, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
