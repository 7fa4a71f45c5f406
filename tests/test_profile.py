"""The profile of a charging station: what the kernel and py-spy say, brought together. Times are not tested."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from benchmarks import profile, stacks, threads
from benchmarks.threads import Times
from tests.waiting import wait_until

ROOT = Path(__file__).resolve().parent.parent
LOOP = "Thread._bootstrap (threading.py:1002);ChargerPort._run (orchestrator/devices/charger.py:111)"
STACKS = f"""\
thread (11): MainThread;<module> (benchmarks/named.py:40);decide (orchestrator/core/decide.py:50) 30
thread (11): MainThread;<module> (benchmarks/named.py:40);decide (orchestrator/core/decide.py:60) 10
thread (11): MainThread;<module> (benchmarks/named.py:40);decide (orchestrator/core/decide.py:60);update (a.py:7) 20
thread (21): charger /dev/ttyUSB0;{LOOP};poll (orchestrator/devices/poll.py:20) 15
thread (22): charger /dev/ttyUSB1;{LOOP};again (a.py:1);again (a.py:2) 5
thread (31);f (a.py:1) 3

thread (41): can-can0 7
torn
"""


def test_a_station_is_profiled_by_the_role_of_its_threads() -> None:
    command = [sys.executable, "-m", "benchmarks.profile", "2", "1", "--seconds", "1"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=110, check=True)
    facts, station, _, *rows = run.stdout.splitlines()
    assert "gateway factor" in facts
    assert station.startswith("2 bays charging on 1 bus, ")
    number = {row[:20].strip(): int(row[20:27]) for row in rows}
    assert list(number) == [*threads.ROLES.values(), threads.GUARDIAN, "all"]
    assert {said: number[said] for said in ("control loop", "chargers' threads", "CAN threads", "journal")} == {
        "control loop": 1, "chargers' threads": 2, "CAN threads": 1, "journal": 1,
    }  # fmt: skip
    assert number["guardian"] >= 1 and number["all"] == sum(number.values()) - number["all"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["64"], "the following arguments are required: BUSES"),
        (["0", "1"], "argument BAYS: invalid choice: 0"),
        (["many", "1"], "argument BAYS: invalid int value: 'many'"),
        (["64", "1", "--seconds", "0"], "argument --seconds: invalid choice: 0"),
        (["64", "1", "--spy", "stacks.raw"], "--spy needs py-spy, which is not on the PATH: pip install py-spy"),
    ],
)
def test_what_cannot_be_profiled_is_said_at_once(
    arguments: list[str], said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(SystemExit) as end:
        profile.main(arguments)
    assert end.value.code == 2
    assert said in capsys.readouterr().err


def test_a_role_is_known_by_the_beginning_of_a_threads_name() -> None:
    assert threads.role("charger /dev/ttyS") == "chargers' threads"
    assert threads.role("can-can0") == "CAN threads"
    assert threads.role("store") == "other threads"


def test_a_threads_times_are_the_kernels() -> None:
    end = threading.Event()
    busy = threading.Thread(target=lambda: any(end.is_set() for _ in iter(int, 1)), daemon=True)
    before = threads.until_now([0, os.getpid()])
    busy.start()
    try:
        assert busy.native_id
        key = (threads.role(Path(f"/proc/self/task/{busy.native_id}/comm").read_text(encoding="utf-8")), busy.native_id)
        wait_until(lambda: threads.until_now([0, os.getpid()])[key].ran_s > 0.1)
        times = threads.until_now([0, os.getpid()])[key]
    finally:
        end.set()
        busy.join()
    assert (times.threads, key in before) == (1, False)
    assert times.wakeups >= 0 and 0 <= times.system <= 1
    assert ("control loop", os.getpid()) in before


def test_the_threads_of_a_role_count_together_and_since_the_beginning() -> None:
    before = {("CAN threads", 1): Times(1, 1.0, 2.0, 100, 100, 1000)}
    after = {
        ("CAN threads", 1): Times(1, 1.4, 2.2, 120, 130, 1020),
        ("CAN threads", 2): Times(1, 0.2, 0.0, 10, 0, 20),
        ("journal", 3): Times(1, 0.1, 0.0, 0, 0, 2),
    }
    found = threads.by_role(before, after, 2.0)
    can = found["CAN threads"]
    assert (can.threads, can.wakeups) == (2, 20.0)
    assert (can.ran_s, can.waited_s, can.system) == pytest.approx((0.3, 0.1, 0.5))
    rows = {row[:20].strip(): row[20:].split() for row in threads.rows(found, 10)}
    assert rows["CAN threads"] == ["2", "30.00", "%", "50", "%", "10.00", "%", "20", "30000", "µs/s"]
    assert rows["all"] == ["3", "35.00", "%", "50", "%", "10.00", "%", "21", "35000", "µs/s"]
    assert rows["journal"][3] == "0" and rows["control loop"][0] == "0"


def test_stacks_are_shares_of_functions_whatever_the_line_and_the_thread() -> None:
    found = stacks.by_role(STACKS.splitlines())
    assert {said: of.total for said, of in found.items()} == {
        "control loop": 60, "chargers' threads": 20, "other threads": 3,
    }  # fmt: skip
    decide, update = "decide (orchestrator/core/decide.py)", "update (a.py)"
    assert found["control loop"].alone() == [(decide, 40 / 60), (update, 20 / 60)]
    assert found["control loop"].with_calls() == [(update, 20 / 60)]  # everything is in decide()


def test_a_function_that_calls_itself_counts_once() -> None:
    of = stacks.by_role(STACKS.splitlines())["chargers' threads"]
    assert dict(of.with_calls())["again (a.py)"] == 5 / 20


def test_a_handful_of_samples_is_no_list() -> None:
    rows = list(stacks.rows(stacks.by_role(STACKS.splitlines())))
    assert "\nother threads: 3 samples, too few for a list" in rows
    assert "  66.7 %  decide (orchestrator/core/decide.py)" in rows


def test_py_spys_own_words_are_said_where_it_cannot_sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # It is no requirement of ours, so it may not be here; what it says is from a machine that forbids it.
    program = tmp_path / "py-spy"
    program.write_text('#!/bin/sh\necho "Permission Denied: $*"\nexit 1\n', encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    with pytest.raises(
        RuntimeError, match=r"py-spy has ended with status 1:\nPermission Denied: record .*--nonblocking"
    ):
        profile.record(os.getpid(), 1, tmp_path / "stacks.raw")
