"""The serial port over real ptys: its function, and the sentence for everything that can go wrong."""

import errno
import fcntl
import os
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import serial

from orchestrator.errors import LinkError
from orchestrator.lastresort import line_settings, port_owner
from orchestrator.link.serial import BYTE_S, SerialLine
from tests.core.said import raises, say
from tests.link.ptys import Pty, plugged
from tests.link.strangers import holding, somebody_else, stty
from tests.waiting import wait_until


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[Pty]:
    with plugged(tmp_path / "port") as made:
        yield made


@pytest.fixture
def line(pty: Pty) -> Iterator[SerialLine]:
    opened = SerialLine.open(pty.path)
    yield opened
    opened.close()


def failure(path: str, *, kernel_rs485: bool = False) -> str:
    with pytest.raises(LinkError) as caught:
        SerialLine.open(path, kernel_rs485=kernel_rs485)
    return say(caught.value.cause)


# --- what it does ----------------------------------------------------------------------------------------------------


def test_bytes_cross_in_both_directions_unchanged(pty: Pty, line: SerialLine) -> None:
    every_byte = bytes(range(256))
    line.write(every_byte)
    assert os.read(pty.master, 512) == every_byte
    os.write(pty.master, every_byte)
    assert line.read(1.0) == every_byte


def test_the_line_is_19200_8n1_without_flow_control(pty: Pty, line: SerialLine) -> None:
    iflag, _, cflag, _, ispeed, ospeed, _ = termios.tcgetattr(line.fileno())
    assert ispeed == ospeed == termios.B19200
    assert cflag & termios.CSIZE == termios.CS8
    assert not cflag & (termios.PARENB | termios.CSTOPB | termios.CRTSCTS)
    assert not iflag & (termios.IXON | termios.IXOFF)


def test_what_came_in_before_the_port_was_opened_is_forgotten(pty: Pty) -> None:
    first = SerialLine.open(pty.path)
    os.write(pty.master, b"old")
    wait_until(lambda: _waiting(first.fileno()) == 3)
    first.close()
    second = SerialLine.open(pty.path)
    assert second.read(0.0) == b""
    second.close()


def test_a_read_returns_what_there_is_without_waiting_for_more(pty: Pty, line: SerialLine) -> None:
    os.write(pty.master, b"ab")
    begun_s = time.monotonic()
    assert line.read(5.0) == b"ab"
    assert time.monotonic() - begun_s < 1.0


def test_a_read_of_a_silent_line_ends_with_its_deadline(line: SerialLine) -> None:
    begun_s = time.monotonic()
    assert line.read(0.1, expected=20) == b""
    assert 0.099 <= time.monotonic() - begun_s < 0.5


def test_a_read_sleeps_over_the_time_that_the_bytes_need_on_the_wire(pty: Pty, line: SerialLine) -> None:
    os.write(pty.master, b"here already")
    begun_s = time.monotonic()
    assert line.read(5.0, expected=100) == b"here already"
    assert 100 * BYTE_S <= time.monotonic() - begun_s < 1.0


def test_the_sleep_never_outlasts_the_deadline(line: SerialLine) -> None:
    begun_s = time.monotonic()
    assert line.read(0.05, expected=10_000) == b""
    assert time.monotonic() - begun_s < 0.5


# --- one owner -------------------------------------------------------------------------------------------------------


def test_a_port_has_one_owner_and_is_free_once_closed(pty: Pty, line: SerialLine) -> None:
    assert "in use: another program holds it, or two bays name the same port" in failure(pty.path)
    line.close()
    line.close()
    SerialLine.open(pty.path).close()


def test_a_port_held_by_another_orchestrator_is_busy_until_that_ends(pty: Pty) -> None:
    with holding(pty.path, name="orchestrator"):
        assert "in use" in failure(pty.path)
    SerialLine.open(pty.path).close()


