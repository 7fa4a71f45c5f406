"""`orchestrator estop` in an emergency: from anywhere, on any terminal, next to anything that hangs."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from orchestrator.errors import ServiceError
from orchestrator.lastresort import inhand, running_service
from orchestrator.lastresort.asking import ask
from orchestrator.lastresort.estop import LOST, UNTOLD
from orchestrator.lastresort.inhand import ports_in_hand, stations
from orchestrator.lastresort.running_service import NOBODY, Service
from tests.guardian import briefly
from tests.guardian.chargers import Bench, running_chargers
from tests.guardian.services import answering, bay
from tests.link.ptys import plugged
from tests.waiting import wait_until

DONE = "every charger stands by, verified\n"


def estop(*args: str, cwd: Path, stdout: int = subprocess.PIPE, **env: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, *briefly.ESTOP, "estop", *args], cwd=cwd,
        env={**os.environ, "ORCHESTRATOR_SOCKET": "", **env}, stdin=subprocess.DEVNULL, stdout=stdout,
        stderr=subprocess.PIPE, text=True, encoding="latin-1", timeout=30, check=False,
    )  # fmt: skip


def station_file(path: Path, *benches: Bench, more: str = "") -> Path:
    bays = "".join(f"  - {{name: bay-{n}, charger: {{port: {b.name}}}}}\n" for n, b in enumerate(benches, start=1))
    whole = "" if "journal:" in more else "journal: {directory: none}\n"
    path.write_text(f"bays:\n{bays}control: {{socket: none}}\n{whole}{more}")
    return path


# --- which station ---------------------------------------------------------------------------------------------------


def test_without_arguments_the_file_in_this_folder_counts(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        file = station_file(tmp_path / "station.yaml", bench)
        done = estop(cwd=tmp_path)
        assert (done.returncode, done.stdout) == (0, f"bay-1 ({bench.name}): standby verified\n{DONE}")
        assert done.stderr == f"station file: {file}\n{NOBODY}\n"


#: An emergency stop that sees only these processes: others on this machine may belong to other tests.
AMONG = """
import sys
from orchestrator.lastresort import estop, inhand
every, ours = inhand.orchestrators, {int(word) for word in sys.argv[1:]}
inhand.orchestrators = lambda: (one for one in every() if one[0] in ours)
sys.exit(estop.main([]))
"""


def test_else_those_of_the_services_that_run(tmp_path: Path) -> None:
    """Found by their command lines, relative to their own directories."""
    if Path(inhand.PLACES[1]).exists():
        pytest.skip("there is an installed one on this machine")
    with running_chargers(tmp_path, 2) as benches, ExitStack() as stack:
        files, services = [], []
        for number, bench in enumerate(benches):
            (tmp_path / str(number)).mkdir()
            files.append(station_file(tmp_path / str(number) / "depot.yaml", bench))
            services.append(stack.enter_context(running(files[-1])))
        argv = [sys.executable, "-c", AMONG, *(str(service.pid) for service in services)]
        (tmp_path / "here").mkdir()
        done = subprocess.run(argv, cwd=tmp_path / "here", capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout.count("standby verified")) == (0, 2)
        assert [f"station file: {file}" in done.stderr for file in files] == [True, True]
        assert not any(bench.runs for bench in benches)


@contextmanager
def running(file: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """A process that looks like a service, with this station file in its own directory."""
    service = subprocess.Popen(
        ["orchestrator", "-c", "print(flush=True); input()", "run", file.name], executable=sys.executable,
        cwd=file.parent, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert service.stdout is not None
    service.stdout.readline()
    try:
        yield service
    finally:
        service.communicate(b"\n")


def test_the_installed_one_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = tmp_path / "installed.yaml"
    installed.touch()
    monkeypatch.setattr(inhand, "PLACES", (str(tmp_path / "none"), str(installed)))
    none, first, *_ = stations()
    assert (none, first) == ([], [str(installed)])


@pytest.mark.parametrize(
    ("words", "station"),
    [
        (["/opt/bin/python", "/opt/bin/orchestrator", "run", "/etc/x.yaml"], "/etc/x.yaml"),
        (["python", "-m", "orchestrator", "run"], inhand.PLACES[0]),
        (["python", "-P", "-m", "orchestrator.service.controller", "7", "s.yaml"], "s.yaml"),
        (["python", "-m", "orchestrator", "demo"], ""),
    ],
)
def test_whose_file_a_command_line_names(words: list[str], station: str) -> None:
    assert inhand._station(words) == station


# --- ports in hand ---------------------------------------------------------------------------------------------------


def in_hand(directory: Path, *entries: object, name: str = "persisted.json") -> None:
    directory.mkdir(exist_ok=True)
    (directory / name).write_text(json.dumps({"format": 2, "entries": entries}))


@pytest.mark.parametrize("broken", ["", "  - ]}: {\n"])
@pytest.mark.parametrize("name", inhand.FILES)
def test_a_port_that_the_file_names_no_more_is_stopped_if_its_charger_may_run(
    tmp_path: Path, name: str, broken: str
) -> None:
    with running_chargers(tmp_path, 3) as (named, dropped, idle):
        file = station_file(tmp_path / "station.yaml", named, more=f"journal:\n  directory: ./journal\n{broken}")
        in_hand(
            tmp_path / "journal",
            {"bay": "old", "port": dropped.name, "running": True},
            {"bay": "idle", "port": idle.name, "running": False},
            {"bay": "bay-1", "port": os.path.realpath(named.name), "running": True},
            name=name,
        )
        done = estop(str(file), cwd=tmp_path)
        last = f"{file} is damaged: {LOST}" if broken else DONE.strip()
        assert done.stdout.splitlines()[-2:] == [f"old ({dropped.name}): standby verified", last]
        assert done.returncode == bool(broken)
        assert not (named.runs or dropped.runs)
        assert idle.stops == 0, "nobody has told it to run"


def test_a_station_file_without_a_port_still_leads_to_those_in_hand(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        file = station_file(tmp_path / "station.yaml", more="journal: {directory: j}\n")
        in_hand(tmp_path / "j", {"bay": "left", "port": bench.name, "running": True})
        assert estop(str(file), cwd=tmp_path).stdout == f"left ({bench.name}): standby verified\n{DONE}"


@pytest.mark.parametrize(
    "written",
    [
        b"", b"[]", b"{", b"\xff\xfe", b'{"entries": 7}', b'{"entries": [7, null, {}]}', b"[" * 100_000,
        b'{"entries": [{"running": true}, {"running": true, "port": 7}, {"running": true, "port": "x\\u0000/"}]}',
        b'{"entries": [{"running": true, "port": "/\\ud800"}]}', b'{"bay-1": {"running": true}}',
    ],
    ids=range(10),
)  # fmt: skip
def test_what_cannot_be_understood_is_passed_over(tmp_path: Path, written: bytes) -> None:
    (tmp_path / "persisted.json").write_bytes(written)
    assert ports_in_hand(str(tmp_path)) == {}


def test_a_bay_without_a_name_has_a_port_all_the_same(tmp_path: Path) -> None:
    in_hand(tmp_path, {"port": "/dev/x", "running": 1, "bay": 7})
    assert ports_in_hand(str(tmp_path)) == {"/dev/x": ""}


def test_a_disk_that_hangs_delays_no_stop(tmp_path: Path) -> None:
    """A fifo hangs in open(), as a file on a dead disk does."""
    with running_chargers(tmp_path) as (bench,):
        file = station_file(tmp_path / "station.yaml", bench, more="journal: {directory: j}\n")
        (tmp_path / "j").mkdir()
        os.mkfifo(tmp_path / "j" / "persisted.json")
        began_s = time.monotonic()
        done = estop(str(file), cwd=tmp_path)
        stop_s = bench.wire.counters.first_stop_s
        assert stop_s is not None
        assert stop_s - began_s < 1.0
        assert (done.returncode, done.stdout) == (0, f"bay-1 ({bench.name}): standby verified\n{DONE}")
        assert "cannot be read in time" in done.stderr


# --- where it is told ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_a_terminal_that_cannot_show_a_name_gets_what_it_can(tmp_path: Path, encoding: str) -> None:
    directory = tmp_path / "충전기"
    directory.mkdir()
    with running_chargers(directory) as (bench,):
        done = estop("--port", bench.name, cwd=tmp_path, PYTHONIOENCODING=encoding)
        assert (done.returncode, "Traceback" in done.stderr) == (0, False)
        assert "standby verified" in done.stdout
        assert ("\\ucda9" in done.stdout) == (encoding != "utf-8")


@pytest.mark.parametrize("arguments", [["--port", "PORT"], ["--help"], ["--nonsense"], ["none.yaml"]])
def test_whoever_does_not_listen_changes_nothing(tmp_path: Path, arguments: list[str]) -> None:
    with running_chargers(tmp_path) as (bench,):
        words = [bench.name if word == "PORT" else word for word in arguments]
        heard = estop(*words, cwd=tmp_path)
        for gone in (1, 2):
            argv = [sys.executable, *briefly.ESTOP, "estop", *words]
            closed = subprocess.run(
                ["sh", "-c", f'exec {gone}>&-; exec "$@"', "sh", *argv], cwd=tmp_path, capture_output=True, text=True,
                check=False, env={**os.environ, "ORCHESTRATOR_SOCKET": ""},
            )  # fmt: skip
            assert closed.returncode == heard.returncode
            assert "Traceback" not in closed.stderr
        reader, writer = os.pipe()
        os.close(reader)
        piped = estop(*words, cwd=tmp_path, stdout=writer)
        os.close(writer)
        assert (piped.returncode, "Traceback" in piped.stderr) == (heard.returncode, False)


def test_a_terminal_that_stands_still_keeps_nobody_from_the_exit_status(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    os.set_blocking(writer, True)
    with running_chargers(tmp_path) as (bench,):
        began_s = time.monotonic()
        assert estop("--port", bench.name, cwd=tmp_path, stdout=writer).returncode == 0
        assert time.monotonic() - began_s < 8.0
    os.close(reader)
    os.close(writer)


def test_ctrl_c_leaves_no_traceback(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        argv = [sys.executable, "-m", "orchestrator", "estop", "--port", bench.name]
        with subprocess.Popen(argv, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
            wait_until(lambda: bench.wire.counters.polls, what="the first question")
            running.send_signal(signal.SIGINT)
            said = b"".join(running.communicate()).decode()
            assert "interrupted: every charger was sent its stop" in said
            assert "Traceback" not in said
            assert running.returncode == 1
        assert not bench.runs


# --- beside what calls itself a service ------------------------------------------------------------------------------


def test_a_service_that_drips_costs_neither_the_stop_nor_the_end(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), answering(tmp_path / "s", None) as asked:
        began_s = time.monotonic()
        done = estop("--port", bench.name, "--socket", str(tmp_path / "s"), cwd=tmp_path)
        assert time.monotonic() - began_s < 6.0
        stop_s = bench.wire.counters.first_stop_s
        assert stop_s is not None
        assert stop_s - began_s < 1.0
        assert asked
        assert (done.returncode, done.stdout) == (0, f"{bench.name}: standby verified\n{DONE}")
        assert done.stderr.startswith("the service has not ")


@pytest.mark.parametrize(
    ("charger", "battery", "why"),
    [
        ({}, {"current_a": 14.0}, "NOT stopped: the charger says 0.0 A, the BMU sees 14.0 A"),
        ({"online": False}, {"current_a": 14.0}, "NOT stopped: the BMU sees 14.0 A, and the charger does not answer"),
        ({"operation": 1}, {}, "NOT stopped: the service says IDLE: no battery"),
        ({"t_s": 0.5}, {}, "no proof of standby: the service has not heard from the charger since"),
        ({}, {"online": False, "current_a": 14.0}, ""),
        ({}, {"current_a": None}, ""),
        ({}, {"current_a": -20.0}, ""),
        ({"online": False}, {}, None),
    ],
)
def test_both_witnesses_have_to_agree(
    tmp_path: Path, charger: Mapping[str, Any], battery: Mapping[str, Any], why: str | None
) -> None:
    port = str(tmp_path / "port")
    with answering(tmp_path / "s", {"bays": [bay(port, charger, battery)]}) as asked:
        service = Service([port], str(tmp_path / "s"), every_bay=True)
        service.start()
        assert service.told.wait(5.0)
        wait_until(lambda: len(asked) >= 2)
        assert asked[0] == {"verb": "stop", "bays": None, "means": "estop"}
        wait_until(lambda: service._seen[1])
        seen = service.sees(port, 1.0)
        assert (seen[1] if seen else None) == why
        assert service.said == "the service holds bay-1 until an operator starts it"
        assert service.sees("/dev/other", 1.0) is None


def test_a_service_that_ends_afterwards_has_taken_the_stop_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unanswered: list[ServiceError] = []

    def noted(*request: Any) -> dict[str, Any]:
        try:
            return ask(*request)
        except ServiceError as error:
            unanswered.append(error)
            raise

    monkeypatch.setattr(running_service, "ask", noted)
    with answering(tmp_path / "s", {"bays": []}):
        service = Service([], str(tmp_path / "s"), every_bay=True)
        service.start()
        assert service.told.wait(5.0)
    wait_until(lambda: len(unanswered) >= 2)
    assert service.said == "the service holds bay-1 until an operator starts it"


def test_a_current_that_only_the_bmu_sees_is_told_first(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        status = {"bays": [bay(bench.name, {}, {"current_a": 14.0})]}
        with answering(tmp_path / "s", status):
            done = estop("--port", bench.name, "--socket", str(tmp_path / "s"), cwd=tmp_path)
        assert done.returncode == 1
        assert done.stdout.splitlines() == [
            f"CUT THE MAINS of {bench.name}: nothing proves that it stands by",
            f"{bench.name}: NOT stopped: the charger says 0.0 A, the BMU sees 14.0 A",
        ]


# --- a file of that name ---------------------------------------------------------------------------------------------


def test_a_file_of_the_working_directory_is_not_imported_by_the_controller(tmp_path: Path) -> None:
    from orchestrator.lastresort.guardian import CONTROLLER

    for name in ("serial", "can", "transitions", "yaml", "select"):
        (tmp_path / f"{name}.py").write_text("print('imported')\n")
    done = subprocess.run(
        [sys.executable, *CONTROLLER, "no descriptor", "no file"], cwd=tmp_path, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert "ValueError" in done.stderr, "it got as far as its arguments"
    assert "imported" not in done.stdout


def test_one_port_whose_open_hangs_delays_no_other(tmp_path: Path) -> None:
    """The whole program, with a kernel that never returns from one open()."""
    program = """
