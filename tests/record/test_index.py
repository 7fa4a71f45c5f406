"""The index follows the files: brought up to date or built anew, its tables are the same."""

import gzip
import json
import os
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import Random
from typing import Any

import pytest

from orchestrator.model import Cause
from orchestrator.record import index, monthfile, tables
from orchestrator.record.charges import Charges
from orchestrator.record.lines import Record, encoded
from tests.record.made import begin, checkpoint, end, id_of

NOVEMBER, DECEMBER = "2026-11.jsonl", "2026-12.jsonl"


class Folder:
    """The files of records, and what was said of their index."""

    def __init__(self, path: Path) -> None:
        self.path, self.said = path / "sessions", list[str]()
        self.path.mkdir()

    def add(self, name: str, *records: Record | bytes) -> None:
        with (self.path / name).open("ab") as file:
            file.writelines(one if isinstance(one, bytes) else encoded(one) for one in records)

    def charges(self) -> Charges:
        return Charges(self.path, self.say)

    def say(self, cause: Cause) -> None:
        self.said.append(cause.id)

    def listed(self) -> list[tuple[str, str, float]]:
        return [(one["id"], one["type"], one["charger"]["ah"]) for one in self.charges().listed()]

    def dump(self) -> str:
        db = sqlite3.connect(self.path / index.NAME)
        text = "\n".join(db.iterdump())
        db.close()
        return text

    def rebuilt(self) -> str:
        index.rebuilt(self.path, self.say)
        return self.dump()

    def pack(self, name: str) -> None:
        plain = self.path / name
        (self.path / f"{name}.gz").write_bytes(gzip.compress(plain.read_bytes()))
        plain.unlink()


@pytest.fixture(name="folder")
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Folder:
    monkeypatch.setattr(index, "SYNCHRONOUS", "OFF")  # no power goes here
    monkeypatch.setattr(os, "fsync", lambda _: None)
    return Folder(tmp_path)


def test_a_charge_is_followed_from_its_begin_to_its_end(folder: Folder) -> None:
    folder.add(NOVEMBER, begin(1))
    assert folder.listed() == [(id_of(1), "checkpoint", 0.0)]
    folder.add(NOVEMBER, checkpoint(1, 1, ah=2.0), checkpoint(1, 2, ah=4.0))
    assert folder.listed() == [(id_of(1), "checkpoint", 4.0)]
    assert next(folder.charges().listed())["lasted_s"] == 1200.0
    folder.add(NOVEMBER, begin(2), end(1, 3, ah=5.0))
    assert folder.listed() == [(id_of(2), "checkpoint", 0.0), (id_of(1), "end", 5.0)]
    assert folder.said == []


