"""The journal on real files: bounded, on full, missing or hanging disks, and never blocking anyone."""

import gzip
import json
import os
import subprocess
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.record.utc import utc
from orchestrator.service import journal as journal_module
from orchestrator.service import rotating
from orchestrator.service.journal import BACKLOG, STALL_S, VERSION, Journal
from orchestrator.service.journal_files import files_of, lines_of
from orchestrator.service.packed import PackedFile
from orchestrator.service.parts import MIN_PART, PARTS, order, size_of
from orchestrator.service.rotating import RotatingFile
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
    return [json.loads(text or b"") for path in files(directory, stream) for _, text in lines_of(path)]


def files(directory: Path, stream: str) -> list[Path]:
    """Its files, the oldest first."""
    return files_of(directory.glob(f"{stream}*.jsonl*"))


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
    dice = Random(1)
    with writing(tmp_path) as journal:
        for number in range(9000):
            journal.put("bay-1", ("decision", {"n": number, "fill": dice.randbytes(30).hex()}))
            journal.put("bay-1", ("snapshot", {"n": number, "fill": dice.randbytes(200).hex()}))
            if number % 500 == 0:
                wait_until(lambda: not any(journal._waiting.values()), what="the writer")
                assert sum(taken(tmp_path).values()) <= 1_000_000
    sizes = taken(tmp_path)
    assert sum(sizes.values()) <= 1_000_000
    assert sum(size for name, size in sizes.items() if name.startswith("events")) > 80_000
    assert sum(size for name, size in sizes.items() if name.startswith("snapshots")) > 800_000
    for stream in ("events", "snapshots"):
        numbers = [line["n"] for line in read(tmp_path, stream)]
        assert numbers == list(range(numbers[0], 9000))


def begin() -> bytes:
    return b""


def taken(directory: Path) -> dict[str, int]:
    return {path.name: size_of(path) for path in directory.iterdir()}


@pytest.mark.parametrize("kind", [RotatingFile, PackedFile])
@given(st.lists(st.binary(min_size=1, max_size=3000).map(lambda data: data.replace(b"\n", b" ") + b"\n"), max_size=40))
def test_a_file_of_any_lines_is_bounded_and_in_order(
    tmp_path_factory: pytest.TempPathFactory, kind: type[RotatingFile | PackedFile], lines: list[bytes]
) -> None:
    directory = tmp_path_factory.mktemp("lines")
    file = kind(directory, "some", PARTS * MIN_PART, begin)
    for line in lines:
        left = deque([line])
        file.take(left)
        assert not left
    assert sum(taken(directory).values()) <= PARTS * MIN_PART
    written = content(directory)
    assert b"".join(lines).endswith(written)
    assert (len(written) == len(b"".join(lines))) or len(written) > (PARTS - 3) * 1000


def content(directory: Path) -> bytes:
    """All its files, the oldest first."""
    parts = sorted(directory.iterdir(), key=order)
    return b"".join(gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes() for path in parts)


class CutError(BaseException):
    """The power fails."""


