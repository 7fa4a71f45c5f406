"""The store on real files: what is on the disk when, failing disks, what the next run finds."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from orchestrator.core.faults import FAULTS, Clear
from orchestrator.core.operator import STOPPED, is_own
from orchestrator.core.persisted import COUNTERS_S, Persisted, PersistedFault
from orchestrator.errors import StartError
from orchestrator.model import Cause, Session
from orchestrator.service.loading import FILE, FIRST_FILE
from orchestrator.service.past import Place
from orchestrator.service.store import KEPT_WITHIN_S, Store
from orchestrator.text.catalogue import say
from tests.core.said import cause, raises
from tests.service.disks import FULL, WornDisk
from tests.waiting import wait_until

A, B, C = (Place(f"bay-{number}", f"/dev/{number}", "can0", 15 + number) for number in (1, 2, 3))
HELD = Persisted(hold=STOPPED)
TRIPPED = Persisted(faults={"emergency": PersistedFault(cause("EMCY 0x5000"), latched=True, raised=1.0)})
CALLS = ("open", "write", "fsync", "replace", "close")


class Clock:
    """Monotonic time that moves only when told to."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@contextmanager
def running(directory: Path, *places: Place, clock: Clock | None = None) -> Iterator[Store]:
    """A store that has read the existing files."""
    store = Store(directory, places or (A, B), clock or time.monotonic, time.time, boot="this")
    store.start()
    assert store.wait(5)
    try:
        yield store
    finally:
        store.close(5)


def kept(store: Store, revision: int) -> None:
    wait_until(lambda: store.persisted_revision >= revision, what="what is kept")


def as_written(cause: Cause) -> object:
    return json.loads(json.dumps(asdict(cause)))


def entries(directory: Path) -> dict[str, dict[str, object]]:
    document = json.loads((directory / FILE).read_text(encoding="utf-8"))
    return {entry["bay"]: entry for entry in document["entries"]}


def left(directory: Path, **pasts: Persisted) -> None:
    """State left by an earlier run: bay_1=…"""
    places = {place.bay.replace("-", "_"): place for place in (A, B, C)}
    with running(directory, *(places[name] for name in pasts)) as store:
        for name, past in pasts.items():
            store.put(places[name], past)


# --- what is on the disk when -----------------------------------------------------------------------------------------


def test_at_first_there_is_nothing_and_it_is_written_at_once(tmp_path: Path) -> None:
    with running(tmp_path / "run" / "journal") as store:
        assert store.past(A) == Persisted()
        kept(store, 1)
        assert set(entries(tmp_path / "run" / "journal")) == {"bay-1", "bay-2"}


def test_a_change_is_on_the_disk_when_its_revision_is_kept(tmp_path: Path) -> None:
    with running(tmp_path) as store:
        for number in range(20):
            kept(store, store.put(A, Persisted(running=number % 2 == 0, hold=cause(str(number)))))
            assert entries(tmp_path)["bay-1"]["hold"] == as_written(cause(str(number)))
            on_disk = store.on_disk(A)
            assert on_disk is not None
            assert on_disk.running is (number % 2 == 0)


