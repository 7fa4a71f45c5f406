"""A bare client for each of the two emulated lines; it shares no code with the product."""

import contextlib
import os
import select
import socket
import termios
import time
import tty
from collections.abc import Iterator

import can

from orchestrator.sim.pack import Readout

#: Chosen so that 0x6000 reads as in the manual's sample (§4.1.2), and every field of the others is distinct.
TOLD = Readout(
    voltage_v=23.68,
    current_a=-0.08,
    status=0x0041,
    time_to_full_min=None,
    time_to_empty_min=0x0102,
    soc_pct=55.4,
    soh_pct=98.0,
    remaining_ah=11.08,
    available_wh=532.9,
    temperature_c=-2.5,
)

DEADLINE_S = 5.0


class Port:
    """The controller's end of a pty."""

    def __init__(self, path: str) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.fd)
        settings = termios.tcgetattr(self.fd)
        settings[4] = settings[5] = termios.B19200
        termios.tcsetattr(self.fd, termios.TCSANOW, settings)

    def write(self, text: str) -> None:
        os.write(self.fd, bytes.fromhex(text))

    def read(self, count: int, within_s: float = DEADLINE_S) -> str:
        """Exactly `count` bytes as hex, or what came before the time-out."""
        heard, deadline_s = b"", time.monotonic() + within_s
        while len(heard) < count and select.select([self.fd], [], [], max(deadline_s - time.monotonic(), 0))[0]:
            heard += os.read(self.fd, count - len(heard))
        return heard.hex(" ").upper()

    def read_until(self, text: str, within_s: float = DEADLINE_S) -> str:
        """Everything up to `text` (hex), or what came before the time-out."""
        heard, deadline_s = "", time.monotonic() + within_s
        while text not in heard and time.monotonic() < deadline_s:
            heard = f"{heard} {self.read(1, 0.05)}".strip()
        return heard

    def ask(self, text: str, count: int) -> str:
        self.write(text)
        return self.read(count)

    def close(self) -> None:
        os.close(self.fd)


def framed(body: str) -> str:
    """A whole frame around address, length, command, order and data, computed as in §3.2."""
    data = bytes.fromhex(body)
    return (b"\xaf\xfa" + data + bytes((sum(data) % 256,)) + b"\xaf\xa0").hex(" ").upper()


def udp_keys() -> dict[str, object]:
    """A private multicast bus that does not leave this machine."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    return {"interface": "udp_multicast", "channel": "239.74.163.2", "port": port, "hop_limit": 0}


@contextlib.contextmanager
def on_bus(**keys: object) -> Iterator["Client"]:
    bus = can.Bus(**keys)  # type: ignore[arg-type]  # python-can types each key by its interface
    try:
        yield Client(bus)
    finally:
        bus.shutdown()


class Client:
    """A CAN node that sends given frames and waits for frames."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus

    def send(self, cob_id: int, text: str) -> None:
        self.bus.send(can.Message(arbitration_id=cob_id, data=bytes.fromhex(text), is_extended_id=False))

    def wait(self, cob_id: int, within_s: float = DEADLINE_S) -> str | None:
        """The next frame with this COB-ID as hex; None if there is none in time."""
        deadline_s = time.monotonic() + within_s
        while (left_s := deadline_s - time.monotonic()) > 0:
            message = self.bus.recv(left_s)
            if message is not None and message.arbitration_id == cob_id:
                return bytes(message.data).hex(" ").upper()
        return None

    def wait_for(self, cob_id: int, text: str) -> bool:
        """Whether this frame comes, possibly after others with its COB-ID."""
        while (heard := self.wait(cob_id)) is not None:
            if heard == text:
                return True
        return False

    def ask(self, cob_id: int, text: str, within_s: float = DEADLINE_S) -> str | None:
        """An SDO request and its answer."""
        self.send(cob_id, text)
        return self.wait(cob_id - 0x80, within_s)
