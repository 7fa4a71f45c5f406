"""The virtual kernel behaves like the real one: settings, locks, files, power cuts, dying processes."""

import fcntl
import os
import termios
from collections.abc import Callable
from math import inf
from random import Random
from threading import Thread
from typing import Any

import pytest

from tests.proof.virtual_calls import Trouble
from tests.proof.virtual_disk import Disk
from tests.proof.virtual_kernel import Kernel
from tests.proof.virtual_process import Processes
from tests.proof.virtual_time import Time

NAME = "/virtual/1"
FILE = "/virtual/kept"


@pytest.fixture(name="kernel")
def _kernel() -> Kernel:
    kernel = Kernel(Time(100.0))
    kernel.add(NAME)
    return kernel


def settings(speed: int) -> list[Any]:
    return [0, 0, termios.CS8 | termios.CREAD | termios.CLOCAL, 0, speed, speed, [b"\0"] * 32]


def set_up(kernel: Kernel, fd: int, speed: int) -> None:
    kernel.tcsetattr(fd, termios.TCSANOW, settings(speed))


def test_a_port_begins_as_nobody_has_set_it_up_and_is_heard_at_the_right_speed_only(kernel: Kernel) -> None:
    heard: list[bytes] = []
    kernel.ttys[NAME].listener = heard.append
    fd = kernel.open(NAME, os.O_RDWR)
    kernel.write(fd, b"stop")
    set_up(kernel, fd, termios.B19200)
    kernel.write(fd, b"stop")
    kernel.ttys[NAME].taken_over(termios.B115200)
    kernel.write(fd, b"stop")
    assert heard[0] != b"stop"
    assert heard[1] == b"stop"
    assert heard[2] != b"stop"
    assert kernel.tcgetattr(fd)[5] == termios.B115200
    assert kernel.tcgetattr(fd)[2] & 0o010017 == termios.B115200, "as Linux shows it, in c_cflag as well"


def test_settings_are_those_of_a_real_tty(kernel: Kernel) -> None:
    """The same calls on a pty: settings read back as set, in the same form."""
    master, slave = os.openpty()
    fd = kernel.open(NAME, os.O_RDWR)
    set_up(kernel, fd, termios.B19200)
    termios.tcsetattr(slave, termios.TCSANOW, settings(termios.B19200))
    try:
        assert kernel.tcgetattr(fd)[:6] == termios.tcgetattr(slave)[:6]
        assert kernel.tcgetattr(fd)[6][termios.VMIN] == termios.tcgetattr(slave)[6][termios.VMIN]
    finally:
        os.close(master)
        os.close(slave)


