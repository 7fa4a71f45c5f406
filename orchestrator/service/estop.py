"""`orchestrator estop`: stop chargers with no service, with one that hangs and with one that runs.

Ports are opened without the lock that a service holds on them, and the first stop goes out before anything else is
looked at. Standard library only, and PyYAML where a station file has to be read.
"""

import os
import sys
import termios
import time
from contextlib import suppress
from pathlib import Path

from orchestrator.protocol.standby import STOP_FRAME
from orchestrator.service.laststop import stop_all

USAGE = """\
usage: orchestrator estop [STATION] [--port PATH ...] [--socket PATH]

Stop the charger on every port of the station file (default: station.yaml), or on the given ports, and verify it.
Needs no running service. Exit status 0: every charger was verified to stand by; 1: not every one.
"""
#: How long the proof of standby is waited for.
VERIFY_S = 3.0
#: 19200 8N1, no flow control, bytes as they are (§2.2.2).
_CONTROL = termios.CS8 | termios.CREAD | termios.CLOCAL
_CHARACTERS: list[bytes | int] = [b"\0"] * 32
_SETTINGS: list[int | list[bytes | int]] = [0, 0, _CONTROL, 0, termios.B19200, termios.B19200, _CHARACTERS]


def main(arguments: list[str]) -> int:
    """Parse the command line by hand (the quickest way), stop, verify, tell."""
    ports, words, control = _parse(arguments)
    if ports is None:
        print(USAGE, end="")  # noqa: T201 - what people read
        return 2 if "-h" not in arguments and "--help" not in arguments else 0
    opened, told = {}, {}
    for port in ports or _station_ports(words[0] if words else "station.yaml"):
        try:
            opened[port] = _open_and_stop(port)
        except OSError as error:
            told[port] = f"{port}: {error.strerror}"
    service = _tell_service(control)
    told |= stop_all(opened, VERIFY_S)
    for port, why in told.items():
        print(why or f"{port}: standby verified")  # noqa: T201
    if service:
        print(service)  # noqa: T201
    if not told:
        print("no port to stop: name a station file or --port PATH", file=sys.stderr)  # noqa: T201
    return 1 if not told or any(told.values()) else 0


def _parse(arguments: list[str]) -> tuple[list[str] | None, list[str], str]:
    """(ports, other words, control socket); ports is None where the line is not understood, or help is asked for."""
    ports: list[str] = []
    words: list[str] = []
    control = os.environ.get("ORCHESTRATOR_SOCKET", "")
    taking = ""
    for word in arguments:
        if taking == "--port" and not word.startswith("-"):
            ports.append(word)
        elif taking == "--socket":
            control, taking = word, ""
        elif word in ("--port", "--socket"):
            taking = word
        elif word.startswith("-") or words:
            return None, [], ""
        else:
            words.append(word)
    return (None if ports and words else ports), words, control


def _station_ports(station: str) -> tuple[str, ...]:
    """The chargers' ports in a station file, even in one with mistakes."""
    from orchestrator.config.ports import charger_ports  # noqa: PLC0415 - PyYAML, only where it is needed

    try:
        return charger_ports(Path(station))
    except OSError as error:
        print(f"{station}: {error.strerror}", file=sys.stderr)  # noqa: T201
        return ()


def _open_and_stop(port: str) -> int:
    """Open a port, whoever else has it, set the line up and say stop."""
    fd = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    with suppress(termios.error):  # not a terminal: a stop is written all the same
        termios.tcsetattr(fd, termios.TCSANOW, _SETTINGS)
    with suppress(BlockingIOError):
        os.write(fd, STOP_FRAME)
    return fd


def _tell_service(control: str) -> str:
    """A service that runs must not start again what was stopped here: tell it, and say what it answered."""
    if not control:
        return ""
    from orchestrator.errors import ServiceError  # noqa: PLC0415 - after the first stop
    from orchestrator.service.control import ask  # noqa: PLC0415

    began_s = time.monotonic()
    try:
        ask(Path(control), {"verb": "stop", "bays": None}, timeout_s=1.0)
    except ServiceError as error:
        return f"the service was not told: {error}"
    return f"the service holds every bay stopped ({time.monotonic() - began_s:.2f} s)"
