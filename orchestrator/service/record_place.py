"""Where the records are that a verb reads, and what is said of their index."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from orchestrator.config.ports import wiring
from orchestrator.errors import CauseError, UsageError
from orchestrator.model import Cause
from orchestrator.record.charges import Charges
from orchestrator.record.months import FOLDER
from orchestrator.service.journal_place import INSTALLED
from orchestrator.service.where import HERE
from orchestrator.show import own_language
from orchestrator.text.catalogue import say


def journal_of(verb: str, named: str | None) -> Path:
    """The journal's directory: the one named, that of the station file here, or of the installed service."""
    if named is not None:
        if not Path(named).is_dir():
            raise UsageError(f"{verb}: --journal {named}: there is no such directory")
        return Path(named)
    try:
        if written := wiring(HERE).journal:
            return Path(written)
    except OSError:
        pass
    if INSTALLED.exists():
        return INSTALLED
    raise UsageError(
        f"{verb}: no {HERE} in this folder names a journal, and there is no {INSTALLED}; name its directory with "
        "--journal DIR"
    )


@contextmanager
def charges_of(journal: Path) -> Iterator[Charges]:
    """The charges on record there; CauseError where they cannot be read."""
    with readable(journal / FOLDER):
        yield Charges(journal / FOLDER, tell)


@contextmanager
def readable(folder: Path) -> Iterator[None]:
    """CauseError instead of OSError."""
    try:
        yield
    except OSError as error:
        if error.filename is None:  # our own output
            raise
        raise CauseError(Cause.of("charges_unreadable", folder=str(folder), error=str(error.strerror))) from None


def write_page(file: Path, page: str) -> None:
    """Write it, and say where."""
    try:
        file.write_text(page, encoding="utf-8")
    except OSError as error:
        raise CauseError(Cause.of("page_not_written", file=str(file), error=str(error.strerror))) from None
    sys.stdout.write(f"{file}\n")


def tell(cause: Cause) -> None:
    """Beside the answer."""
    sys.stderr.write(f"orchestrator: {say(cause, own_language())}\n")
