"""Who holds a port, where the kernel's lists do not say it plainly; and services that hold one and cannot be told."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from orchestrator.lastresort import running_service
from orchestrator.lastresort.port_owner import CONTROLLER, UNKNOWN, control_sockets, controller_on, holder
from orchestrator.lastresort.running_service import UNTOLD, Services
from tests.guardian.services import answering, bay
from tests.link.ptys import plugged

#: Locks the port and ends; its child goes on with the open file.
LEAVES_IT = """
import fcntl, os, sys
fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
fcntl.flock(fd, fcntl.LOCK_EX)
reader, writer = os.pipe()
if os.fork():
    os._exit(0)
os.close(reader)
print(os.getpid(), flush=True)
sys.stdin.read()
"""
LOCKS = """
import fcntl, os, sys
fd = os.open(sys.argv[-1], os.O_RDWR | os.O_NOCTTY)
fcntl.flock(fd, fcntl.LOCK_EX)
print(os.getpid(), flush=True)
sys.stdin.read()
"""
HOLDS = """
import os, sys
fd = os.open(sys.argv[-1], os.O_RDWR | os.O_NOCTTY)
print(os.getpid(), flush=True)
sys.stdin.read()
"""


@contextmanager
def program(code: str, *words: str) -> Iterator[int]:
    """The process that says its number."""
    argv = ["python", "-c", code, *words]
    with subprocess.Popen(argv, executable=sys.executable, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        try:
            yield int(process.stdout.readline())
        finally:
            process.stdin.close()


def test_a_lock_that_was_left_to_another_process_is_that_ones(tmp_path: Path) -> None:
    """The kernel's list of locks names the process that has ended."""
    with plugged(tmp_path / "port") as pty, program(LEAVES_IT, pty.path) as heir:
        assert holder(pty.path, (os.getpid(),)).pid == heir


@pytest.mark.parametrize(
    ("words", "service"),
    [(("-m", CONTROLLER), True), (("-m", "orchestrator", "estop"), False), (("-m", "orchestrator", "run"), False)],
)
def test_only_a_controller_keeps_its_port(tmp_path: Path, words: tuple[str, ...], *, service: bool) -> None:
    """An emergency stop, or the last stop of a guardian, lets go of it soon."""
    with plugged(tmp_path / "port") as pty, program(LOCKS, *words, pty.path) as pid:
        assert holder(pty.path, (os.getpid(),)).ours
        assert controller_on(pty.path) == (pid if service else 0)


def test_a_port_that_is_gone_has_no_holder(tmp_path: Path) -> None:
    assert str(holder(str(tmp_path / "none"))) == "an unknown program"


@pytest.mark.parametrize("port", ["/dev/none", "a\0b", "\ud800"])
def test_a_name_of_nothing_leads_to_no_service(port: str) -> None:
    assert control_sockets([port]) == []


def test_without_the_kernels_lists_nobody_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where /proc is not mounted."""

    def missing(path: str, *_: Any, **__: Any) -> Any:
        raise FileNotFoundError(path)

    with plugged(tmp_path / "port") as pty:
        assert holder(pty.path).name == "this program", "the test itself, so far"
        monkeypatch.setattr(os, "listdir", missing)
        monkeypatch.setattr("builtins.open", missing)
        unknown = holder(pty.path)
        monkeypatch.undo()
    assert unknown is UNKNOWN


def test_a_service_whose_socket_is_not_seen_is_not_the_one_that_answers(tmp_path: Path) -> None:
    """In a container of its own, say. Another service has taken the stop; the one that holds the port has not."""
    path = tmp_path / "s"
    with (
        plugged(tmp_path / "port") as pty,
        program(HOLDS, "-m", CONTROLLER, pty.path) as pid,
        answering(path, {"bays": [bay("/dev/another", {}, {})]}),
    ):
        services = Services([pty.path], str(path), every_bay=True)
        services.start()
        services.wait(time.monotonic() + 5.0)
        unseen = f"a service that holds a port (pid {pid}) was not told: its control socket is not to be found"
        assert services.said == [f"{unseen}; {path}: the service holds bay-1 until an operator starts it"]
        assert services.untold


def test_who_looks_for_services_for_too_long_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    found = Event()

    def looks(_: object) -> tuple[list[str], list[int]]:
        found.wait(30)
        return [], []

    monkeypatch.setattr(running_service, "services", looks)
    services = Services(["/dev/x"], "", every_bay=False)
    services.start()
    services.wait(time.monotonic() + 0.05)
    assert (services.said, services.untold) == ([UNTOLD], True)
    found.set()
    services.wait(time.monotonic() + 5.0)
    assert (services.said, services.untold) == (["no service is running"], False)
