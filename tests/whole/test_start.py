"""The first moments of a service: chargers are stopped first, and nothing that can wait delays that."""

import os
import select
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from orchestrator.lastresort.guardian import ACTED
from orchestrator.protocol.charger import STOP_FRAME
from tests.waiting import wait_until
from tests.whole.station import Service, orchestrator, station_document

#: A status request, up to the kinds of values.
POLL = bytes.fromhex("AF FA 90 05 01 90")
#: Python runs this in each process before ours: it writes down every import, and when the charger's port is opened.
SPY = """
import os, sys

LOG = os.open(os.environ["SPY_LOG"] + "." + str(os.getpid()), os.O_WRONLY | os.O_CREAT | os.O_APPEND)

def spy(event, arguments):
    if event == "import":
        os.write(LOG, arguments[0].encode() + b"\\n")
    elif event == "open" and arguments[0] == os.environ["SPY_PORT"]:
        os.write(LOG, b"PORT OPENED\\n")

sys.addaudithook(spy)
"""
#: The ports need none of these. Python runs one thread at a time: importing them would hold the ports up.
NOT_BEFORE_THE_PORTS = (
    "can", "canopen", "transitions", "orchestrator.core", "orchestrator.devices.battery", "orchestrator.link.can",
    "orchestrator.link.gpio", "orchestrator.service.journal", "orchestrator.service.control",
    "orchestrator.service.store", "orchestrator.service.supervisor", "orchestrator.text",
)  # fmt: skip
#: The service needs none of these at all.
NEVER = (
    "argparse", "gpiod", "orchestrator.cli", "orchestrator.columns", "orchestrator.commissioning",
    "orchestrator.config.json_schema", "orchestrator.config.scenario", "orchestrator.config.scenario_rules",
    "orchestrator.demo", "orchestrator.protocol.explain", "orchestrator.show", "orchestrator.sim",
    "orchestrator.workbench", "rich", "statistics",
)  # fmt: skip


@contextmanager
def silent_port(path: Path) -> Iterator[int]:
    """A pty without a charger behind it, as a port with this name. Yields the other end."""
    master, slave = os.openpty()
    tty.setraw(slave)
    path.symlink_to(os.ttyname(slave))
    try:
        yield master
    finally:
        os.close(master)
        os.close(slave)


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    """Of one bay; modules in `tmp_path/first` come before all others."""
    (tmp_path / "first").mkdir()
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path / 'first'}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    made = Service(tmp_path, station_document(tmp_path, [{"interface": "virtual"}], 1))
    yield made
    made.close()


def read_until(master: int, frame: bytes, within_s: float = 20.0) -> None:
    heard = b""
    while frame not in heard:
        assert select.select([master], [], [], within_s)[0], f"no {frame.hex(' ')}, but {heard.hex(' ')}"
        heard += os.read(master, 4096)


def is_part_of(name: str, packages: tuple[str, ...]) -> bool:
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def test_the_ports_wait_for_no_import_that_they_do_not_need(
    service: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "first" / "sitecustomize.py").write_text(SPY, encoding="utf-8")
    monkeypatch.setenv("SPY_LOG", str(tmp_path / "imports"))
    monkeypatch.setenv("SPY_PORT", str(tmp_path / "bay-1"))
    with silent_port(tmp_path / "bay-1") as master:
        service.start()
        read_until(master, POLL)
        guardian, controller = (
            (tmp_path / f"imports.{pid}").read_text(encoding="utf-8").splitlines()
            for pid in (service.guardian, service.controller)
        )
    opened = controller.index("PORT OPENED")
    assert "orchestrator.link.serial" in controller[:opened]
    assert "orchestrator.service.supervisor" in controller[opened:]
    assert [name for name in controller[:opened] if is_part_of(name, NOT_BEFORE_THE_PORTS)] == []
    assert [name for name in (*guardian, *controller) if is_part_of(name, NEVER)] == []


@pytest.mark.parametrize("library", ["can", "canopen"])
@pytest.mark.parametrize(
    ("source", "problem"),
    [("raise ImportError('it is broken')", "it is broken"), ("import threading; threading.Event().wait()", "")],
    ids=["fails", "hangs"],
)
def test_a_can_library_that_cannot_be_imported_hurts_no_port(
    service: Service, tmp_path: Path, library: str, source: str, problem: str
) -> None:
    (tmp_path / "first" / f"{library}.py").write_text(source, encoding="utf-8")
    with silent_port(tmp_path / "bay-1") as master:
        service.start()
        service.wait(("OFFLINE", "UNCONTROLLABLE"))  # it is decided what to do about a charger that is silent
        wait_until(lambda: problem in str(service.bay()["battery"]), what=problem)
        for frame in (STOP_FRAME, POLL, STOP_FRAME, POLL):
            read_until(master, frame)
        assert not service.bay()["battery"]["online"]


def test_a_start_that_fails_later_has_stopped_the_chargers(service: Service, tmp_path: Path) -> None:
    service.edit(lambda document: document["control"].update(socket="/proc/nowhere/socket"))
    with silent_port(tmp_path / "bay-1") as master:
        ended = orchestrator("run", str(service.file))
        read_until(master, STOP_FRAME)
    assert ended.returncode == ACTED
    assert "orchestrator: the control socket /proc/nowhere/socket cannot be opened" in ended.stderr
    assert "guardian: the controller has ended with status 1: stopping the chargers on 1 ports" in ended.stderr