def test_a_lock_belongs_to_the_open_file_and_lives_as_long_as_a_duplicate(kernel: Kernel) -> None:
    first, second = kernel.open(NAME, os.O_RDWR), kernel.open(NAME, os.O_RDWR)
    kernel.flock(first, fcntl.LOCK_EX | fcntl.LOCK_NB)
    double = kernel.copy(first)
    kernel.close(first)
    with pytest.raises(BlockingIOError):
        kernel.flock(second, fcntl.LOCK_EX | fcntl.LOCK_NB)
    kernel.close(double)
    kernel.flock(second, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_only_the_thread_that_calls_waits(kernel: Kernel) -> None:
    told: list[tuple[str, float]] = []
    kernel.calls.troubles.append(Trouble("open", NAME, delay_s=5.0))

    def opens() -> None:
        kernel.open(NAME, os.O_RDWR)
        told.append(("open", kernel.time.now_s - 1000))

    def lives() -> None:
        kernel.time.wait(1001.0)
        told.append(("alive", kernel.time.now_s - 1000))

    kernel.time.start(opens)
    kernel.time.start(lives)
    kernel.time.wait(1010.0)
    kernel.time.close()
    assert told == [("alive", 1.0), ("open", 5.0)]


def test_a_thread_of_the_real_machine_changes_nothing(kernel: Kernel) -> None:
    """One that another test left behind would start or end what it must not."""
    said: list[str] = []

    def left_over(call: Callable[[], object]) -> None:
        try:
            call()
        except OSError as error:
            said.append(str(error))

    for call in (kernel.time.me, lambda: kernel.time.wait(inf), lambda: kernel.time.start(lambda: None)):
        thread = Thread(target=left_over, args=(call,))
        thread.start()
        thread.join(5.0)
    assert said == ["a thread of the real machine, left over from another test: it has no turn here"] * 3
    started_s = kernel.time.now_s
    kernel.time.wait(started_s + 5.0)
    assert kernel.time.now_s == pytest.approx(started_s + 5.0, abs=0.01)


def test_who_is_killed_in_a_call_keeps_its_locks_until_the_call_is_over(kernel: Kernel) -> None:
    processes = Processes(kernel)
    process = processes.new("victim")

    def main() -> int:
        fd = kernel.open(NAME, os.O_RDWR)
        kernel.flock(fd, fcntl.LOCK_EX)
        kernel.calls.troubles.append(Trouble("ioctl", NAME, delay_s=5.0))
        kernel.ioctl(fd)
        raise AssertionError("it is dead by then")

    process.run(main)
    kernel.time.call_later(1.0, process.signal, 9)
    kernel.time.wait(1002.0)
    assert (process.status, process.dead) == (-9, False)
    assert kernel.ttys[NAME].lock is not None
    kernel.time.wait(1006.0)
    assert process.dead
    assert kernel.ttys[NAME].lock is None
    kernel.time.close()


def written(disk: Disk, path: str, data: bytes) -> None:
    inode = disk.open(path, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
    disk.write(inode, 0, data)


def left(disk: Disk, how: str, seed: int = 0) -> dict[str, bytes]:
    disk.cut(Random(seed), how)
    return {path: bytes(inode.data) for path, inode in disk.names.items()}


def replaced(*, sync_file: bool, sync_directory: bool) -> Disk:
    """A durable file "old", replaced by "new" with a write beside it and a rename."""
    disk = Disk("/virtual")
    written(disk, FILE, b"old")
    disk.sync(disk.names[FILE])
    disk.sync_directory("/virtual")
    written(disk, FILE + ".new", b"new")
    if sync_file:
        disk.sync(disk.names[FILE + ".new"])
    disk.rename(FILE + ".new", FILE)
    if sync_directory:
        disk.sync_directory("/virtual")
    return disk


def test_what_was_synced_with_its_directory_survives_every_power_cut() -> None:
    for seed in range(200):
        assert left(replaced(sync_file=True, sync_directory=True), "", seed)[FILE] == b"new"


def test_without_the_directory_the_old_one_may_be_back() -> None:
    found = {left(replaced(sync_file=True, sync_directory=False), "", seed)[FILE] for seed in range(50)}
    assert found == {b"old", b"new"}


def test_without_the_file_its_bytes_may_be_lost_behind_its_name() -> None:
    found = {left(replaced(sync_file=False, sync_directory=True), "", seed)[FILE] for seed in range(200)}
    assert b"new" in found
    assert b"" in found
    assert b"old" not in found, "its name was durable"
    assert found & {b"n", b"ne"}, "a write is torn"


def test_a_process_that_is_killed_leaves_the_page_cache() -> None:
    disk = Disk("/virtual")
    written(disk, FILE, b"new")
    assert bytes(disk.names[FILE].data) == b"new"
    assert left(disk, "nothing more") == {}


def test_standard_error_that_stands_still_holds_whoever_writes(kernel: Kernel) -> None:
    said: list[str] = []
    kernel.on_said = lambda _process, text: said.append(text)
    kernel.output[2].stopped = True
    kernel.time.start(lambda: kernel.write(2, b"late"))
    kernel.time.wait(1005.0)
    assert said == []
    kernel.output[2].stopped = False
    kernel.output[2].news.wake()
    kernel.time.wait(1006.0)
    assert said == ["late"]
    kernel.time.close()


def test_a_call_that_never_returns_does_not(kernel: Kernel) -> None:
    kernel.calls.troubles.append(Trouble("fsync", FILE, delay_s=inf))
    kernel.time.start(lambda: kernel.fsync(kernel.open(FILE, os.O_CREAT | os.O_RDWR)))
    kernel.time.wait(1050.0)
    assert kernel.disk.names[FILE].data == b""
    kernel.time.close()