def test_file_and_directory_are_synchronised_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a power cut it is the old file or the new one; once `persisted_revision` confirms it, the new one."""
    worn = WornDisk.under(monkeypatch)
    with running(tmp_path) as store:
        kept(store, 1)
        worn.called.clear()
        kept(store, store.put(A, HELD))
        called = [name for name in worn.called if name in CALLS]
    assert called[:8] == ["open", "write", "fsync", "close", "replace", "open", "fsync", "close"]


def test_a_new_directory_is_in_its_parent_for_good(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worn = WornDisk.under(monkeypatch)
    with running(tmp_path / "run" / "journal") as store:
        kept(store, 1)
    made = [name for name in worn.called if name in ("mkdir", "fsync")]
    assert made[:5] == ["mkdir", "mkdir", "fsync", "mkdir", "fsync"], "the first of them has no parent yet"


def test_counters_are_written_now_and_then_and_at_the_end(tmp_path: Path) -> None:
    clock = Clock()
    charging = Persisted(running=True, session=Session(1.0))
    with running(tmp_path, clock=clock) as store:
        kept(store, store.put(A, charging))
        store.put(A, replace(charging, session=Session(1.0, charged_ah=1.0)))
        clock.now_s += COUNTERS_S - 1
        store.turn()
        assert session(tmp_path)["charged_ah"] == 0
        clock.now_s += 2
        store.turn()
        assert session(tmp_path)["charged_ah"] == 1.0
        store.put(A, replace(charging, session=Session(1.0, charged_ah=2.0)))
    assert session(tmp_path)["charged_ah"] == 2.0


def session(directory: Path) -> dict[str, float]:
    return entries(directory)["bay-1"]["session"]  # type: ignore[return-value]  # a JSON document


def test_whoever_waits_is_told_what_has_come_to_the_disk(tmp_path: Path) -> None:
    told: list[Collection[Place]] = []
    store = Store(tmp_path, [A, B], time.monotonic, time.time, on_persisted=told.append)
    store.start()
    assert store.wait(5)
    kept(store, 1)
    kept(store, store.put(B, HELD))
    store.close(5)
    assert [set(places) for places in told] == [{A, B}, {B}]


# --- what no disk takes -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", ["open", "write", "fsync", "replace"])
def test_a_disk_that_hangs_delays_nobody_and_is_told_after_two_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    worn, clock = WornDisk.under(monkeypatch), Clock()
    with running(tmp_path, clock=clock) as store:
        kept(store, store.put(A, Persisted()))
        kept(store, 1)
        worn.hangs.add(call)
        began_s = time.monotonic()
        revision = store.put(A, Persisted(running=True))
        wait_until(lambda: worn.called[-1] == call, what="the call that hangs")
        for _ in range(100):
            store.put(B, HELD)
        assert time.monotonic() - began_s < 1
        assert store.persisted_revision < revision
        assert store.on_disk(A) is None, "nobody knows which of both is there"
        assert say(store.not_persisted(clock.now_s + KEPT_WITHIN_S)) == ""
        assert say(store.not_persisted(clock.now_s + KEPT_WITHIN_S + 0.1)) == (
            f"a restart would forget what changes: {tmp_path / FILE} is not written within 2 s"
        )
        began_s = time.monotonic()
        assert say(store.close(0.2)) == f"{tmp_path / FILE} is not written within 0.2 s: its disk hangs"
        assert time.monotonic() - began_s < 1
        worn.heal()
        kept(store, revision + 1)
        assert say(store.close(5)) == ""
    assert entries(tmp_path)["bay-1"]["running"] is True


@pytest.mark.parametrize("call", ["write", "fsync", "replace"])
def test_a_disk_that_refuses_is_told_at_once_and_asked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    worn = WornDisk.under(monkeypatch)
    with running(tmp_path) as store:
        kept(store, 1)
        worn.fails[call] = FULL
        revision = store.put(A, HELD)
        wait_until(lambda: store.not_persisted(time.monotonic()), what="the problem")
        assert say(store.not_persisted(time.monotonic())).endswith(f"{FILE}: No space left on device")
        assert store.persisted_revision < revision
        worn.heal()
        kept(store, revision)
        assert say(store.not_persisted(time.monotonic())) == ""


def test_an_end_on_a_full_disk_says_what_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worn = WornDisk.under(monkeypatch)
    with running(tmp_path) as store:
        kept(store, 1)
        worn.fails["write"] = FULL
        store.put(A, HELD)
        assert say(store.close(5)) == f"{tmp_path / FILE}: No space left on device"


def test_a_change_that_comes_during_a_write_has_its_own_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worn, clock = WornDisk.under(monkeypatch), Clock()
    with running(tmp_path, clock=clock) as store:
        kept(store, 1)
        worn.hangs.add("fsync")
        store.put(A, HELD)
        wait_until(lambda: worn.called[-1] == "fsync", what="the write")
        clock.now_s += 1.5
        second = store.put(B, HELD)
        clock.now_s += 1.0
        assert say(store.not_persisted(clock.now_s)) != ""
        worn.hangs.discard("fsync")
        worn.hangs.add("replace")
        worn.go.set()
        kept(store, second)
        assert say(store.not_persisted(clock.now_s)) == ""
        worn.heal()


def test_what_a_write_under_way_may_turn_round_is_not_certain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last charge has ended, its end is being written, and the next one begins: this reaches the disk later."""
    worn = WornDisk.under(monkeypatch)
    with running(tmp_path) as store:
        kept(store, store.put(A, Persisted(running=True)))
        worn.hangs.add("fsync")
        store.put(A, Persisted())
        wait_until(lambda: worn.called[-1] == "fsync", what="the write")
        revision = store.put(A, Persisted(running=True))
        assert store.on_disk(A) is None
        worn.heal()
        kept(store, revision)
        on_disk = store.on_disk(A)
        assert on_disk is not None
        assert on_disk.running


