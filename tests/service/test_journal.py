"""The journal on real files: bounded, on full, missing or hanging disks, and never blocking anyone."""

import json
import os
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.service import journal as journal_module
from orchestrator.service.journal import BACKLOG, STALL_S, VERSION, Journal, rfc3339
from orchestrator.service.rotating import FILES, RotatingFile
from tests.core.said import say
from tests.waiting import wait_until

WALL_S = 1_700_000_000.0


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_module, "GATHER_S", 0.01)
    monkeypatch.setattr(journal_module, "RETRY_S", 0.02)


@contextmanager
def writing(directory: Path, max_mb: float = 1.0) -> Iterator[Journal]:
    journal = Journal(directory, max_mb, time.monotonic, lambda: WALL_S)
    journal.start()
    try:
        yield journal
    finally:
        journal.close()


def problem(journal: Journal) -> str:
    return say(journal.problem(time.monotonic()))


def read(directory: Path, stream: str = "events") -> list[dict[str, Any]]:
    """The entries of a stream, the oldest first."""
    return [line for line in every(directory, stream) if line["kind"] not in ("run", "lost")]


def every(directory: Path, stream: str) -> list[dict[str, Any]]:
    """All lines of a stream, the oldest file first."""
    names = [f"{stream}.{age}.jsonl" for age in range(FILES, 0, -1)] + [f"{stream}.jsonl"]
    texts = [(directory / name).read_text(encoding="utf-8") for name in names if (directory / name).exists()]
    return [json.loads(line) for text in texts for line in text.splitlines()]


def test_lines_go_where_they_belong_with_both_times(tmp_path: Path) -> None:
    began_s = time.monotonic()
    with writing(tmp_path / "deep" / "journal") as journal:
        journal.put("bay-1", ("transition", {"from": None, "to": "IDLE", "reason": "8.4 °C"}))
        journal.put("bay-1", ("snapshot", {"whole": True}))
    (event,) = read(tmp_path / "deep" / "journal")
    assert began_s <= event.pop("t") <= time.monotonic()
    assert event == {
        "wall": "2023-11-14T22:13:20.000Z",
        "bay": "bay-1",
        "kind": "transition",
        "from": None,
        "to": "IDLE",
        "reason": "8.4 °C",
    }
    assert [line["kind"] for line in read(tmp_path / "deep" / "journal", "snapshots")] == ["snapshot"]


def test_a_later_run_goes_on_in_the_same_file(tmp_path: Path) -> None:
    for number in range(3):
        with writing(tmp_path) as journal:
            journal.put("bay-1", ("decision", {"n": number}))
    assert [line["n"] for line in read(tmp_path)] == [0, 1, 2]


