"""Messages to the technician when a CAN bus does not work."""

import errno
import socket
import sys
import termios

import can
import pytest

from orchestrator.link import can_text
from tests.core.said import say

SETTINGS = {"interface": "socketcan", "channel": "can3", "bitrate": 125_000}


def raised(error: Exception, cause: Exception | None = None) -> Exception:
    """As if raised from `cause`."""
    error.__cause__ = cause
    return error


def test_an_interface_that_is_down_comes_with_the_command_to_bring_it_up() -> None:
    error = raised(can.CanOperationError("Error receiving: Network is down", errno.ENETDOWN))
    assert say(can_text.failure("left", SETTINGS, error)) == (
        "CAN bus left (socketcan can3): Network is down: the interface is down; "
        "bring it up: ip link set can3 up type can bitrate 125000 restart-ms 100"
    )


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENODEV, "No such device"), "is the adapter plugged in?"),
        (can.CanOperationError("x", errno.ENXIO), "plug it in again"),
        (raised(can.CanInitializationError("x"), FileNotFoundError(errno.ENOENT, "x")), "is the adapter plugged in?"),
        (raised(can.CanOperationError("x"), termios.error(errno.EIO, "x")), "plug it in again"),
        (PermissionError(errno.EACCES, "x"), "group dialout"),
        (OSError(errno.EAFNOSUPPORT, "x"), "modprobe can_raw"),
        (can.CanInterfaceNotImplementedError("msgpack not installed"), f"{sys.executable} -m pip install msgpack ("),
        (TypeError("unexpected keyword argument 'bitrat'"), "'bitrat'"),
        (raised(can.CanOperationError("x"), OSError("Write timeout")), "takes nothing any more"),
        (socket.gaierror(-2, "Name or service not known"), "Name or service not known: check the bus's settings"),
        (RuntimeError(), "RuntimeError: check the bus's settings"),
    ],
)
def test_other_failures_say_what_to_do(error: Exception, words: str) -> None:
    text = say(can_text.failure("can0", SETTINGS, error))
    assert words in text
    assert text.startswith("CAN bus can0 (socketcan can3): ")


def test_an_errno_is_found_wherever_it_is_in_the_chain() -> None:
    inner = OSError(errno.EIO, "x")
    assert can_text.errno_of(raised(can.CanError("a"), raised(ValueError("b"), inner))) == errno.EIO
    assert can_text.errno_of(ValueError("nothing of the sort")) is None
    assert can_text.errno_of(TimeoutError()) is None


@pytest.mark.parametrize(
    ("can_id", "data", "said"),
    [
        (0x040, "00 00 00 00 00 00 00 00", can_text.BUS_OFF),
        (0x044, "00 30 00 00 00 00 00 00", can_text.BUS_OFF),
        (0x004, "00 10 00 00 00 00 88 00", can_text.PASSIVE),
        (0x004, "00 20 00 00 00 00 00 88", can_text.PASSIVE),
        (0x004, "00 40 00 00 00 00 00 00", ""),
        (0x004, "00 04 00 00 00 00 00 60", None),  # only a warning level
        (0x004, "", None),
        (0x020, "00 00 00 00 00 00 00 00", can_text.NO_ACK),
        (0x100, "00 00 00 00 00 00 00 00", ""),
        (0x008, "00 00 04 00 00 00 00 00", None),  # a disturbed bit
    ],
)
def test_error_frames(can_id: int, data: str, said: str | None) -> None:
    assert can_text.error_frame(can_id, bytes.fromhex(data)) == said