def test_a_fault_of_our_own_is_told_and_the_thread_lives_on(tmp_path: Path) -> None:
    with running(tmp_path) as store:
        kept(store, 1)
        store.put(A, Persisted(full_pct=float("nan"), hold={1: 2, "a": object()}))  # type: ignore[arg-type]  # no JSON
        wait_until(
            lambda: "internal error: TypeError" in say(store.not_persisted(time.monotonic())), what="the problem"
        )
        assert not store.stalled(time.monotonic())
        kept(store, store.put(A, HELD))


def test_a_directory_that_was_removed_is_made_and_owned_anew(tmp_path: Path) -> None:
    directory = tmp_path / "journal"
    with running(directory) as store:
        kept(store, 1)
        for path in directory.iterdir():
            path.unlink()
        directory.rmdir()
        kept(store, store.put(A, HELD))
        assert entries(directory)["bay-1"]["hold"] == as_written(STOPPED)
        assert (directory / "lock").exists()


# --- what the next run finds ------------------------------------------------------------------------------------------


def test_what_was_kept_comes_back_aged(tmp_path: Path) -> None:
    clock = Clock()
    with running(tmp_path, A, clock=clock) as store:
        store.put(A, Persisted(resets=((5.0, "emergency"),)))
        clock.now_s += 7
    clock.now_s += 100
    with running(tmp_path, A, clock=clock) as store:
        ((age_s, name),) = store.past(A).resets
        assert (round(age_s), name) == (112, "emergency")


def test_no_bay_is_lost_before_all_have_made_their_first_step(tmp_path: Path) -> None:
    left(tmp_path, bay_1=TRIPPED, bay_2=HELD, bay_3=TRIPPED)
    with running(tmp_path, A, B) as store:
        kept(store, store.put(A, Persisted()))
    found = entries(tmp_path)
    assert found["bay-2"]["hold"] == as_written(STOPPED)
    assert set(found["bay-3"]["faults"]) == {"emergency"}  # type: ignore[call-overload]  # a JSON document


def test_a_bay_that_was_away_for_a_day_is_as_it_was(tmp_path: Path) -> None:
    left(tmp_path, bay_1=TRIPPED, bay_2=Persisted())
    left(tmp_path, bay_2=Persisted())
    with running(tmp_path, A, B) as store:
        assert set(store.past(A).faults) == {"emergency"}
        assert store.past(A).hold is None


def test_a_bay_without_an_entry_is_held(tmp_path: Path) -> None:
    left(tmp_path, bay_1=Persisted())
    with running(tmp_path, A, B) as store:
        assert store.past(A).hold is None
        assert say(store.past(B).hold).startswith(f"bay-2 on /dev/2 is not in {tmp_path / FILE}: ")


def test_a_charger_on_a_port_that_nobody_has_is_in_hand_until_it_is_verified(tmp_path: Path) -> None:
    left(tmp_path, bay_1=Persisted(running=True), bay_2=Persisted(running=True))
    with running(tmp_path, B) as store:
        assert store.strays() == [A]
        kept(store, store.put(A, replace(store.past(A), running=False)))
        assert store.strays() == []
    with running(tmp_path, B) as store:
        assert store.strays() == []