import os, sys, threading
good, stuck = os.open, os.path.realpath(sys.argv[1])
def opens(path, *rest):
    if os.path.realpath(path) == stuck:
        threading.Event().wait()
    return good(path, *rest)
os.open = opens
from orchestrator.lastresort.estop import main
sys.exit(main(["--port", *sys.argv[1:]]))
"""
    with plugged(tmp_path / "stuck") as pty, running_chargers(tmp_path) as (bench,):
        began_s = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-c", program, pty.path, bench.name], capture_output=True, text=True, check=False
        )
        assert time.monotonic() - began_s < 8.0
        stop_s = bench.wire.counters.first_stop_s
        assert stop_s is not None
        assert stop_s - began_s < 1.0
        assert done.stdout.splitlines() == [
            f"CUT THE MAINS of {pty.path}: nothing proves that it stands by",
            f"{pty.path}: the port's driver hangs",
            f"{bench.name}: standby verified",
        ]
        assert done.returncode == 1
        assert pty.drain() == b""


# --- several services ------------------------------------------------------------------------------------------------

#: A process that looks like a service: it holds a port, listens, and answers every stop, or nothing.
SERVES = """
import json, os, socket, sys
port, path, bay, answers = sys.argv[1:5]
fd = os.open(port, os.O_RDWR | os.O_NOCTTY)
null = os.open(os.devnull, os.O_RDWR)
listener = socket.socket(socket.AF_UNIX)
listener.bind(path)
listener.listen()
print(flush=True)
while True:
    client, _ = listener.accept()
    asked = json.loads(client.makefile("rb").readline() or b"null")
    if asked is None or answers != "yes":
        continue
    bays = [{"name": bay, "port": port}]
    answer = {"results": {bay: ""}} if asked["verb"] == "stop" else {"bays": bays}
    client.sendall(json.dumps({"ok": True, **answer}).encode() + b"\\n")
    client.close()