def test_a_strangers_lock_keeps_no_stop_away_and_is_named_until_it_is_ours(pty: Pty) -> None:
    with holding(pty.path) as stranger:
        line = SerialLine.open(pty.path)
        line.write(b"stop")
        assert os.read(pty.master, 16) == b"stop"
        assert say(line.locked_by()) == f"{Path(f'/proc/{stranger.pid}/comm').read_text().strip()} (pid {stranger.pid})"
    assert say(line.locked_by()) == ""
    assert "in use" in failure(pty.path), "the lock is ours now"
    line.close()


def test_a_stranger_that_nobody_can_see_is_one_all_the_same(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    with holding(pty.path):
        monkeypatch.setattr(port_owner, "_pids", list)  # as with /proc mounted hidepid=2
        monkeypatch.setattr(port_owner, "_lockers", lambda _: [])
        line = SerialLine.open(pty.path)
        assert say(line.locked_by()) == "an unknown program"
        line.close()


def test_a_port_that_one_program_has_for_itself_alone_says_what_to_do(pty: Pty) -> None:
    with holding(pty.path, "TIOCEXCL") as stranger, without_privileges(pty) as device:
        text = failure(device)
    assert "another program has opened it for itself alone (TIOCEXCL)" in text
    assert "or cut the charger's mains" in text
    if os.geteuid():
        assert f"(pid {stranger.pid})" in text


def test_a_port_that_is_ours_stays_open_for_a_stop_tool(pty: Pty, line: SerialLine) -> None:
    fcntl.ioctl(line.fileno(), termios.TIOCEXCL)
    assert say(line.locked_by()) == ""
    with without_privileges(pty) as device:
        os.close(os.open(device, os.O_WRONLY | os.O_NOCTTY))


# --- others set it to something else ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["115200"], "115200 baud"),
        (["9600", "echo"], "9600 baud, echo on"),
        (["cstopb"], "2 stop bits"),
        (["crtscts"], "hardware flow control"),
        (["ixon", "ixoff"], "software flow control"),
        (["-clocal"], "modem control"),
        (["icanon", "opost"], "reading line by line, translated output"),
        (["isig"], "control characters"),
        (["icrnl"], "translated input"),
        (["min", "255"], "reads that wait for more"),
        (["sane"], "echo on"),
    ],
)
def test_what_another_program_has_set_is_named_and_set_right(
    pty: Pty, line: SerialLine, words: list[str], found: str
) -> None:
    stty(pty.path, *words)
    assert found in say(line.restore())
    assert termios.tcgetattr(line.fileno())[4:6] == [termios.B19200, termios.B19200]
    assert say(line.restore()) == ""
    every_byte = bytes(range(256))
    os.write(pty.master, every_byte)
    assert line.read(1.0) == every_byte


@pytest.mark.parametrize(
    ("flag", "words"),
    [
        (termios.CS7, "7 data bits"),
        (termios.CS8 | termios.PARENB, "even parity"),
        (termios.CS8 | termios.PARENB | termios.PARODD, "odd parity"),
        (termios.CS8, "receiver off"),
    ],
)
def test_a_format_that_no_pty_takes_has_its_words(flag: int, words: str) -> None:
    cflag = flag | termios.CLOCAL | (0 if words == "receiver off" else termios.CREAD)
    flags = [0, 0, cflag, 0, termios.B19200, termios.B19200]
    assert line_settings.differences(flags, [0] * 32) == words


def test_a_speed_without_a_name_is_still_another_one() -> None:
    flags = [0, 0, termios.CS8 | termios.CLOCAL | termios.CREAD, 0, 12345, 12345]
    assert line_settings.differences(flags, [0] * 32) == "an odd number of baud"