def test_a_line_that_a_power_failure_cut_off_spoils_only_itself(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").write_text('{"kind":"decision","n":0}\n{"kind":"deci', encoding="utf-8")
    with writing(tmp_path) as journal:
        journal.put("bay-1", ("decision", {"n": 1}))
    lines = (tmp_path / "events.jsonl").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 4
    assert json.loads(lines[3])["n"] == 1


def test_it_never_takes_more_than_its_space_and_keeps_the_newest(tmp_path: Path) -> None:
    with writing(tmp_path) as journal:
        for number in range(9000):
            journal.put("bay-1", ("decision", {"n": number, "fill": "x" * 50}))
            journal.put("bay-1", ("snapshot", {"n": number, "fill": "°" * 200}))
            if number % 1000 == 0:
                wait_until(lambda: not journal._waiting, what="the writer")
    sizes = {path.name: path.stat().st_size for path in tmp_path.glob("*.jsonl")}
    assert len(sizes) == 2 * FILES
    assert sum(sizes.values()) <= 1_000_000
    assert sum(size for name, size in sizes.items() if name.startswith("events")) > 150_000
    for stream in ("events", "snapshots"):
        numbers = [line["n"] for line in read(tmp_path, stream)]
        assert numbers == list(range(numbers[0], 9000))


@given(st.lists(st.binary(min_size=1, max_size=3000).map(lambda data: data.replace(b"\n", b" ") + b"\n"), max_size=40))
def test_a_file_of_any_lines_is_bounded_and_in_order(
    tmp_path_factory: pytest.TempPathFactory, lines: list[bytes]
) -> None:
    directory = tmp_path_factory.mktemp("lines")
    file = RotatingFile(directory, "some", FILES * 4096)
    left = deque(lines)
    file.take(left)
    assert not left
    parts = [directory / f"some.{age}.jsonl" for age in range(FILES - 1, 0, -1)] + [directory / "some.jsonl"]
    assert all(part.stat().st_size <= 4096 for part in parts if part.exists())
    written = b"".join(part.read_bytes() for part in parts if part.exists())
    assert b"".join(lines).endswith(written)
    assert (len(written) == len(b"".join(lines))) or len(written) > (FILES - 1) * 1000


def test_a_full_disk_is_told_and_nothing_is_lost_when_it_has_room_again(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").symlink_to("/dev/full")
    with writing(tmp_path) as journal:
        for number in range(3):
            journal.put("bay-1", ("decision", {"n": number}))
        wait_until(lambda: "No space left on device" in problem(journal), what="the problem")
        journal.put("bay-1", ("decision", {"n": 3}))
        (tmp_path / "events.jsonl").unlink()
        wait_until(lambda: not problem(journal), what="the end of the problem")
        assert journal.lost == 0
    assert [line["n"] for line in read(tmp_path)] == [0, 1, 2, 3]


def test_what_a_full_disk_took_in_part_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file size limit cuts a write in the middle, like a disk with a few bytes left."""
    import resource

    path = tmp_path / "some.jsonl"
    path.write_bytes(b"first\n")
    file = RotatingFile(tmp_path, "some", 1_000_000)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    lines = deque([b"x" * 100 + b"\n"])
    resource.setrlimit(resource.RLIMIT_FSIZE, (50, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            file.take(lines)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.read_bytes() == b"first\n"
    assert len(lines) == 1


def test_a_directory_that_cannot_be_is_told_and_used_once_it_can(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("in the way", encoding="utf-8")
    directory = tmp_path / "run" / "journal"
    with writing(directory) as journal:
        journal.put("bay-1", ("decision", {"n": 0}))
        wait_until(lambda: problem(journal), what="the problem")
        assert problem(journal).startswith("the journal cannot be written: ")
        assert str(directory.parent) in problem(journal)
        (tmp_path / "run").unlink()
        wait_until(lambda: not problem(journal), what="the end of the problem")
    assert [line["n"] for line in read(directory)] == [0]


def test_what_no_disk_takes_is_dropped_the_oldest_first_and_counted(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").symlink_to("/dev/full")
    with writing(tmp_path) as journal:
        for number in range(BACKLOG + 5):
            journal.put("bay-1", ("decision", {"n": number}))
            if number % 5000 == 0:
                wait_until(lambda: not journal._waiting, what="the writer")
        wait_until(lambda: journal.lost == 5, what="the count")
        (tmp_path / "events.jsonl").unlink()
        wait_until(lambda: not problem(journal), what="the end of the problem")
    assert read(tmp_path)[-1]["n"] == BACKLOG + 4


def test_nobody_waits_for_a_disk_that_hangs(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "events.jsonl")  # opening it for writing hangs until it has a reader
    with writing(tmp_path) as journal:
        journal.put("bay-1", ("decision", {"n": 0}))
        wait_until(lambda: not journal._waiting, what="the writer")
        began_s = time.monotonic()
        for number in range(BACKLOG + 7):
            journal.put("bay-1", ("decision", {"n": number}))
        assert time.monotonic() - began_s < 2
        assert journal.lost == 7
        assert not problem(journal)
        hung = say(journal.problem(time.monotonic() + STALL_S))
        assert hung.startswith("the journal has not been written for 3")
        began_s = time.monotonic()
        journal.close()
        assert time.monotonic() - began_s < 2
        os.close(os.open(tmp_path / "events.jsonl", os.O_RDONLY | os.O_NONBLOCK))  # releases the thread


def test_a_journal_that_is_not_written_says_so(tmp_path: Path) -> None:
    journal = Journal(tmp_path, 1.0, time.monotonic, time.time)
    assert problem(journal) == "the journal is not being written"
    journal.put("bay-1", ("decision", {}))
    journal.close()


def test_a_name_that_is_no_text_can_be_written(tmp_path: Path) -> None:
    with writing(tmp_path) as journal:
        journal.put("bay-1", ("fault", {"text": os.fsdecode(b"/dev/\xff")}))
    assert read(tmp_path)[0]["text"] == "/dev/\udcff"


def test_every_run_begins_with_a_line_of_its_own(tmp_path: Path) -> None:
    for boot in ("one", "other"):
        journal = Journal(tmp_path, 1.0, time.monotonic, lambda: WALL_S, boot=boot)
        journal.put("bay-1", ("decision", {"n": 0}))
        journal.put("bay-1", ("snapshot", {"n": 0}))
        journal._write()
        journal._write()
    for stream in ("events", "snapshots"):
        lines = every(tmp_path, stream)
        assert [line["kind"] == "run" for line in lines] == [True, False, True, False]
        assert [(line["version"], line["boot"]) for line in lines[::2]] == [(VERSION, "one"), (VERSION, "other")]
        assert lines[0]["run"] != lines[2]["run"]
    runs = [[line["run"] for line in every(tmp_path, stream)[::2]] for stream in ("events", "snapshots")]
    assert runs[0] == runs[1]


def test_a_stream_that_is_not_used_has_no_file(tmp_path: Path) -> None:
    with writing(tmp_path) as journal:
        journal.put("bay-1", ("decision", {"n": 0}))
    assert [path.name for path in tmp_path.iterdir()] == ["events.jsonl"]


@pytest.mark.parametrize("end", [b"\0" * 700, b'{"text":"8.4 \xc2', b'{"kind":"deci'])
def test_whatever_a_power_cut_leaves_swallows_no_line_of_the_next_run(tmp_path: Path, end: bytes) -> None:
    (tmp_path / "events.jsonl").write_bytes(b'{"kind":"decision","n":0}\n' + end)
    with writing(tmp_path) as journal:
        journal.put("bay-1", ("decision", {"n": 1}))
    lines = (tmp_path / "events.jsonl").read_bytes().split(b"\n")
    assert lines[1] == end
    assert [json.loads(line)["kind"] for line in lines[2:-1]] == ["run", "decision"]


def test_events_are_on_the_disk_when_they_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The record of the accident survives a power cut right after it; snapshots are too many for that."""
    synchronised: list[Path] = []
    monkeypatch.setattr(
        "orchestrator.service.rotating.os.fsync", lambda fd: synchronised.append(Path(f"/proc/self/fd/{fd}").readlink())
    )
    with writing(tmp_path) as journal:
        journal.put("bay-1", ("fault", {"id": "hot"}))
        journal.put("bay-1", ("snapshot", {}))
    assert set(synchronised) == {tmp_path / "events.jsonl"}


def test_a_gap_is_a_line_of_its_own_before_what_has_lost_its_base(tmp_path: Path) -> None:
    journal = Journal(tmp_path, 100.0, time.monotonic, lambda: WALL_S)
    journal.put("bay-1", ("snapshot", {"n": -1}))
    journal._write()
    for number in range(BACKLOG + 3):
        journal.put("bay-1", ("snapshot", {"n": number}))
    journal._write()
    lines = every(tmp_path, "snapshots")
    assert [line["kind"] for line in lines[:4]] == ["run", "snapshot", "lost", "snapshot"]
    assert (lines[2]["lines"], lines[3]["n"]) == (3, 3)


def test_times_are_utc_to_the_millisecond() -> None:
    assert rfc3339(0.0) == "1970-01-01T00:00:00.000Z"
    assert rfc3339(1_795_395_996.25) == "2026-11-23T01:06:36.250Z"
