"""Peculiarities of python-can's drivers that python-can does not hide."""

import errno
from collections.abc import Mapping
from contextlib import suppress
from io import IOBase
from socket import socket
from typing import Protocol

from orchestrator.link import can_text

#: Settings that we add unless the station file has them, by interface.
PROTECTIVE: Mapping[str, Mapping[str, object]] = {
    # python-can's default of 1 ms is a busy loop (5 % of a core when idle); this delays a read by at most as much.
    "slcan": {"timeout": 0.01},
    # Nothing leaves this machine.
    "udp_multicast": {"hop_limit": 0},
}


def protected(settings: Mapping[str, object]) -> dict[str, object]:
    """The settings, completed with the protective ones."""
    return {**PROTECTIVE.get(str(settings.get("interface")), {}), **settings}


class Driver(Protocol):
    """A bus opened by python-can."""

    def shutdown(self) -> None:
        """It may raise anything."""


def close(bus: Driver) -> None:
    """Shut a bus down. Never raises. Until all its files are closed, an adapter's name is not free again."""
    with suppress(Exception):
        bus.shutdown()
    for part in vars(bus).values():  # left open if the driver's own shutdown failed
        if isinstance(part, IOBase | socket):
            with suppress(OSError):
                part.close()


def is_queue_full(error: Exception) -> bool:
    """Whether a frame was rejected because nobody acknowledges the earlier ones."""
    full = isinstance(error, BlockingIOError) or str(error) == "Transmit buffer full"
    return full or can_text.errno_of(error) == errno.ENOBUFS
