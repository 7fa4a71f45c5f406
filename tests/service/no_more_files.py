"""A control socket in a process that can open no more files: `python -m tests.service.no_more_files DIRECTORY`.

accept() fails at once; when there is room again, every client that came meanwhile is answered.
"""

import os
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from orchestrator.service.control import RETRY_S, ControlSocket
from tests.service.control_bench import answer, client, reply


@contextmanager
def taken_files() -> Iterator[None]:
    """No more files can be opened in the whole process."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    files: list[int] = []
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(soft, 256), hard))
        with suppress(OSError):
            while True:
                files.append(os.dup(0))
        yield
    finally:
        for file in files:
            os.close(file)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def main(directory: Path) -> None:
    """Raise if a client is answered while no file can be opened, or is not afterwards."""
    control = ControlSocket(directory / "control.sock", answer, time.monotonic)
    with client(directory / "control.sock") as early, taken_files():
        control.start()
        early.sendall(b'{"verb": "status"}\n')
        early.settimeout(3 * RETRY_S)
        with suppress(TimeoutError):
            raise SystemExit(f"answered: {early.recv(1)!r}")
        if control.stalled(time.monotonic()):
            raise SystemExit("it is called stalled")
    with client(directory / "control.sock") as late:
        late.sendall(b'{"verb": "status"}\n')
        if reply(late)["ok"] is not True:
            raise SystemExit("not answered when there was room again")
    control.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