"""


@contextmanager
def serving(port: str, path: Path, bay: str, answers: str = "yes") -> Iterator[None]:
    argv = ["/opt/bin/orchestrator", "-c", SERVES, port, str(path), bay, answers]
    with subprocess.Popen(argv, executable=sys.executable, stdout=subprocess.PIPE) as service:
        assert service.stdout is not None
        service.stdout.readline()
        try:
            yield
        finally:
            service.kill()


@pytest.mark.parametrize("answers", ["yes", "no"])
def test_every_service_that_holds_one_of_the_ports_is_told(tmp_path: Path, answers: str) -> None:
    """A service that was not reached may start its charger again."""
    left, right = tmp_path / "left", tmp_path / "right"
    with (
        running_chargers(tmp_path, 2) as (one, other),
        serving(one.name, left, "left-1"),
        serving(other.name, right, "right-1", answers),
    ):
        done = estop("--port", one.name, other.name, cwd=tmp_path)
        assert f"{left}: the service holds left-1 until an operator starts it\n" in done.stderr
        if answers == "yes":
            assert f"{right}: the service holds right-1 until an operator starts it\n" in done.stderr
            assert (done.returncode, done.stdout.splitlines()[-1]) == (0, DONE.strip())
        else:
            assert f"{right}: the service has not taken the stop (it does not answer)" in done.stderr
            assert (done.returncode, done.stdout.splitlines()[-1]) == (1, UNTOLD)
        assert done.stdout.count("standby verified") == 2


def test_who_holds_what_everybody_does_is_not_the_service(tmp_path: Path) -> None:
    with (
        running_chargers(tmp_path, 2) as (one, other),
        serving(other.name, tmp_path / "other", "other-1"),
        serving(one.name, tmp_path / "one", "one-1"),
    ):
        done = estop("--port", one.name, os.devnull, cwd=tmp_path)
        assert done.returncode == 1
        assert f"{os.devnull}: not a serial port" in done.stdout
        assert done.stderr == "the service holds one-1 until an operator starts it\n"


# --- a station file that is damaged ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rest",
    ["", "control: {socket: s}\n", "journal: {directory: j}\n", "control: {socket: s}\njournal: {directory: 'j\n"],
)
def test_a_file_that_was_cut_off_may_have_named_more(tmp_path: Path, rest: str) -> None:
    with running_chargers(tmp_path) as (bench,):
        file = tmp_path / "station.yaml"
        file.write_text(f"bays:\n  - {{name: left, charger: {{port: {bench.name}}}}}\n{rest}")
        done = estop(str(file), cwd=tmp_path)
        assert not bench.runs
        assert done.returncode == 1
        shown = bench.name if "'" in rest else f"left ({bench.name})"  # without YAML there are no names
        assert done.stdout.splitlines()[-2:] == [
            f"{shown}: standby verified",
            f"{file} is damaged: {LOST}",
        ]


@pytest.mark.parametrize("by", ["--socket", "ORCHESTRATOR_SOCKET"])
def test_a_file_that_has_lost_every_port_leads_to_the_service(tmp_path: Path, by: str) -> None:
    """The service knows its chargers and stops them all."""
    file, path = tmp_path / "station.yaml", str(tmp_path / "s")
    file.write_text("station: depot-1\nbays:\n  - {na")
    with answering(tmp_path / "s", {"bays": []}) as asked:
        if by == "--socket":
            done = estop(str(file), by, path, cwd=tmp_path)
        else:
            done = estop(str(file), cwd=tmp_path, ORCHESTRATOR_SOCKET=path)
        assert {"verb": "stop", "bays": None, "means": "estop"} in asked
        assert (done.returncode, done.stdout) == (1, "")
        assert "the service holds bay-1 until an operator starts it\n" in done.stderr
        assert f"{file} is damaged: " in done.stderr
