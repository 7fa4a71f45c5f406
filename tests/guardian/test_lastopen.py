"""Contactors on bare descriptors: numbers and structures match the kernel's header; errors are handled."""

import errno
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.lastresort import lastopen
from orchestrator.lastresort.lastopen import GET_LINE, HELD, OPEN, OPENED, REQUEST, SET_VALUES, request

SOURCE = Path(__file__).with_name("gpio_abi.c")
#: A C compiler, if there is one, with the kernel's header.
COMPILERS = [path for path in (shutil.which("cc"),) if path and Path("/usr/include/linux/gpio.h").exists()]


class Kernel:
    """Takes the ioctls; answers with `error`, if set, or with a descriptor for a line."""

    def __init__(self, error: int = 0) -> None:
        self.asked: list[tuple[int, bytes]] = []
        self.granted = -1
        self._error = error

    def ioctl(self, _fd: int, number: int, argument: bytes | bytearray) -> None:
        self.asked.append((number, bytes(argument)))
        if self._error:
            raise OSError(self._error, os.strerror(self._error))
        if isinstance(argument, bytearray):
            self.granted = os.open(os.devnull, os.O_RDWR)
            argument[-4:] = struct.pack("=i", self.granted)


def kernel(monkeypatch: pytest.MonkeyPatch, error: int = 0) -> Kernel:
    made = Kernel(error)
    monkeypatch.setattr("orchestrator.lastresort.lastopen.fcntl.ioctl", made.ioctl)
    return made


def files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def is_open(fd: int) -> bool:
    return Path(f"/proc/self/fd/{fd}").exists()


@pytest.mark.parametrize("compiler", COMPILERS)
def test_numbers_and_structures_are_those_of_the_kernels_header(
    compiler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "gpio_abi"
    subprocess.run([compiler, "-Wall", "-Werror", "-o", str(program), str(SOURCE)], check=True)
    done = subprocess.run([str(program)], capture_output=True, text=True, check=True)
    golden = {name: bytes.fromhex(value) for name, _, value in (line.partition("=") for line in done.stdout.split())}
    assert int.from_bytes(golden["get_line"], sys.byteorder) == GET_LINE
    assert int.from_bytes(golden["set_values"], sys.byteorder) == SET_VALUES
    assert golden["open"] == OPEN
    assert REQUEST.unpack(golden["granted"])[-1] == 0x01020304
    for name, active_low in (("active_high", False), ("active_low", True)):
        asked = kernel(monkeypatch).asked
        request(os.devnull, 17, active_low=active_low)
        assert asked == [(GET_LINE, golden[name])]


def test_a_line_that_nobody_holds_is_requested_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    before = files()
    made = kernel(monkeypatch)
    assert request(os.devnull, 17, active_low=False) == OPENED
    assert made.granted > 0
    assert not is_open(made.granted)
    assert files() == before


@pytest.mark.parametrize(
    ("error", "said"),
    [(errno.EBUSY, HELD), (errno.EINVAL, "Invalid argument"), (errno.EPERM, os.strerror(errno.EPERM))],
)
def test_a_line_that_is_not_granted_is_told(error: int, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = files()
    kernel(monkeypatch, error)
    assert request(os.devnull, 17, active_low=False) == said
    assert files() == before


def test_what_is_no_chip_is_told(tmp_path: Path) -> None:
    assert request(str(tmp_path / "none"), 1, active_low=False) == "No such file or directory"
    assert request(os.devnull, 2, active_low=True) == "Inappropriate ioctl for device"


def test_a_descriptor_of_something_else_is_told() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    assert lastopen.open_contactor(writer) == "Inappropriate ioctl for device"
    os.close(writer)
    assert lastopen.open_contactor(writer) == "Bad file descriptor"
