"""The stop of last resort on emulated chargers: what it writes, what it believes, and what it does not wait for."""

import fcntl
import os
import socket
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from orchestrator.model import Action, Command
from orchestrator.protocol.charger import STATUS_REQUEST, encode
from orchestrator.protocol.standby import OPERATION_STOP_FRAME, QUESTION, STOP_FRAME
from orchestrator.service.guardian import VERIFY_S
from orchestrator.service.laststop import (
    ASK_S,
    GONE,
    HELD,
    ROUND_S,
    RUNS,
    SILENT,
    STALLED,
    STOPS,
    drop_port,
    first_stop,
    open_port,
    stop_all,
)
from orchestrator.sim.charger_frames import Kind
from tests.guardian.chargers import running_chargers
from tests.link.ptys import plugged
from tests.waiting import wait_until

#: Every frame that a dying controller may have been writing.
FRAMES = (
    STATUS_REQUEST,
    encode(Command(Action.RUN)),
    encode(Command(Action.RESUME)),
    encode(Command(Action.STOP)),
    *(encode(Command(Action.SET_LIMIT, value)) for value in range(5)),
)


def test_every_charger_is_stopped_and_verified(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 8) as benches:
        assert stop_all({bench.name: bench.duplicate() for bench in benches}, 3.0) == {b.name: "" for b in benches}
        assert not any(bench.runs or bench.charger.run for bench in benches)


def test_a_round_ends_when_its_chargers_have_had_time_to_obey(tmp_path: Path) -> None:
    """Whoever opens contactors at its end breaks no current where the stop was obeyed, and does not wait otherwise."""
    with running_chargers(tmp_path, 2) as (good, deaf):
        deaf.charger.ignores_stop = True
        seen: list[tuple[bool, bool]] = []
        began_s = time.monotonic()
        rounds_s: list[float] = []

        def look() -> None:
            seen.append((good.runs, deaf.runs))
            rounds_s.append(time.monotonic() - began_s)

        stop_all({good.name: None, deaf.name: None}, 3 * ROUND_S, on_round=look)
        assert set(seen) == {(False, True)}
        assert len(seen) >= 2
        assert rounds_s[0] < 2 * ROUND_S


def test_every_frame_has_its_time(tmp_path: Path) -> None:
    """On the wire one after the other, and a charger has time to obey before it is asked."""
    frames = ((STOP_FRAME, 0.0), (STOP_FRAME, 0.02), (OPERATION_STOP_FRAME, 0.04), (QUESTION, ASK_S))
    with plugged(tmp_path / "port") as pty:
        began_s = time.monotonic()
        stopping = threading.Thread(target=stop_all, args=({pty.path: None}, ROUND_S + 0.1))
        stopping.start()
        for round_s in (0.0, ROUND_S):
            for frame, at_s in frames:
                assert os.read(pty.master, len(frame)) == frame
                assert time.monotonic() - began_s >= round_s + at_s
        stopping.join()