def test_the_first_format_is_read_once_and_moved_away(tmp_path: Path) -> None:
    latching = next(row.id for row in FAULTS if row.clear is Clear.RESET)
    first = {"running": False, "hold": "", "paused": True, "faults": {latching: "EMCY", "overrun": "late"}}
    (tmp_path / FIRST_FILE).write_text(json.dumps({"bay-1": first}))
    with running(tmp_path, A, B) as store:
        past = store.past(A)
        assert (past.paused, set(past.faults), past.hold) == (True, {latching, "overrun"}, None)
        assert past.faults[latching].latched
        assert "nobody knows its past" in say(store.past(B).hold)
        kept(store, 1)
        wait_until(lambda: not (tmp_path / FIRST_FILE).exists(), what="the old file goes")
    assert json.loads((tmp_path / f"{FIRST_FILE}.old-1").read_text()) == {"bay-1": first}
    with running(tmp_path, A, B) as store:
        assert store.past(A).hold is None


def test_a_hold_of_a_version_before_held_loses_the_end_that_said_what_to_do(tmp_path: Path) -> None:
    """The bay reports it now; the rest are the operator's actions and no alarm."""
    with running(tmp_path, A) as store:
        kept(store, store.put(A, HELD))
    path, said = tmp_path / FILE, "stopped by the operator; start to go on"
    document = json.loads(path.read_text())
    document["format"], document["entries"][0]["hold"] = 2, said
    path.write_text(json.dumps(document))
    with running(tmp_path, A) as store:
        assert store.past(A).hold == STOPPED and is_own(STOPPED)
    path.unlink()
    first = {"running": False, "hold": said, "paused": False, "faults": {}}
    (tmp_path / FIRST_FILE).write_text(json.dumps({"bay-1": first}))
    with running(tmp_path, A) as store:
        assert store.past(A).hold == HELD.hold


