"""The tables of the index, and how they follow the files. They depend on the files' lines alone, not on when they came.

`files` says how far each was read, `pieces` where the records of a charge are: its end or, while it is open, its begin
and the newest checkpoint. `charges` has a row for each charge.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from itertools import groupby
from pathlib import Path
from sqlite3 import Connection

from orchestrator.record.fold import Fold, Piece
from orchestrator.record.lines import BEGIN, CHECKPOINT, END, Record, decoded
from orchestrator.record.monthfile import DAMAGED, Known, Reader, is_continued, is_more, is_same, opened, present
from orchestrator.record.row import COLUMNS, TYPES, as_row

#: Of these tables; another one is built anew.
VERSION = 2
_CHARGES = ", ".join(f"{column} {TYPES[kind]}" for column, (kind, _) in COLUMNS.items())
SCHEMA = f"""
CREATE TABLE files (name TEXT PRIMARY KEY, read INTEGER, crc INTEGER, tail INTEGER, damaged INTEGER) WITHOUT ROWID;
CREATE TABLE pieces (id TEXT, type TEXT, n INTEGER, file TEXT, at INTEGER, length INTEGER, PRIMARY KEY (id, type))
WITHOUT ROWID;
CREATE TABLE charges ({_CHARGES}, PRIMARY KEY (id)) WITHOUT ROWID;
CREATE INDEX charges_of_battery ON charges (battery);
PRAGMA user_version = {VERSION};
"""
_INSERT = f"INSERT OR REPLACE INTO charges VALUES ({', '.join('?' * len(COLUMNS))})"  # noqa: S608 - question marks
#: The first of two that are the same wins; of the checkpoints the newest.
_PIECE = """
INSERT INTO pieces VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT (id, type) DO UPDATE
SET n = excluded.n, file = excluded.file, at = excluded.at, length = excluded.length
WHERE (-excluded.n, excluded.file, excluded.at) < (-n, file, at)
"""
#: Ends are written in such batches.
BATCH = 2000


class AnotherFileError(Exception):
    """What was read is gone or another file now: the tables are to be built anew."""


def changed(db: Connection, folder: Path) -> bool:
    """Whether the files have anything that the tables lack. AnotherFileError if the tables have what no file has."""
    known, there = _known(db), present(folder)
    for name, read in known.items():
        gone, packed = name not in there, f"{name}.gz"
        if gone and (packed not in there or packed in known or not is_same(read, folder / packed)):
            raise AnotherFileError
        if not gone and not is_continued(folder / name, read):
            raise AnotherFileError
    return any(name not in there for name in known) or any(is_more(folder / name, known.get(name)) for name in there)


def damaged(db: Connection) -> list[str]:
    """The files that are damaged: what is behind the damage is lost."""
    return [str(name) for (name,) in db.execute("SELECT name FROM files WHERE damaged ORDER BY name")]


def update(db: Connection, folder: Path) -> None:
    """Take in what the files have and the tables lack, in the caller's transaction."""
    there = present(folder)
    for name in _known(db):
        if name not in there:
            _packed(db, name)
    known, ends = _known(db), list[Piece]()

    def ended(piece: Piece) -> None:
        ends.append(piece)
        if len(ends) >= BATCH:
            _write_ends(db, ends)
            ends.clear()

    fold = Fold(ended)
    for name in there:
        if is_more(folder / name, known.get(name)):
            reader = Reader(folder / name, known.get(name))
            fold.take(reader, name, reader.at)
            row = (name, *reader.known, reader.is_damaged)
            db.execute("INSERT OR REPLACE INTO files VALUES (?, ?, ?, ?, ?)", row)
    _write_ends(db, ends)
    _write_open(db, folder, fold)


def _known(db: Connection) -> dict[str, Known]:
    return {name: Known(*rest) for name, *rest in db.execute("SELECT name, read, crc, tail FROM files")}


def _packed(db: Connection, name: str) -> None:
    """A month is over, and its file compressed."""
    size = 1 << 32
    db.execute("UPDATE files SET name = name || '.gz', read = read % ?, tail = 0 WHERE name = ?", (size, name))
    db.execute("UPDATE pieces SET file = file || '.gz' WHERE file = ?", (name,))


def _write_ends(db: Connection, ends: Sequence[Piece]) -> None:
    for piece in ends:
        id_, place = piece.record["id"], (piece.file, piece.at)
        was = db.execute("SELECT file, at FROM pieces WHERE id = ? AND type = ?", (id_, END)).fetchone()
        if was is not None and was <= place:
            continue
        db.execute("DELETE FROM pieces WHERE id = ?", (id_,))
        _write_piece(db, piece)
        _write_row(db, piece.record)


def _write_open(db: Connection, folder: Path, fold: Fold) -> None:
    for id_ in fold.open:
        if db.execute("SELECT 1 FROM pieces WHERE id = ? AND type = ?", (id_, END)).fetchone() is not None:
            continue
        for piece in filter(None, (fold.begins.get(id_), next(fold.checkpoints(id_), None))):
            _write_piece(db, piece)
        for record in records(db, folder, [id_]):
            _write_row(db, record)


def _write_piece(db: Connection, piece: Piece) -> None:
    record = piece.record
    db.execute(_PIECE, (record["id"], record["type"], record["n"], piece.file, piece.at, piece.length))


def _write_row(db: Connection, record: Record) -> None:
    """Its row; none for a damaged record."""
    try:
        db.execute(_INSERT, as_row(record))
    except ValueError:
        db.execute("DELETE FROM charges WHERE id = ?", (record["id"],))


def records(db: Connection, folder: Path, ids: Sequence[str]) -> Iterator[Record]:
    """The charges as the files have them, each in one record; one that is open as of its newest checkpoint."""
    marks = ", ".join("?" * len(ids))
    found = db.execute(f"SELECT file, at, length, id, type FROM pieces WHERE id IN ({marks}) ORDER BY file, at", ids)  # noqa: S608 - question marks
    lines: dict[tuple[str, str], Record] = {}
    for name, places in groupby(found.fetchall(), key=lambda row: str(row[0])):
        lines.update(_read(folder / name, [(at, length, (id_, type_)) for _, at, length, id_, type_ in places]))
    for id_ in ids:
        if (record := _whole(id_, lines)) is not None:
            yield record


def _read(path: Path, places: Sequence[tuple[int, int, tuple[str, str]]]) -> Iterator[tuple[tuple[str, str], Record]]:
    try:
        with closing(opened(path)) as file:
            for at, length, key in places:
                file.seek(at)
                if (record := decoded(file.read(length))) is not None and record["id"] == key[0]:
                    yield key, record
    except DAMAGED:
        return


def _whole(id_: str, lines: Mapping[tuple[str, str], Record]) -> Record | None:
    if (end := lines.get((id_, END))) is not None:
        return end
    begin = lines.get((id_, BEGIN))
    return None if begin is None else {**begin, **lines.get((id_, CHECKPOINT), begin), "type": CHECKPOINT}
