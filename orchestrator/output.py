"""What a verb prints: that it was taken, all of it, and what is said if it was not."""

import errno
import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout


@contextmanager
def delivered() -> Iterator[None]:
    """Have our output taken before this ends: that the disk is full is noticed while there is somebody to tell."""
    try:
        yield
    finally:
        sys.stdout.flush()


@contextmanager
def gathered() -> Iterator[None]:
    """Print at the end what is printed meanwhile: argparse is silent about an output that takes nothing."""
    said = io.StringIO()
    try:
        with redirect_stdout(said):
            yield
    finally:
        sys.stdout.write(said.getvalue())


def problem(error: OSError) -> str:
    """What the system says of a file; one without a name is our output."""
    from orchestrator.model import Cause
    from orchestrator.show import own_language
    from orchestrator.text.catalogue import say

    if error.filename:
        return f"{error.filename}: {error.strerror or error}"
    return say(Cause.of("output_failed", error=errno.errorcode.get(error.errno or 0, str(error))), own_language())