def test_a_port_is_opened_by_its_name(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        assert stop_all({bench.name: None}, 3.0) == {bench.name: ""}
        assert not bench.runs


def test_a_name_that_no_file_can_have_keeps_no_other_charger_running(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        nameless = "not the name of a port"
        assert stop_all({"a\0b": None, bench.name: None, "\ud800": None}, 1.0) == {
            "a\0b": nameless, bench.name: "", "\ud800": nameless,
        }  # fmt: skip
        assert not bench.runs


@pytest.mark.parametrize("line", ["echo", "garbage", "delayed", "bytewise", "lossy"])
def test_on_every_kind_of_line(tmp_path: Path, line: str) -> None:
    with running_chargers(tmp_path, line=line) as (bench,):
        assert stop_all({bench.name: None}, 5.0) == {bench.name: ""}
        assert not bench.runs


#: What a round puts on the wire.
ROUND = b"".join(frame for _, frame in STOPS) + QUESTION


@pytest.mark.parametrize(("longest", "rounds"), [(38, 1), (262, 10)])
def test_half_a_frame_does_not_spoil_the_stop(longest: int, rounds: int) -> None:
    """Whatever a charger's decoder has of a frame: it understands one of the two stops.

    One that believes any length at all swallows up to 256 bytes; the rounds go on for longer than that.
    """
    assert VERIFY_S / ROUND_S >= 10
    for frame in FRAMES:
        for cut in range(1, len(frame)):
            heard = naive_decoder(frame[:cut] + rounds * ROUND, longest)
            assert STOP_FRAME in heard, (frame.hex(" "), cut)
            assert encode(Command(Action.RUN)) not in heard, (frame.hex(" "), cut)


def naive_decoder(stream: bytes, longest: int) -> list[bytes]:
    """The good frames that a decoder finds which throws a bad frame away with what it swallowed of the next ones."""
    good, at = [], 0
    while (at := stream.find(b"\xaf\xfa", at)) >= 0 and at + 4 <= len(stream):
        size = stream[at + 3] + 6
        frame = stream[at : at + size]
        if size > longest:
            size = 4
        elif len(frame) == size and frame[-2:] == b"\xaf\xa0" and frame[-3] == sum(frame[2:-3]) % 256:
            good.append(frame)
        at += size
    return good


def test_half_a_frame_on_the_wire(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        os.write(bench.fd, FRAMES[0][:5])
        assert stop_all({bench.name: bench.duplicate()}, 3.0) == {bench.name: ""}


def test_an_answer_from_before_the_question_proves_nothing(tmp_path: Path) -> None:
    """The dying controller's last answers lie unread in the port, and say that all is well."""
    with running_chargers(tmp_path) as (bench,):
        bench.wire.lies[Kind.OPERATION] = 0
        os.write(bench.fd, STATUS_REQUEST + QUESTION)
        wait_until(lambda: bench.wire.counters.polls == 2)
        wait_until(lambda: waiting(bench.fd) >= 40)
        bench.wire.lies.clear()
        bench.charger.ignores_stop = True
        assert stop_all({bench.name: bench.duplicate()}, 0.6) == {bench.name: RUNS}


def waiting(fd: int) -> int:
    """Bytes that came in and were not read."""
    answer = bytearray(4)
    fcntl.ioctl(fd, 0x541B, answer)  # FIONREAD
    return int.from_bytes(answer, "little")


def test_a_charger_that_goes_on_is_told_from_a_silent_one(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 2) as (deaf, mute):
        deaf.charger.ignores_stop = True
        mute.wire.mute_tx = True
        told = stop_all({deaf.name: deaf.duplicate(), mute.name: mute.duplicate()}, 1.2)
        assert told == {deaf.name: RUNS, mute.name: SILENT}
        assert not mute.runs  # it heard
        assert deaf.stops >= 6  # in each of three rounds, twice


def test_a_late_obedience_is_waited_for(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        bench.charger.ignores_stop = True
        later = threading.Timer(0.8, setattr, (bench.charger, "ignores_stop", False))
        later.start()
        assert stop_all({bench.name: bench.duplicate()}, 5.0) == {bench.name: ""}


def test_a_line_that_takes_nothing_is_not_waited_for(tmp_path: Path) -> None:
    """What it had not taken is dropped: an order from before the stop must not come out minutes later."""
    with plugged(tmp_path / "stalled") as pty, running_chargers(tmp_path) as (bench,):
        filled = pty.fill()
        began_s = time.monotonic()
        adopted = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
        told = stop_all({pty.path: adopted, bench.name: bench.duplicate()}, 0.6)
        assert told[bench.name] == ""
        assert told[pty.path] in (STALLED, SILENT)
        assert time.monotonic() - began_s < 3.0
        came = pty.drain()
        assert len(came) < filled
        assert came.endswith(STOP_FRAME * 2 + OPERATION_STOP_FRAME + QUESTION)


def test_a_line_that_takes_nothing_at_all_says_so() -> None:
    """A tty that is flushed takes something again, if its driver lives."""
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    with theirs:
        with suppress(BlockingIOError):
            while True:
                ours.send(bytes(4096))
        assert stop_all({"/nowhere": ours.detach()}, 0.1) == {"/nowhere": STALLED}


def test_a_port_that_fails_is_opened_anew(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        held = bench.duplicate()
        bench.unplug()
        os.close(bench.fd)
        plug = threading.Timer(0.7, bench.plug)
        plug.start()
        assert stop_all({bench.name: held}, 5.0) == {bench.name: ""}
        plug.join()
        assert not bench.runs


def test_a_line_that_ends_says_so() -> None:
    """A tty that was hung up reads as an end of file, and may still take what is written."""
    ours, theirs = socket.socketpair()
    with theirs:
        theirs.shutdown(socket.SHUT_WR)
        assert stop_all({"/nowhere": ours.detach()}, 0.1) == {"/nowhere": GONE}


def test_an_open_port_keeps_nobody_waiting(tmp_path: Path) -> None:
    with plugged(tmp_path / "port") as pty:
        fd = open_port(pty.path, leave_held=False)
        assert not os.get_blocking(fd)
        os.close(fd)


def test_a_port_that_is_dropped_does_not_send_the_rest(tmp_path: Path) -> None:
    with plugged(tmp_path / "port") as pty:
        fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        filled = pty.fill()
        drop_port(fd)
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(fd)
        assert len(pty.drain()) < filled, "what the other end has not taken yet is lost"


def test_a_port_that_is_not_there_says_so(tmp_path: Path) -> None:
    assert stop_all({str(tmp_path / "none"): None}, 0.1) == {str(tmp_path / "none"): "No such file or directory"}
    assert stop_all({}, 5.0) == {}


def test_no_descriptor_is_left_open(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        before = len(list(Path("/proc/self/fd").iterdir()))
        stop_all({bench.name: bench.duplicate(), str(tmp_path / "none"): None}, 0.1)
        stop_all({bench.name: None}, 0.1)
        assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_a_port_that_a_service_holds_is_left_to_it(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        fcntl.flock(bench.fd, fcntl.LOCK_EX)
        assert stop_all({bench.name: None}, 0.1) == {bench.name: HELD}
        assert first_stop(bench.name, leave_held=True) is None
        assert bench.stops == 0
        assert bench.runs
        assert stop_all({bench.name: None}, 3.0, leave_held=False) == {bench.name: ""}


def test_a_file_that_is_no_port_is_not_written_to(tmp_path: Path) -> None:
    file = tmp_path / "station.yaml"
    file.write_text("station: depot-1\n")
    assert first_stop(str(file), leave_held=False) is None
    assert stop_all({str(file): None}, 0.1, leave_held=False) == {str(file): "not a serial port"}
    assert file.read_text() == "station: depot-1\n"


def test_two_who_stop_the_same_charger_both_get_their_proof(tmp_path: Path) -> None:
    """The guardian and an `estop`, say: each answer goes to one of them, as a whole."""
    with running_chargers(tmp_path) as (bench,):
        told: list[dict[str, str]] = []
        both = [
            threading.Thread(target=lambda: told.append(stop_all({bench.name: None}, 5.0, leave_held=False)))
            for _ in range(2)
        ]
        for one in both:
            one.start()
        for one in both:
            one.join()
        assert told == [{bench.name: ""}] * 2


def test_what_another_process_reads_is_not_read_here(tmp_path: Path) -> None:
    asked: list[float] = []

    def witness(names: object, since_s: float) -> dict[str, str]:
        asked.append(since_s)
        assert names == [bench.name]
        return {bench.name: "" if len(asked) == 3 else "not yet"}

    with running_chargers(tmp_path) as (bench,):
        began_s = time.monotonic()
        assert stop_all({bench.name: bench.duplicate()}, 5.0, witness=witness) == {bench.name: ""}
        assert bench.wire.counters.polls == 0
        assert len(set(asked)) == 1  # the first stops count
        assert asked[0] > began_s
        assert stop_all({bench.name: bench.duplicate()}, 0.6, witness=lambda *_: {bench.name: "no"}) == {
            bench.name: "no"
        }


def test_the_first_stop_is_out_when_it_returns(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        fd = first_stop(bench.name, leave_held=False)
        assert fd is not None
        os.close(fd)
        wait_until(lambda: bench.stops == 1)
        assert not bench.runs
