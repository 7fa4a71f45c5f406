"""One thread that reads the BMUs of one bus: ours, or bare python-can. It tells what processor time that thread uses.

    python -m benchmarks.can_reader ours|bare SETTINGS [FD]

SETTINGS are python-can's, as JSON. FD takes the place of the socket that SocketCAN would have opened: python-can's code
for it then runs unchanged on machines whose kernel has no CAN. Each line on standard input is answered with the
thread's nanoseconds on a processor and its wake-ups so far.
"""

import json
import logging
import re
import socket
import sys
import threading
import time
from pathlib import Path
from typing import Any
from unittest.mock import patch

from can.interfaces.socketcan import socketcan

from benchmarks import bare
from orchestrator.config.load import load_map
from orchestrator.config.station import BatteryConfig
from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus import BatteryBus
from orchestrator.devices.bus_budget import EXCHANGE_BITS, PLANNED, SHARE, BusBudget
from orchestrator.link.can import CanBus

NODES = range(1, 65)
READS_HZ = 960
#: The bus on which that is what our reads are planned for.
BITRATE = round(READS_HZ * EXCHANGE_BITS / (SHARE * PLANNED))


def read_ours(settings: dict[str, Any]) -> int:
    """Begin to read; the thread's number."""
    bus = CanBus("can0", settings, NODES)
    budget, tabos = BusBudget(bus.bitrate), load_map("tabos")
    configs = (BatteryConfig(can="can0", node_id=node, map=tabos, heartbeat_s=None) for node in NODES)
    nodes = [BatteryNode("can0", one, budget, _nothing) for one in configs]
    BatteryBus(bus, nodes, budget, time.monotonic).start()
    return _of_name("can-can0")


def read_bare(settings: dict[str, Any]) -> int:
    """The same with the loop of `bare.py`."""
    arguments = settings, list(NODES), 1 / READS_HZ
    threading.Thread(target=bare.read_objects, args=arguments, name="bare", daemon=True).start()
    return _of_name("bare")


def _of_name(name: str) -> int:
    (thread,) = (one for one in threading.enumerate() if one.name == name)
    assert thread.native_id is not None
    return thread.native_id


def _nothing() -> None:
    """Nobody decides anything here."""


def _use(thread: int) -> tuple[int, int]:
    """Nanoseconds on a processor, and how often it slept."""
    task = Path(f"/proc/self/task/{thread}")
    slept = re.search(r"^voluntary_ctxt_switches:\s*(\d+)", (task / "status").read_text(encoding="ascii"), re.MULTILINE)
    assert slept is not None
    return int((task / "schedstat").read_text(encoding="ascii").split()[0]), int(slept[1])


def main(side: str, settings: str, fd: str = "") -> None:
    """Until standard input ends."""
    logging.getLogger("can").setLevel(logging.CRITICAL)  # no socket but CAN's has CAN's options
    read = read_ours if side == "ours" else read_bare
    with patch.multiple(
        socketcan, create_socket=lambda: socket.socket(fileno=int(fd)), bind_socket=lambda _socket, _channel: None
    ):
        thread = read(json.loads(settings))
        for _ in sys.stdin:
            print(json.dumps(_use(thread)), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
