"""The index of the records: SQLite beside the files, made from them and brought up to date by whoever asks.

Theory of operation. The files are the truth; the index can be removed at any time. One asker writes at a time, under a
lock on the directory. An asker that does not get the lock soon, or may not write there, uses a copy in memory, brought
up to date in the same way; one that may never write there has an index of its own, in a `home`. A new index is built
under another name and replaces the old one when it is whole. Nothing that decides lives in it.
"""

import errno
import fcntl
import os
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from orchestrator.model import Cause
from orchestrator.record.tables import SCHEMA, VERSION, AnotherFileError, changed, damaged, update

#: Its file, in the folder of the records; one that is being built; one that was damaged.
NAME, NEW, DAMAGED = "index.sqlite3", "index.sqlite3.new", "index.sqlite3.damaged"
#: How often, and after which pause, another asker is waited for.
TRIES, PAUSE_S = 20, 0.1
#: A month may be packed while we look.
AGAIN = 3
#: Of what is written to the index on disk.
SYNCHRONOUS = "FULL"

Say = Callable[[Cause], None]


class BusyError(Exception):
    """Another asker is writing."""


class UselessError(Exception):
    """There is no index, or one of another version, or a damaged one."""


def opened(folder: Path, say: Say, home: Path | None = None) -> sqlite3.Connection:
    """The index as of now, to be read only: the one on disk, or in memory. OSError if the files cannot be read.

    It is beside the files, or in `home`. `say` is told each time which files are damaged: what is asked of the index
    has not all of it.
    """
    if not folder.is_dir():
        return _built(":memory:", None)
    for _ in range(AGAIN):
        with suppress(FileNotFoundError):
            return _told(_opened(folder, home or folder, say), folder, say)
    return _told(_opened(folder, home or folder, say), folder, say)


def _told(db: sqlite3.Connection, folder: Path, say: Say) -> sqlite3.Connection:
    for name in damaged(db):
        say(Cause.of("records_damaged", file=str(folder / name)))
    return db


def _opened(folder: Path, home: Path, say: Say) -> sqlite3.Connection:
    why: object = os.strerror(errno.EACCES)
    if os.access(home, os.W_OK):
        try:
            with _locked(home):
                _refresh(folder, home, say)
            return _connected(home / NAME, "ro")
        except BusyError:
            why = Cause("index_being_built")
        except FileNotFoundError:
            raise
        except (OSError, sqlite3.Error) as error:
            why = str(error)
    try:
        db = _connected(home / NAME, "ro")
        _check(db)
    except (UselessError, sqlite3.Error):
        built = _built(":memory:", folder)
        say(Cause.of("index_not_written", folder=str(home), error=why))
        return built
    return _current(db, folder)


def rebuilt(folder: Path, say: Say) -> int:
    """Build the index anew, whatever is there; the number of charges in it. BusyError, OSError or sqlite3.Error."""
    with _locked(folder):
        _rebuild(folder, folder)
    with closing(_told(_connected(folder / NAME, "ro"), folder, say)) as db:
        return int(db.execute("SELECT count(*) FROM charges").fetchone()[0])


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """As the only writer; BusyError if another one goes on for long."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        for _ in range(TRIES):
            with suppress(BlockingIOError):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            time.sleep(PAUSE_S)
        else:
            raise BusyError
        yield
    finally:
        os.close(descriptor)


def _refresh(folder: Path, home: Path, say: Say) -> None:
    """Bring the index on disk up to date; build it if it is not there, or not of use."""
    path = home / NAME
    try:
        with closing(_connected(path, "rw")) as db:
            _check(db)
            if changed(db, folder):
                _update(db, folder)
            return
    except (AnotherFileError, UselessError):
        pass
    except sqlite3.DatabaseError as error:
        if _is_damage(error):
            path.replace(home / DAMAGED)
            say(Cause.of("index_damaged", file=str(home / DAMAGED), error=str(error)))
        elif path.exists():
            raise
    _rebuild(folder, home)


def _is_damage(error: sqlite3.DatabaseError) -> bool:
    """Whether the index itself is the trouble, and not the disk or a reader; a table that is missing is damage, too."""
    return not isinstance(error, sqlite3.OperationalError) or error.sqlite_errorcode == sqlite3.SQLITE_ERROR


def _rebuild(folder: Path, home: Path) -> None:
    new, path = home / NEW, home / NAME
    new.unlink(missing_ok=True)
    try:
        _built(str(new), folder).close()
        with new.open("rb+") as file:
            os.fsync(file.fileno())
        if os.geteuid() == 0:  # the next asker may be the service's own user
            owner = home.stat()
            os.chown(new, owner.st_uid, owner.st_gid)
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)
    descriptor = os.open(home, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _built(name: str, folder: Path | None) -> sqlite3.Connection:
    """A new index of these files; without a folder an empty one."""
    db = sqlite3.connect(name, isolation_level=None)
    try:
        db.execute("PRAGMA journal_mode = OFF")  # what is not whole is not kept
        db.execute("PRAGMA synchronous = OFF")  # … and it is synced before it is used
        db.executescript(SCHEMA)
        if folder is not None:
            _update(db, folder)
    except BaseException:
        db.close()
        raise
    return db


def _current(db: sqlite3.Connection, folder: Path) -> sqlite3.Connection:
    """The same if it is up to date, else a copy in memory that is."""
    try:
        if not changed(db, folder):
            return db
        copy = sqlite3.connect(":memory:", isolation_level=None)
        with closing(db):
            db.backup(copy)
        _update(copy, folder)
    except AnotherFileError:
        return _built(":memory:", folder)
    return copy


def _update(db: sqlite3.Connection, folder: Path) -> None:
    db.execute("BEGIN IMMEDIATE")
    update(db, folder)
    db.execute("COMMIT")


def _connected(path: Path, mode: str) -> sqlite3.Connection:
    if path.is_fifo():  # which nobody could open without waiting
        raise UselessError
    uri = f"{path.absolute().as_uri()}?mode={mode}"
    db = sqlite3.connect(uri, uri=True, isolation_level=None, timeout=TRIES * PAUSE_S)
    try:
        db.execute(f"PRAGMA synchronous = {SYNCHRONOUS}")  # journal_mode is DELETE, as it is if nobody says otherwise
    except sqlite3.Error:
        db.close()
        raise
    return db


def _check(db: sqlite3.Connection) -> None:
    """UselessError if it is of another version, sqlite3.DatabaseError if it is damaged."""
    found = db.execute("PRAGMA quick_check(1)").fetchone()[0]
    if found != "ok":
        error = sqlite3.DatabaseError(found)
        error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
        raise error
    if db.execute("PRAGMA user_version").fetchone()[0] != VERSION:
        raise UselessError