def test_settings_that_a_driver_does_not_take_are_nobodys_doing(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    takes = termios.tcsetattr

    def always_two_stop_bits(fd: int, when: int, attributes: list[Any]) -> None:
        attributes[2] |= termios.CSTOPB
        takes(fd, when, attributes)

    monkeypatch.setattr(termios, "tcsetattr", always_two_stop_bits)
    line = SerialLine.open(pty.path)
    assert say(line.restore()) == ""
    stty(pty.path, "115200")
    assert say(line.restore()) == "115200 baud, 2 stop bits"
    assert say(line.restore()) == ""
    line.close()


def test_a_driver_that_does_not_take_the_speed_is_told(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    takes = termios.tcsetattr

    def always_fast(fd: int, when: int, attributes: list[Any]) -> None:
        attributes[4] = attributes[5] = termios.B115200
        takes(fd, when, attributes)

    monkeypatch.setattr(termios, "tcsetattr", always_fast)
    text = failure(pty.path)
    assert "its driver does not take the charger's settings, 19200 baud 8N1; use another adapter (115200 baud)" in text
    monkeypatch.undo()
    SerialLine.open(pty.path).close()  # it was given back


def test_output_that_was_suspended_goes_on(pty: Pty, line: SerialLine) -> None:
    termios.tcflow(line.fileno(), termios.TCOOFF)
    line.restore()
    line.write(b"stop")
    assert os.read(pty.master, 16) == b"stop"


def test_another_line_discipline_is_taken_back(pty: Pty, line: SerialLine) -> None:
    try:
        fcntl.ioctl(line.fileno(), termios.TIOCSETD, (1).to_bytes(4, sys.byteorder))  # N_SLIP
    except OSError:
        pytest.skip("this kernel has no other one")
    assert say(line.restore()) == "line discipline 1"
    assert say(line.restore()) == ""


def test_a_look_at_the_settings_costs_a_stop_next_to_nothing(line: SerialLine) -> None:
    took_s = sorted(_seconds(line.restore) for _ in range(200))
    assert took_s[100] < 0.001


def test_a_stop_tool_that_takes_no_lock_can_write_to_a_port_that_is_in_use(pty: Pty, line: SerialLine) -> None:
    tool = os.open(pty.path, os.O_WRONLY | os.O_NOCTTY)  # would be EBUSY with TIOCEXCL, except for root
    os.write(tool, b"stop")
    os.close(tool)
    assert os.read(pty.master, 16) == b"stop"
    tiocgexcl = 0x80045440
    assert fcntl.ioctl(line.fileno(), tiocgexcl, bytes(4)) == bytes(4)


# --- what goes wrong -------------------------------------------------------------------------------------------------


def test_a_port_that_is_not_there(tmp_path: Path) -> None:
    text = failure(str(tmp_path / "ttyUSB7"))
    assert text.startswith(f"{tmp_path}/ttyUSB7: no such port: check that the adapter is plugged in")


def test_a_port_that_the_user_may_not_open(pty: Pty) -> None:
    device = os.path.realpath(pty.path)
    Path(device).chmod(0)
    with somebody_else():
        text = failure(device)
    assert text == f"{device}: permission denied: add the user that runs this to the group dialout, then log in again"


@pytest.mark.parametrize("kind", ["file", "directory", "null"])
def test_what_is_no_serial_port(tmp_path: Path, kind: str) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "directory").mkdir()
    (tmp_path / "null").symlink_to("/dev/null")
    assert "it is no serial port: check the name in the station file" in failure(str(tmp_path / kind))


def test_a_driver_that_cannot_switch_the_direction(pty: Pty) -> None:
    text = failure(pty.path, kernel_rs485=True)
    assert "cannot switch the direction of an RS-485 line (rs485: kernel); use an adapter that switches" in text
    SerialLine.open(pty.path).close()  # it was given back


def test_an_error_without_a_sentence_of_its_own_is_told_in_the_kernels_words(
    pty: Pty, monkeypatch: pytest.MonkeyPatch
) -> None:
    def loops(*_: object) -> int:
        raise OSError(errno.ELOOP, "loops")

    monkeypatch.setattr(os, "open", loops)  # no device here fails like that
    assert failure(pty.path) == f"{pty.path}: cannot be opened (ELOOP)"


def test_an_unplugged_adapter_is_told_by_reading_and_by_writing(pty: Pty, line: SerialLine) -> None:
    pty.unplug()
    for use in (lambda: line.read(1.0), lambda: line.read(1.0, expected=5), lambda: line.write(b"x")):
        with raises(LinkError, match=r"port: the adapter was unplugged or lost its power, or another program"):
            use()
    line.close()


def test_a_plugged_in_adapter_opens_under_the_same_name(pty: Pty, line: SerialLine) -> None:
    pty.unplug()
    assert "no such port" in failure(pty.path)
    line.close()
    pty.plug()
    again = SerialLine.open(pty.path)
    again.write(b"back")
    assert os.read(pty.master, 16) == b"back"
    again.close()


def test_a_stalled_line_is_told_without_burning_the_processor(pty: Pty, line: SerialLine) -> None:
    pty.fill()
    burnt_s, begun_s = time.thread_time(), time.monotonic()
    with raises(LinkError, match=r"port: stalled, it took nothing for 0\.2 s; unplug the adapter"):
        line.write(b"order")
    assert 0.2 <= time.monotonic() - begun_s < 1.0
    assert time.thread_time() - burnt_s < 0.1


def test_an_order_that_a_stalled_line_kept_does_not_come_out_later(pty: Pty, line: SerialLine) -> None:
    line.write(bytes(8192))  # the device's end of the pty takes the first 4096 of these: they count as sent
    line.write(b"old order")
    filled = pty.fill()
    with raises(LinkError, match="stalled"):
        line.write(b"new order")
    left = pty.drain()
    assert len(left) < filled
    assert b"order" not in left


def test_a_port_that_is_gone_has_no_settings(pty: Pty, line: SerialLine) -> None:
    pty.unplug()
    for use in (line.restore, lambda: [line.locked_by(), line.read(0.0)]):
        with raises(LinkError, match="unplugged"):
            use()


def test_a_port_that_is_gone_has_no_output_to_forget(pty: Pty, line: SerialLine) -> None:
    pty.unplug()
    line._forget_output()  # between a time-out and this, an adapter can be unplugged


def test_every_use_after_close_is_a_link_error(line: SerialLine) -> None:
    line.close()
    for use in (line.fileno, lambda: line.write(b"x"), lambda: line.read(0.1), line.restore, line.locked_by):
        with pytest.raises(LinkError):
            use()


def test_close_never_fails(line: SerialLine) -> None:
    os.close(line.fileno())
    line.close()
    with pytest.raises(LinkError):
        line.fileno()


@pytest.mark.parametrize("raised", [termios.error(errno.EIO, "gone"), TypeError("fd is None"), ValueError("fd is -1")])
def test_whatever_pyserial_raises_is_translated(
    line: SerialLine, monkeypatch: pytest.MonkeyPatch, raised: Exception
) -> None:
    def fails(*_: object) -> None:
        raise raised

    monkeypatch.setattr(serial.Serial, "fileno", fails)  # from races no test can win reliably
    with raises(LinkError, match="unplugged"):
        line.write(b"x")


# --- helpers ---------------------------------------------------------------------------------------------------------


def _waiting(fd: int) -> int:
    return int.from_bytes(fcntl.ioctl(fd, termios.FIONREAD, bytes(4)), sys.byteorder)


def _seconds(work: Callable[[], object]) -> float:
    begun_s = time.perf_counter()
    work()
    return time.perf_counter() - begun_s


@contextmanager
def without_privileges(pty: Pty) -> Iterator[str]:
    """Root may open an exclusive device, so become another user with access to it."""
    device = os.path.realpath(pty.path)
    Path(device).chmod(0o666)
    with somebody_else():
        yield device