def test_a_list_does_not_read_what_it_has_read(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.add(NOVEMBER, begin(1), end(1, 1))
    folder.charges()
    read, real = list[Path](), tables.update

    def update(db: sqlite3.Connection, path: Path) -> None:
        read.append(path)
        real(db, path)

    monkeypatch.setattr(index, "update", update)
    folder.charges()
    assert read == []
    folder.add(NOVEMBER, begin(2))
    folder.charges()
    assert read == [folder.path]


def test_an_end_wins_whatever_comes_after_it(folder: Folder) -> None:
    folder.add(DECEMBER, begin(1), end(1, 2, ah=9.0))
    folder.charges()
    folder.add(NOVEMBER, checkpoint(1, 1, ah=3.0), begin(1))  # the clock went back
    assert folder.listed() == [(id_of(1), "end", 9.0)]
    assert folder.dump() == folder.rebuilt()


def test_a_torn_line_and_a_damaged_record_are_passed_over(folder: Folder) -> None:
    folder.add(NOVEMBER, begin(1), encoded(end(1, 1))[:300])
    assert folder.listed() == [(id_of(1), "checkpoint", 0.0)]
    bad: dict[str, Any] = {**end(2, 0), "charger": 7}
    folder.add(NOVEMBER, b"\n", bad, end(1, 1, ah=1.0), b"\xff\n", b"[]\n")
    assert folder.listed() == [(id_of(1), "end", 1.0)]
    assert folder.dump() == folder.rebuilt()


def test_a_month_that_is_packed_is_not_read_again(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.add(NOVEMBER, begin(1), end(1, 1, ah=1.0), begin(2))
    folder.charges()
    folder.pack(NOVEMBER)
    with monkeypatch.context() as patched:
        patched.setattr(index, "_rebuild", lambda *_: pytest.fail("it was built anew"))
        assert len(folder.listed()) == 2
    assert [one["charger"]["ah"] for one in folder.charges().whole([id_of(1), id_of(2)])] == [1.0, 0.0]
    assert folder.dump() == folder.rebuilt()


def test_a_month_that_is_seen_while_it_is_packed_is_there_once(folder: Folder) -> None:
    folder.add(NOVEMBER, begin(1), end(1, 1, ah=1.0))
    folder.charges()
    data = (folder.path / NOVEMBER).read_bytes()
    folder.pack(NOVEMBER)
    (folder.path / NOVEMBER).write_bytes(data)
    assert folder.listed() == [(id_of(1), "end", 1.0)]
    (folder.path / NOVEMBER).unlink()
    assert folder.listed() == [(id_of(1), "end", 1.0)]
    assert folder.said == []
    assert folder.dump() == folder.rebuilt()


@pytest.mark.parametrize("order", [(NOVEMBER, DECEMBER), (DECEMBER, NOVEMBER)])
@pytest.mark.parametrize("record", [begin(1), end(1, 1, ah=2.0)], ids=["begin", "end"])
def test_the_same_record_in_two_files_is_one(folder: Folder, order: Sequence[str], record: Record) -> None:
    for name in order:
        folder.add(name, record)
        assert len(folder.listed()) == 1
    assert folder.dump() == folder.rebuilt()


def test_a_line_is_read_once_it_is_whole(folder: Folder) -> None:
    line = encoded(end(1, 1, ah=2.0))
    for part in (line[:200], line[200:-1], b"\n"):
        assert folder.listed() == []
        folder.add(NOVEMBER, part)
    assert folder.listed() == [(id_of(1), "end", 2.0)]


@pytest.mark.parametrize(
    "damage",
    [lambda _: b"", lambda _: b"no gzip", lambda data: data[:-30], lambda data: data[:-8] + bytes(8)],
    ids=["empty", "no gzip", "torn", "changed"],
)
def test_a_damaged_packed_month_costs_only_what_is_damaged(folder: Folder, damage: Callable[[bytes], bytes]) -> None:
    folder.add(NOVEMBER, *(end(number, 1) for number in range(40)))
    folder.pack(NOVEMBER)
    folder.add(DECEMBER, end(41, 1))
    path = folder.path / f"{NOVEMBER}.gz"
    path.write_bytes(damage(path.read_bytes()))
    assert folder.listed()[0] == (id_of(41), "end", 0.0)
    assert next(folder.charges().whole([id_of(41), id_of(0)]))["id"] == id_of(41)
    assert folder.said == ["records_damaged"] * 2, "each time, not only when it is read"
    assert folder.dump() == folder.rebuilt()


def test_a_packed_month_is_read_up_to_its_damage(folder: Folder) -> None:
    folder.add(NOVEMBER, *(end(number, 1) for number in range(400)))
    folder.pack(NOVEMBER)
    path = folder.path / f"{NOVEMBER}.gz"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert 150 < len(folder.listed()) < 250
    assert folder.said == ["records_damaged"]


def test_a_line_that_is_too_long_does_not_fill_the_memory(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(monthfile, "LONGEST", 10_000)
    folder.add(NOVEMBER, end(1, 1), b"\0" * 35_000)
    with (folder.path / NOVEMBER).open("rb") as file:
        assert max(map(len, monthfile.lines(file))) == 10_000
    assert len(folder.listed()) == 1
    folder.add(NOVEMBER, b"\0" * 7_000 + b"\n", end(2, 1))
    assert len(folder.listed()) == 2
    assert folder.dump() == folder.rebuilt()


def test_what_is_no_file_is_no_month(folder: Folder) -> None:
    folder.add(NOVEMBER, end(1, 1))
    (folder.path / DECEMBER).symlink_to("/dev/zero")
    (folder.path / "2026-10.jsonl").mkdir()
    assert len(folder.listed()) == 1


def test_a_month_that_is_gone_takes_its_charges_with_it(folder: Folder) -> None:
    folder.add(NOVEMBER, begin(1), end(1, 1), begin(2))
    folder.add(DECEMBER, checkpoint(2, 1, ah=4.0), begin(3))
    assert len(folder.listed()) == 3
    (folder.path / NOVEMBER).unlink()
    assert folder.listed() == [(id_of(3), "checkpoint", 0.0)]
    assert folder.said == []


def test_a_file_that_is_another_one_is_read_anew(folder: Folder) -> None:
    folder.add(NOVEMBER, begin(1), end(1, 1, ah=1.0))
    folder.charges()
    (folder.path / NOVEMBER).unlink()
    folder.add(NOVEMBER, begin(2), end(2, 1, ah=2.0), begin(3))
    assert [one[0] for one in folder.listed()] == [id_of(3), id_of(2)]


def lives(seed: int) -> Iterator[tuple[str, Sequence[Record | bytes]]]:
    """Records as a service with a bad clock may write them, a few at a time."""
    dice, open_, count = Random(seed), dict[int, int](), 0
    for _ in range(60):
        now = list[Record | bytes]()
        for _ in range(dice.randint(1, 4)):
            what = dice.choice(("begin", "checkpoint", "checkpoint", "end", "torn", "twice"))
            if what == "begin" or not open_:
                count += 1
                open_[count] = 1
                now.append(begin(count))
                continue
            number = dice.choice(list(open_))
            record = (end if what == "end" else checkpoint)(number, open_[number], ah=float(open_[number]))
            now += (
                [record, record] if what == "twice" else [encoded(record)[:-40] + b"\n" if what == "torn" else record]
            )
            open_[number] += 1
            if what == "end":
                del open_[number]
        yield dice.choice((NOVEMBER, DECEMBER, DECEMBER, "2027-01.jsonl")), now


@pytest.mark.parametrize("seed", range(3))
def test_brought_up_to_date_it_is_what_a_new_one_is(folder: Folder, seed: int) -> None:
    dice = Random(seed)
    for number, (name, records) in enumerate(lives(seed)):
        if name == NOVEMBER and number > 40:
            name = DECEMBER
        folder.add(name, *records)
        if number == 40:
            folder.add(NOVEMBER, begin(999))
            folder.charges()
            folder.pack(NOVEMBER)
        if dice.random() < 0.5:
            folder.charges()
    folder.charges()
    assert folder.dump().count('INSERT INTO "charges"') > 10
    assert folder.dump() == folder.rebuilt()


def test_a_damaged_index_is_moved_away_and_built_again(folder: Folder) -> None:
    folder.add(NOVEMBER, *(record for number in range(50) for record in (begin(number), end(number, 1))))
    folder.charges()
    path = folder.path / index.NAME
    data = bytearray(path.read_bytes())
    data[5000:9000] = bytes(4000)
    path.write_bytes(data)
    assert len(folder.listed()) == 50
    assert folder.said == ["index_damaged"]
    assert (folder.path / index.DAMAGED).read_bytes() == data
    path.write_bytes(b"no database at all")
    assert len(folder.listed()) == 50
    assert folder.said == ["index_damaged"] * 2


def test_an_index_that_is_a_fifo_keeps_nobody_waiting(folder: Folder) -> None:
    folder.add(NOVEMBER, end(1, 1))
    os.mkfifo(folder.path / index.NAME)
    assert len(folder.listed()) == 1
    assert (folder.path / index.NAME).is_file()


def test_an_index_of_another_version_is_built_anew(folder: Folder) -> None:
    folder.add(NOVEMBER, begin(1))
    folder.charges()
    with sqlite3.connect(folder.path / index.NAME) as db:
        db.execute("PRAGMA user_version = 99")
    assert len(folder.listed()) == 1
    assert folder.said == []


def test_who_may_not_write_there_reads_all_the_same(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may
    folder.add(NOVEMBER, begin(1))
    assert len(folder.listed()) == 1
    assert folder.said == ["index_not_written"]
    assert not (folder.path / index.NAME).exists()
    index.rebuilt(folder.path, folder.say)
    folder.add(NOVEMBER, end(1, 1, ah=3.0))
    before = folder.dump()
    assert folder.listed() == [(id_of(1), "end", 3.0)]
    assert folder.dump() == before
    assert folder.said == ["index_not_written"]


def test_an_index_that_root_builds_is_the_services_own(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    given = list[tuple[str, int, int]]()
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(os, "chown", lambda path, user, group: given.append((path.name, user, group)))
    folder.add(NOVEMBER, begin(1))
    folder.charges()
    owner = folder.path.stat()
    assert given == [(index.NEW, owner.st_uid, owner.st_gid)]


def test_while_another_one_writes_what_is_there_is_read(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(index, "PAUSE_S", 0.0)
    folder.add(NOVEMBER, begin(1))
    folder.charges()
    with index._locked(folder.path):
        folder.add(NOVEMBER, end(1, 1, ah=3.0))
        assert folder.listed() == [(id_of(1), "end", 3.0)]
        with pytest.raises(index.BusyError):
            index.rebuilt(folder.path, folder.say)
        assert folder.said == []
        (folder.path / index.NAME).unlink()
        assert len(folder.listed()) == 1
        assert folder.said == ["index_not_written"]


def test_a_list_that_is_still_read_keeps_nobody_from_the_newest(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(index, "PAUSE_S", 0.0)
    monkeypatch.setattr(index, "_rebuild", lambda *_: pytest.fail("it was built anew"))
    index._built(str(folder.path / index.NAME), folder.path).close()
    folder.add(NOVEMBER, *(end(number, 1) for number in range(300)))
    reading = folder.charges().listed()
    next(reading)
    folder.add(NOVEMBER, end(300, 1))
    assert len(folder.listed()) == 301
    assert len(list(reading)) == 299
    assert folder.said == []


def test_an_index_without_its_tables_is_damaged(folder: Folder) -> None:
    folder.add(NOVEMBER, begin(1))
    folder.charges()
    with sqlite3.connect(folder.path / index.NAME) as db:
        db.execute("DROP TABLE files")
    assert len(folder.listed()) == 1
    assert folder.said == ["index_damaged"]


def test_a_disk_that_is_full_costs_the_index_and_not_the_answer(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    folder.add(NOVEMBER, begin(1))
    monkeypatch.setattr(index, "_rebuild", full)
    assert len(folder.listed()) == 1
    assert folder.said == ["index_not_written"]


def test_whole_records_are_those_of_the_files(folder: Folder) -> None:
    records = [end(number, 1, ah=float(number)) for number in range(1, 4)]
    folder.add(NOVEMBER, *records)
    assert list(folder.charges().whole([id_of(3), id_of(1)])) == [json.loads(encoded(records[at])) for at in (2, 0)]


def test_the_service_never_loads_sqlite() -> None:
    loads = (
        "import sys, orchestrator.service.supervisor, orchestrator.lastresort.guardian; print('sqlite3' in sys.modules)"
    )
    alone = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE")}  # which loads it
    result = subprocess.run([sys.executable, "-c", loads], capture_output=True, text=True, check=True, env=alone)
    assert result.stdout == "False\n"


def test_nobody_is_told_of_a_folder_that_is_not_there(tmp_path: Path) -> None:
    said = list[Cause]()
    assert list(Charges(tmp_path / "sessions", said.append).listed()) == []
    assert said == []
    assert not list(tmp_path.iterdir())


def test_whoever_may_not_write_beside_the_files_keeps_an_index_elsewhere(folder: Folder, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    folder.add(NOVEMBER, end(1, 1))
    for number in (2, 3):
        folder.add(NOVEMBER, end(number, 1))
        assert len(list(Charges(folder.path, folder.say, home).listed())) == number
    assert (home / index.NAME).exists()
    assert not (folder.path / index.NAME).exists()
    assert folder.said == []
