"""The first moments of a service: chargers are stopped first, and nothing that can wait delays that."""

import os
import select
import tty
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import pytest

from orchestrator.lastresort.guardian import ACTED
from orchestrator.protocol.charger import STOP_FRAME
from tests.guardian import briefly
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


def of_one_bay(directory: Path) -> tuple[Service, dict[str, str]]:
    """A service, and its environment: modules in `directory/first` come before all others."""
    (directory / "first").mkdir()
    path = f"{directory / 'first'}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    return Service(directory, station_document(directory, [{"interface": "virtual"}], 1)), {"PYTHONPATH": path}


def read_until(master: int, frame: bytes, within_s: float = 20.0) -> None:
    heard = b""
    while frame not in heard:
        assert select.select([master], [], [], within_s)[0], f"no {frame.hex(' ')}, but {heard.hex(' ')}"
        heard += os.read(master, 4096)


def is_part_of(name: str, packages: tuple[str, ...]) -> bool:
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def test_the_ports_wait_for_no_import_that_they_do_not_need(tmp_path: Path) -> None:
    service, env = of_one_bay(tmp_path)
    (tmp_path / "first" / "sitecustomize.py").write_text(SPY, encoding="utf-8")
    spied = {"SPY_LOG": str(tmp_path / "imports"), "SPY_PORT": str(tmp_path / "bay-1")}
    with silent_port(tmp_path / "bay-1") as master, closing(service):
        service.start(env={**env, **spied})
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


#: What a broken library does when it is imported, and what the status says about it.
BROKEN = {
    "fails": ("raise ImportError('it is broken')", "it is broken"),
    "hangs": ("import threading; threading.Event().wait()", ""),
}
LIBRARIES = [(library, how) for library in ("can", "canopen") for how in BROKEN]


@pytest.fixture(scope="module")
def with_broken_libraries(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Mapping[tuple[str, str], tuple[Service, int]]]:
    """A service and the other end of its silent port for each: all wait for their chargers at the same time."""
    with ExitStack() as stack:
        services = {}
        for library, how in LIBRARIES:
            directory = tmp_path_factory.mktemp("broken")
            service, env = of_one_bay(directory)
            (directory / "first" / f"{library}.py").write_text(BROKEN[how][0], encoding="utf-8")
            master = stack.enter_context(silent_port(directory / "bay-1"))
            services[library, how] = stack.enter_context(closing(service)).start(env=env), master
        yield services


@pytest.mark.parametrize(("library", "how"), LIBRARIES)
def test_a_can_library_that_cannot_be_imported_hurts_no_port(
    with_broken_libraries: Mapping[tuple[str, str], tuple[Service, int]], library: str, how: str
) -> None:
    service, master = with_broken_libraries[library, how]
    service.wait(("OFFLINE", "UNCONTROLLABLE"))  # it is decided what to do about a charger that is silent
    problem = BROKEN[how][1]
    wait_until(lambda: problem in str(service.bay()["battery"]), what=problem)
    drain(master)
    for frame in (STOP_FRAME, POLL, STOP_FRAME, POLL):
        read_until(master, frame)
    assert not service.bay()["battery"]["online"]


def drain(master: int) -> None:
    """What was written before does not count."""
    while select.select([master], [], [], 0)[0]:
        os.read(master, 4096)


def test_a_start_that_fails_later_has_stopped_the_chargers(tmp_path: Path) -> None:
    service, _ = of_one_bay(tmp_path)
    service.edit(lambda document: document["control"].update(socket="/proc/nowhere/socket"))
    with silent_port(tmp_path / "bay-1") as master:
        ended = orchestrator("run", str(service.file), program=briefly.GUARDIAN)
        read_until(master, STOP_FRAME)
    assert ended.returncode == ACTED
    assert "orchestrator: the control socket /proc/nowhere/socket cannot be opened" in ended.stderr
    assert "guardian: the controller has ended with status 1: stopping the chargers on 1 ports" in ended.stderr