def test_what_is_lost_is_no_first_start(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").write_text("{}\n")
    with running(tmp_path) as store:
        assert say(store.past(A).hold) == (
            f"{tmp_path / FILE} is lost, though this service has run here before: "
            "nobody knows which faults were latched"
        )


BROKEN = [
    "", "{", "[]", "5", '"bay-1"', "{}", '{"format": 3}', '{"format": 2}', "[" * 5000, "\udcff", "\0" * 4096,
    '{"format": 2, "written": 1e999, "clock_s": 0, "boot": "", "run": 1, "entries": []}',
    '{"format": 2, "written": 1, "clock_s": 0, "boot": "", "run": 1, "entries": [{"bay": "bay-1"}]}',
    '{"format": 2, "written": 1, "clock_s": 0, "boot": "", "run": 1, "entries": {}}',
]  # fmt: skip
SPOILT = {
    "running": 1, "hold": "stopped", "paused": "no", "faults": [], "strange": 1, "resets": [[1]], "full_pct": "x",
    "soc": [1.0], "session": {"charged_ah": 1.0}, "node_id": True, "port": None, "control": "remote", "run": 1.5,
    "rs485": {}, "bay": "\ud800",
}  # fmt: skip


@pytest.mark.parametrize("text", BROKEN)
def test_what_cannot_be_read_holds_every_bay_and_is_moved_aside(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_bytes(text.encode(errors="surrogateescape"))
    with running(tmp_path) as store:
        for place in (A, B):
            assert say(store.past(place).hold).startswith(f"{tmp_path / FILE} cannot be read (")
            assert say(store.past(place).hold).encode(), "it can be shown and written"
        kept(store, 1)
    assert (tmp_path / f"{FILE}.unread-1").read_bytes() == text.encode(errors="surrogateescape")
    with running(tmp_path) as store:
        assert say(store.past(A).hold).startswith(f"{tmp_path / FILE} cannot be read ("), (
            "for as long as nobody has started"
        )


@pytest.mark.parametrize("name", SPOILT)
def test_one_value_that_is_none_of_ours_spoils_the_file(tmp_path: Path, name: str) -> None:
    left(tmp_path, bay_1=HELD)
    document = json.loads((tmp_path / FILE).read_text())
    document["entries"][0][name] = SPOILT[name]
    (tmp_path / FILE).write_text(json.dumps(document))
    with running(tmp_path, A) as store:
        assert " cannot be read (" in say(store.past(A).hold)


def test_one_that_is_nested_beyond_all_bounds_is_told_in_words(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("[" * 100_000)
    with running(tmp_path, A) as store:
        said = f"{tmp_path / FILE} cannot be read (it is nested deeper than anything that this service writes): "
        assert say(store.past(A).hold).startswith(said)
        kept(store, 1)
    assert (tmp_path / f"{FILE}.unread-1").exists()


def test_one_place_twice_is_no_file_of_ours(tmp_path: Path) -> None:
    left(tmp_path, bay_1=HELD)
    document = json.loads((tmp_path / FILE).read_text())
    (tmp_path / FILE).write_text(json.dumps({**document, "entries": document["entries"] * 2}))
    with running(tmp_path, A) as store:
        assert "one place is in it twice" in say(store.past(A).hold)


def test_what_is_no_file_holds_every_bay(tmp_path: Path) -> None:
    for number, make in enumerate((Path.mkdir, os.mkfifo, lambda path: path.symlink_to("/dev/zero"))):
        directory = tmp_path / str(number)
        directory.mkdir()
        make(directory / FILE)  # type: ignore[operator]  # each takes a path
        with running(directory) as store:
            assert " cannot be read (" in say(store.past(A).hold)
            kept(store, 1)
            assert (directory / FILE).is_file()


def test_a_disk_that_does_not_tell_the_past_holds_every_bay_and_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left(tmp_path, bay_1=TRIPPED, bay_2=Persisted())
    before = (tmp_path / FILE).read_bytes()
    worn = WornDisk.under(monkeypatch)
    worn.hangs.add("read")
    store = Store(tmp_path, [A, B], time.monotonic, time.time)
    store.start()
    assert not store.wait(0.1)
    assert say(store.past(A).hold).startswith(f"the disk of {tmp_path} does not answer: nobody knows")
    store.put(B, Persisted(running=True))
    assert "restart the service once it does" in say(store.not_persisted(time.monotonic()))
    worn.heal()
    assert say(store.close(5)) == f"the disk of {tmp_path} does not answer"
    assert (tmp_path / FILE).read_bytes() == before


# --- one owner --------------------------------------------------------------------------------------------------------

SECOND = """
import sys, time
from pathlib import Path
from orchestrator.service.past import Place
from orchestrator.errors import StartError
from orchestrator.service.store import Store
from orchestrator.text.catalogue import say
store = Store(Path(sys.argv[1]), [Place("bay-1", "/dev/1", "can0", 16)], time.monotonic, time.time)
store.start()
try:
    print(store.wait(10), flush=True)
    sys.stdin.read()
except StartError as error:
    print(say(error.cause))
"""


def test_a_second_service_on_the_same_directory_ends_with_a_sentence(tmp_path: Path) -> None:
    command = [sys.executable, "-c", SECOND, str(tmp_path)]
    with running(tmp_path, A) as store:
        kept(store, 1)
        before = (tmp_path / FILE).read_bytes()
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=30, check=False, stdin=subprocess.DEVNULL
        )
        assert done.stdout == (
            f"another service keeps its state in {tmp_path}: stop it first, or give this station a journal.directory "
            "of its own\n"
        )
        assert (tmp_path / FILE).read_bytes() == before


def test_the_lock_goes_with_its_process_whatever_ends_it(tmp_path: Path) -> None:
    command = [sys.executable, "-c", SECOND, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True) as owner:
        assert owner.stdout is not None
        assert owner.stdout.readline() == "True\n"
        refused = Store(tmp_path, [A], time.monotonic, time.time)
        refused.start()
        with raises(StartError, match="another service keeps its state in"):
            refused.wait(5)
        owner.kill()
        owner.wait()
    with running(tmp_path, A):
        pass