class Failing:
    """`os`, until the power fails in its n-th call that changes something; half of a write is done by then."""

    def __init__(self, calls: int) -> None:
        self.calls = calls

    def __getattr__(self, name: str) -> Any:
        call = getattr(os, name)
        return partial(self._counted, call) if name in ("write", "fsync", "replace", "unlink") else call

    def _counted(self, call: Callable[..., Any], *arguments: Any) -> Any:
        self.calls -= 1
        if self.calls < 0:
            if call is os.write:
                os.write(arguments[0], arguments[1][: len(arguments[1]) // 2])
            raise CutError
        return call(*arguments)


@pytest.mark.parametrize("calls", range(12))
def test_a_power_cut_while_a_part_is_compressed_loses_nothing(
    calls: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = [b'{"n":%d}\n' % number for number in range(1000)]
    RotatingFile(tmp_path, "events", 100_000, begin).take(deque(lines))
    cut = False
    with monkeypatch.context() as patched:
        patched.setattr(rotating, "os", Failing(calls))
        try:
            RotatingFile(tmp_path, "events", 100_000, begin)._rotate()
        except CutError:
            cut = True
    assert cut == (calls < 6), "calls that change something"
    assert [text for path in files_of([tmp_path]) for _, text in lines_of(path)] == [line[:-1] for line in lines]
    RotatingFile(tmp_path, "events", 100_000, begin).take(deque([b'{"n":1000}\n']))
    assert content(tmp_path) == b"".join(lines) + b'{"n":1000}\n'
    assert not list(tmp_path.glob("*.new"))
    plain = [path.name for path in tmp_path.glob("*.jsonl")]
    assert plain == ["events.jsonl"], "what was left half done is finished"


def members(path: Path, count: int) -> list[bytes]:
    """The members of a file with as many of them, each with three lines."""
    file, sizes = PackedFile(path.parent, "snapshots", 10_000_000, begin), [0]
    for number in range(count):
        file.take(deque(b'{"n":%d}\n' % (3 * number + one) for one in range(3)))
        sizes.append(size_of(path))
    data = path.read_bytes()
    return [data[begin:end] for begin, end in pairwise(sizes)]


def test_what_a_power_cut_tears_off_the_open_part_costs_that_member_alone(tmp_path: Path) -> None:
    path = tmp_path / "snapshots.jsonl.gz"
    *whole, last = members(path, 3)
    for left in range(len(last)):
        for old in tmp_path.iterdir():
            old.unlink()
        path.write_bytes(b"".join(whole) + last[:left])
        PackedFile(tmp_path, "snapshots", 10_000_000, begin).take(deque([b'{"n":9}\n']))
        lines = [text for path in files_of([tmp_path]) for _, text in lines_of(path) if text and text.endswith(b"}")]
        assert lines[:6] == [b'{"n":%d}' % number for number in range(6)]
        assert lines[-1] == b'{"n":9}', "what comes after it"
        assert len(files_of([tmp_path])) == (2 if left else 1), "a torn part is not continued"


@pytest.mark.parametrize("spoilt", [b"", b"\0" * 40, b"\x1f\x8b\x08 no gzip at all"])
def test_a_tear_in_the_middle_is_named_and_passed_over(tmp_path: Path, spoilt: bytes) -> None:
    path = tmp_path / "snapshots.jsonl.gz"
    first, second, third = members(path, 3)
    path.write_bytes(first + second[:-12] + spoilt + third)
    found = [text for _, text in lines_of(path)]
    numbers = [text for text in found if text and text.startswith(b"{") and text.endswith(b"}")]
    assert [*numbers[:3], *numbers[-3:]] == [b'{"n":%d}' % number for number in (0, 1, 2, 6, 7, 8)]
    assert None in found


def test_parts_of_an_older_version_are_read_first_and_dropped_first(tmp_path: Path) -> None:
    for name, number in (("snapshots.2.jsonl", 0), ("snapshots.1.jsonl", 1), ("snapshots.jsonl", 2)):
        (tmp_path / name).write_text(f'{{"n":{number},"fill":"{"x" * 5000}"}}\n', encoding="utf-8")
    file, dice = PackedFile(tmp_path, "snapshots", PARTS * MIN_PART, begin), Random(1)
    for number in range(3, 30):
        file.take(deque([json.dumps({"n": number, "fill": dice.randbytes(1600).hex()}).encode() + b"\n"]))
    numbers = [json.loads(text or b"")["n"] for path in files_of([tmp_path]) for _, text in lines_of(path)]
    assert numbers == list(range(numbers[0], 30))
    assert numbers[0] in (1, 2)
    assert sum(taken(tmp_path).values()) <= PARTS * MIN_PART


def test_the_ordinary_tools_read_it_while_it_is_being_written(tmp_path: Path) -> None:
    with writing(tmp_path) as journal:
        for number in range(9):
            journal.put("bay-1", ("snapshot", {"n": number}))
            journal.put("bay-1", ("transition", {"n": number}))
            wait_until(
                lambda: (tmp_path / "snapshots.jsonl.gz").exists() and not any(journal._waiting.values()),
                what="the writer",
            )
        wait_until(lambda: len(read(tmp_path, "snapshots")) == 9, what="the last one")
        shown = subprocess.run(["zcat", *tmp_path.glob("snapshots*")], check=True, capture_output=True, text=True)
        found = subprocess.run(["zgrep", "-h", "transition", *tmp_path.glob("*")], capture_output=True, text=True)
    assert [json.loads(line)["kind"] for line in shown.stdout.splitlines()] == ["run", *["snapshot"] * 9]
    assert len(found.stdout.splitlines()) == 9


def test_a_smaller_space_holds_from_the_start(tmp_path: Path) -> None:
    for age in range(1, 8):
        (tmp_path / f"events.{age}.jsonl").write_bytes(b"x" * 20_000)
        (tmp_path / f"snapshots-{age:06}.jsonl.gz").write_bytes(b"x" * 200_000)
    (tmp_path / "events-000001.jsonl.gz.new").write_bytes(b"half of a part that was dropped meanwhile")
    journal = Journal(tmp_path, 1.0, time.monotonic, lambda: WALL_S)
    journal.put("bay-1", ("decision", {}))
    journal.put("bay-1", ("snapshot", {}))
    journal._write()
    assert sum(taken(tmp_path).values()) <= 1_000_000
    assert (tmp_path / "snapshots-000007.jsonl.gz").exists(), "the newest stay"
    assert list(tmp_path.glob("*.new")) == []


def test_a_record_that_cannot_be_made_costs_itself_alone(tmp_path: Path) -> None:
    def fails() -> dict[str, object]:
        raise RuntimeError("a defect")

    with writing(tmp_path) as journal:
        journal.put("bay-1", ("snapshot", {"n": 0}))
        journal.put("bay-1", ("snapshot", fails))
        journal.put("bay-1", ("snapshot", {"n": 2}))
        journal.put("bay-1", ("decision", {}))
        wait_until(lambda: (tmp_path / "snapshots.jsonl.gz").exists(), what="the writer")
        assert not journal.stalled(time.monotonic())
        assert journal.lost == 1
    kinds = [line["kind"] for line in every(tmp_path, "snapshots")]
    assert kinds == ["run", "snapshot", "lost", "snapshot"], "what follows lacks its base"


def test_snapshots_wait_for_each_other_unless_something_happens(tmp_path: Path) -> None:
    now_s = 1000.0
    journal = Journal(tmp_path, 1.0, lambda: now_s, lambda: WALL_S)
    for second in range(12):
        now_s = 1000.0 + second
        journal.put("bay-1", ("snapshot", {"n": second}))
        journal._write(all_of_it=False)
        assert len(read(tmp_path, "snapshots")) == (0 if second < 5 else 6 if second < 11 else 12)
    journal.put("bay-1", ("snapshot", {"n": 12}))
    journal.put("bay-1", ("decision", {}))
    journal._write(all_of_it=False)
    assert len(read(tmp_path, "snapshots")) == 13, "what led to it is written with it"


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
    file = RotatingFile(tmp_path, "some", 1_000_000, begin)
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
    with writing(tmp_path, 100.0) as journal:
        for number in range(BACKLOG[False] + 5):
            journal.put("bay-1", ("decision", {"n": number}))
            if number % 5000 == 0:
                wait_until(lambda: not any(journal._waiting.values()), what="the writer")
        wait_until(lambda: journal.lost == 5, what="the count")
        (tmp_path / "events.jsonl").unlink()
        wait_until(lambda: not problem(journal), what="the end of the problem")
    assert read(tmp_path)[-1]["n"] == BACKLOG[False] + 4


def test_nobody_waits_for_a_disk_that_hangs(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "events.jsonl")  # opening it for writing hangs until it has a reader
    with writing(tmp_path) as journal:
        journal.put("bay-1", ("decision", {"n": 0}))
        wait_until(lambda: not any(journal._waiting.values()), what="the writer")
        began_s = time.monotonic()
        for number in range(BACKLOG[False] + 7):
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
    for number in range(BACKLOG[True] + 3):
        journal.put("bay-1", ("snapshot", {"n": number}))
    journal._write()
    lines = every(tmp_path, "snapshots")
    assert [line["kind"] for line in lines[:4]] == ["run", "snapshot", "lost", "snapshot"]
    assert (lines[2]["lines"], lines[3]["n"]) == (3, 3)


def test_times_are_utc_to_the_millisecond() -> None:
    assert utc(0.0) == "1970-01-01T00:00:00.000Z"
    assert utc(1_795_395_996.25) == "2026-11-23T01:06:36.250Z"
