"""When the guardian acts and when it does not. Each test plays the controller."""

import os
import select
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from orchestrator.lastresort.guardian import ACTED, DONE, DROP, Guardian
from tests.guardian.chargers import running_chargers
from tests.guardian.watched import END_S, ENDS_WITH_3, ENDS_WITH_4_WHEN_TOLD, WAITS, state_of, watched
from tests.waiting import wait_until
from tests.whole.station import die_with_parent


def test_the_end_of_the_connection_stops_every_charger_and_what_is_left_is_killed(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 3) as benches, watched(tmp_path) as guardian:
        for bench in benches:
            guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        controller = guardian.controller
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert not any(bench.runs for bench in benches)
        assert state_of(controller) == "Z"
        assert guardian.log.splitlines() == [
            "guardian: the controller was ended by SIGKILL: stopping the chargers on 3 ports",
            *(f"guardian: {bench.name}: standby verified" for bench in benches),
        ]


def test_silence_is_a_hang(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        controller = guardian.controller
        assert guardian.ended() == ACTED
        assert not bench.runs
        assert "the controller hangs: stopping" in guardian.log
        assert state_of(controller) == "Z"


def test_heartbeats_keep_it_quiet(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        end_s = time.monotonic() + 1.2
        while time.monotonic() < end_s:
            guardian.beat()
        assert guardian.process.poll() is None
        assert bench.stops == 0


def test_a_controller_that_never_gets_going_is_killed(tmp_path: Path) -> None:
    with watched(tmp_path, "STARTUP_S=0.3") as guardian:
        assert guardian.ended() == ACTED


def test_a_controller_that_starts_slowly_is_waited_for(tmp_path: Path) -> None:
    with watched(tmp_path, "SILENCE_S=0.1") as guardian:
        assert guardian.controller
        assert select.select([guardian.link], [], [], 0.5) == ([], [], [])
        guardian.beat()


@pytest.mark.parametrize(
    ("controller", "status"),
    [(ENDS_WITH_3, 3), ("pass", 0), ("import os; os.kill(os.getpid(), 9)", ACTED), ("import os; os.abort()", ACTED)],
)
def test_without_a_port_the_controllers_end_is_its_own(tmp_path: Path, controller: str, status: int) -> None:
    with watched(tmp_path, controller=controller) as guardian:
        guardian.link.close()
        assert guardian.ended() == status
        assert guardian.log == ""


@pytest.mark.parametrize(("controller", "status"), [(ENDS_WITH_3, 3), ("pass", 0)])
def test_with_a_port_no_end_is_a_good_one(tmp_path: Path, controller: str, status: int) -> None:
    """A controller that ends silently has not stopped its chargers, whatever its exit status."""
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, controller=controller) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        wait_until(lambda: state_of(guardian.controller) == "Z")
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert not bench.runs
        assert f"the controller has ended with status {status}: stopping" in guardian.log


@pytest.mark.parametrize(("controller", "status"), [(ENDS_WITH_3, 3), ("pass", 0)])
def test_an_orderly_end_needs_no_stop(tmp_path: Path, controller: str, status: int) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, controller=controller) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        guardian.send(DONE)
        guardian.send(DROP + bench.name.encode())
        guardian.link.close()
        assert guardian.ended() == status
        assert bench.stops == 0


def test_an_orderly_end_may_take_its_time(tmp_path: Path) -> None:
    with watched(tmp_path, "SILENCE_S=0.1", controller=ENDS_WITH_4_WHEN_TOLD) as guardian:
        guardian.waits_for("\n")
        guardian.send(DONE)
        assert select.select([guardian.link], [], [], 0.5) == ([], [], [])
        os.kill(guardian.controller, signal.SIGTERM)
        guardian.link.close()
        assert guardian.ended() == 4


@pytest.mark.parametrize("hangs_up", [False, True])
def test_an_orderly_end_that_hangs_is_cut_short(tmp_path: Path, *, hangs_up: bool) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, "END_S=0.3") as guardian:
        controller = guardian.controller
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(DONE)
        if hangs_up:
            guardian.link.close()
        assert guardian.ended() == ACTED
        assert state_of(controller) == "Z"
        assert guardian.log == ""


def test_a_charger_that_does_not_obey_does_not_keep_the_service_from_starting_anew(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, "VERIFY_S=0.6") as guardian:
        bench.charger.ignores_stop = True
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        assert guardian.ended() == ACTED
        assert guardian.log.splitlines() == [
            "guardian: the controller hangs: stopping the chargers on 1 ports",
            f"guardian: CUT THE MAINS of the chargers on {bench.name}",
            f"guardian: {bench.name}: NOT stopped: the charger says that it goes on",
        ]


def test_it_starts_a_controller_that_nobody_can_freeze_and_ends_with_its_status(tmp_path: Path) -> None:
    """Its parent may ignore SIGCHLD, so the kernel reaps children at once, or block signals."""
    guards = "import signal, sys; from orchestrator.lastresort import guardian; "
    guards += "signal.signal(signal.SIGCHLD, signal.SIG_IGN); "
    guards += "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM]); "
    guards += "sys.exit(guardian.guard(['our.yaml'], ('-c', sys.argv[1])))"
    controller = """
import os, signal, socket, sys
link = socket.socket(fileno=int(sys.argv[1]))
assert link.type == socket.SOCK_SEQPACKET
link.send(b"B")
assert link.recv(9) == b"A"
link.send(b"E")
keys = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
print(sys.argv[2:], [signal.getsignal(key) is signal.SIG_IGN for key in keys], os.environ["HERE"])
print(signal.pthread_sigmask(signal.SIG_BLOCK, []))
sys.exit(3)
"""
    done = subprocess.run(
        [sys.executable, "-c", guards, controller], env={**os.environ, "HERE": str(tmp_path)}, capture_output=True,
        text=True, timeout=END_S, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (3, "")
    assert done.stdout == f"['our.yaml'] [True, True, True] {tmp_path}\nset()\n"


def test_a_controller_that_does_not_die_is_not_waited_for() -> None:
    """Like a process hanging in a driver: SIGKILL takes effect only when the driver returns."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    child = subprocess.Popen([sys.executable, "-c", WAITS], preexec_fn=die_with_parent)
    with ours, theirs, child:
        assert Guardian(child.pid, ours)._fate() == (ACTED, "does not die")
        child.kill()
