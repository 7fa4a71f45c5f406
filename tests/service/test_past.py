"""A bay's use of the persisted state: its own past, another bay's, or none."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.config.station import Rs485
from orchestrator.core.faults import FAULTS, Clear, FaultRow
from orchestrator.core.operator import STOPPED
from orchestrator.core.persisted import Persisted, PersistedFault
from orchestrator.model import Cause, ControlMode, Session
from orchestrator.service.past import Entry, Place, past_of, settled
from orchestrator.service.stateformat import NEVER_SET_S, Stamp, decode, encode
from orchestrator.text.catalogue import say
from tests.core.said import cause
from tests.service.bench import the_bay

A = Place("bay-1", "/dev/a", "can0", 16)
B = Place("bay-2", "/dev/b", "can0", 17)
TRIPPED = Persisted(faults={"emergency": PersistedFault(cause("EMCY 0x5000"), latched=True, raised=60.0)})
RUNNING = Persisted(running=True)
HELD = Persisted(hold=STOPPED)
FILE = "persisted.json"


def test_a_place_is_where_the_station_file_has_it_today() -> None:
    bay = the_bay()
    bay = replace(bay, charger=replace(bay.charger, port="some/where/../port", rs485=Rs485.KERNEL))
    assert Place.of(bay) == Place("bay-1", str(Path.cwd() / "some/port"), "can0", 0x10)
    assert (Place.of(bay).control, Place.of(bay).rs485) == (ControlMode.MANUAL, Rs485.KERNEL)


def test_its_own_past_is_taken_as_it_is() -> None:
    entries = [Entry(A, TRIPPED, 3), Entry(B, HELD, 3)]
    assert past_of(A, entries, FILE) == TRIPPED
    assert past_of(B, entries, FILE) == HELD


def test_a_bay_that_nobody_knows_is_held() -> None:
    past = past_of(Place("bay-3", "/dev/c", "can0", 18), [Entry(A, TRIPPED, 3)], FILE)
    assert past == Persisted(hold=Cause.of("past_unknown", bay="bay-3", port="/dev/c", file=FILE))


LAST = "when this service last ran, and"
MOVED = {
    "another port": (replace(A, port="/dev/c"), f"bay-1 was on /dev/a {LAST} is on /dev/c now"),
    "another name": (replace(A, bay="bay-9"), f"/dev/a was bay-1's {LAST} is bay-9's now"),
    "another bus": (
        replace(A, can="can1"),
        "bay-1 had the BMU on can0, node 0x10, when this service last ran, and has can1, node 0x10, now",
    ),
    "another BMU": (
        replace(A, node_id=20),
        "bay-1 had the BMU on can0, node 0x10, when this service last ran, and has can0, node 0x14, now",
    ),
    "only its BMU": (
        Place("bay-9", "/dev/c", "can0", 16),
        f"the BMU on can0, node 0x10, was bay-1's {LAST} is bay-9's now",
    ),
}


@pytest.mark.parametrize("name", MOVED)
def test_who_was_moved_is_held_with_all_that_was(name: str) -> None:
    place, said = MOVED[name]
    past = past_of(place, [Entry(A, replace(TRIPPED, running=True, paused=True), 3), Entry(B, HELD, 3)], FILE)
    assert say(past.hold) == f"{said}: see what is wired where"
    assert (past.running, past.paused, past.faults) == (True, True, TRIPPED.faults)


def test_two_bays_that_changed_places_have_the_pasts_of_both() -> None:
    entries = [Entry(A, TRIPPED, 3), Entry(B, replace(HELD, running=True), 3)]
    for place in (replace(A, port="/dev/b"), replace(B, port="/dev/a")):
        past = past_of(place, entries, FILE)
        assert past.faults == TRIPPED.faults
        assert past.running
        assert "was on /dev/" in say(past.hold)
        assert "stopped by the operator" in say(past.hold)


def test_a_port_under_another_name_is_the_same_port(tmp_path: Path) -> None:
    device, by_path = tmp_path / "ttyUSB0", tmp_path / "by-path"
    device.touch()
    by_path.symlink_to(device)
    old, new = Place("bay-1", str(device), "can0", 16), Place("bay-9", str(by_path), "can0", 20)
    assert past_of(new, [Entry(old, RUNNING, 3)], FILE).running


# --- run after run ----------------------------------------------------------------------------------------------------


def run(entries: list[Entry], number: int, *places: Place) -> list[Entry]:
    """One uneventful run of the service; a person lets everything continue."""
    pasts = {place: past_of(place, entries, FILE) for place in places}
    return [
        replace(entry, persisted=replace(entry.persisted, hold=None)) if entry.place in pasts else entry
        for entry in settled(places, pasts, entries, number)
    ]


def test_a_bay_that_was_absent_for_some_runs_is_as_it_was() -> None:
    entries = [Entry(A, TRIPPED, 1), Entry(B, Persisted(), 1)]
    for number in range(2, 6):
        entries = run(entries, number, B)
        assert Entry(A, TRIPPED, 1) in entries
    assert past_of(A, entries, FILE) == TRIPPED


def test_who_was_moved_is_asked_for_once() -> None:
    moved = replace(A, port="/dev/c")
    entries = run([Entry(A, Persisted(), 1)], 2, moved)
    assert past_of(moved, entries, FILE).hold is None
    assert past_of(A, entries, FILE).hold is not None, "and once more on its way back"


def test_a_port_that_comes_back_elsewhere_brings_its_faults() -> None:
    entries = run([Entry(A, TRIPPED, 1)], 2, replace(A, port="/dev/c"))
    past = past_of(Place("bay-9", "/dev/a", "can0", 30), entries, FILE)
    assert past.faults == TRIPPED.faults


def test_a_new_name_takes_everything_over() -> None:
    renamed = replace(A, bay="left")
    entries = run([Entry(A, TRIPPED, 1)], 2, renamed)
    assert [entry.place for entry in entries] == [renamed]
    assert entries[0].persisted.faults == TRIPPED.faults


def test_a_charger_that_runs_is_with_the_bay_that_has_its_port_now() -> None:
    entries = run([Entry(A, RUNNING, 1)], 2, Place("bay-9", "/dev/a", "can0", 30))
    assert {entry.place.bay: entry.persisted.running for entry in entries} == {"bay-9": True, "bay-1": False}
    entries = run([Entry(A, RUNNING, 1)], 2, replace(A, port="/dev/c"))
    assert {entry.place.port: entry.persisted.running for entry in entries} == {"/dev/c": True, "/dev/a": True}


def test_the_first_format_knew_names_only() -> None:
    first = Entry(Place("bay-1"), TRIPPED, 1)
    assert past_of(A, [first], FILE) == TRIPPED
    assert [entry.place for entry in run([first], 2, A)] == [A]
    assert past_of(B, [first], FILE).hold is not None


def test_an_older_version_that_ran_in_between_makes_a_person_look() -> None:
    past = past_of(A, [Entry(A, HELD, 4), Entry(Place("bay-1"), TRIPPED, 5)], FILE)
    assert past.faults == TRIPPED.faults
    assert say(past.hold).startswith("an older version of this service has run bay-1 in the meantime: ")


def test_of_two_pasts_the_stricter_counts() -> None:
    seen = PersistedFault(cause("once"), raised=9.0, clean=5.0, strikes=(9.0,))
    one = Persisted(
        faults={"bmu_silent": seen}, session=Session(3.0, charged_ah=2.0), resets=((5.0, "a"),), full_pct=99.0
    )
    other = Persisted(
        faults={"bmu_silent": replace(seen, cause=cause("often"), latched=True, clean=None, strikes=(9.0, 5.0))},
        session=Session(3.0, charged_ah=5.0), resets=((5.0, "a"), (7.0, "b")), full_pct=90.0, soc=(4.0, 50.0),
    )  # fmt: skip
    past = past_of(replace(A, bay="bay-2", port="/dev/b"), [Entry(A, one, 1), Entry(B, other, 1)], FILE)
    assert past.faults == {"bmu_silent": PersistedFault(cause("often"), latched=True, raised=9.0, strikes=(9.0, 5.0))}
    assert past.session == other.session
    assert past.resets == ((7.0, "b"), (5.0, "a"))
    assert (past.full_pct, past.soc) == (90.0, (4.0, 50.0))


# --- the file ---------------------------------------------------------------------------------------------------------


def _values(params: tuple[tuple[str, object], ...]) -> tuple[object, ...]:
    return tuple(value for _, value in params)


figure = st.floats(-1e6, 1e6)
value = st.none() | st.booleans() | st.integers(-9, 9) | figure | st.text(max_size=8)
causes = st.none() | st.builds(
    Cause,
    st.text(min_size=1, max_size=8),
    st.recursive(
        st.lists(st.tuples(st.text(max_size=8), value), max_size=3).map(tuple),
        lambda params: st.lists(
            st.tuples(st.text(max_size=8), value | st.builds(Cause, st.just("inner"), params) | params.map(_values)),
            max_size=2,
        ).map(tuple),
        max_leaves=3,
    ),
    st.text(max_size=8),
    st.text(max_size=8),
    st.text(max_size=8),
)
past = st.builds(
    Persisted,
    running=st.booleans(),
    hold=causes,
    paused=st.booleans(),
    faults=st.dictionaries(
        st.text(max_size=8),
        st.builds(
            PersistedFault,
            cause=causes,
            latched=st.booleans(),
            raised=st.none() | figure,
            clean=st.none() | figure,
            strikes=st.lists(figure, max_size=3).map(tuple),
        ),
        max_size=3,
    ),
    resets=st.lists(st.tuples(figure, st.text(max_size=8)), max_size=3).map(tuple),
    session=st.none()
    | st.builds(Session, figure, figure, charged_ah=figure, soc_pct=st.none() | figure, result=causes),
    full_pct=st.none() | figure,
    soc=st.none() | st.tuples(figure, figure),
    serial=st.none() | st.integers(1, 2**32 - 1),
    typed=st.text(max_size=8),
)
place = st.builds(
    Place,
    st.text(max_size=8),
    st.binary(max_size=8).map(lambda data: "/dev/" + data.replace(b"\0", b"").decode(errors="surrogateescape")),
    st.text(max_size=8),
    st.integers(0, 127),
    st.sampled_from(ControlMode),
    st.sampled_from(Rs485),
)
entry_lists = st.lists(
    st.builds(Entry, place, past, st.integers(0, 99)), max_size=4, unique_by=lambda entry: entry.place
)
NOW = Stamp(1_800_000_000.0, 500.0, "this boot")


@given(entry_lists)
def test_what_is_written_is_read(entries: list[Entry]) -> None:
    moment = replace(NOW, clock_s=NOW.clock_s + 2**-30)  # without one its age would be unknown
    run, read = decode(encode(NOW, 7, entries), moment)
    assert run == 7
    assert [(one.place, one.persisted.gist, one.run) for one in read] == [
        (one.place, one.persisted.gist, one.run) for one in entries
    ]
    assert encode(moment, 7, read) == encode(
        moment, 7, [replace(one, persisted=one.persisted.aged(2**-30)) for one in entries]
    )


AGES = {
    "the same boot, whatever the wall clock says": (Stamp(5e9, 100.0, "this boot"), 400.0),
    "another boot": (Stamp(1_799_999_000.0, 9_000.0, "another"), 1000.0),
    "a clock that went back": (Stamp(1_800_000_500.0, 9_000.0, "another"), 0.0),
    "a clock that had never been set": (Stamp(NEVER_SET_S - 1, 9_000.0, "another"), 0.0),
    "no boot is known": (Stamp(1_799_999_000.0, 100.0, ""), 1000.0),
    "a monotonic clock that went back": (Stamp(1_799_999_000.0, 600.0, "this boot"), 1000.0),
}


@pytest.mark.parametrize("name", AGES)
def test_ages_go_on_while_no_service_runs(name: str) -> None:
    written, age_s = AGES[name]
    assert written.age_s(NOW) == age_s
    (entry,) = decode(encode(written, 7, [Entry(A, Persisted(resets=((5.0, "emergency"),)), 7)]), NOW)[1]
    assert entry.persisted.resets == ((5.0 + age_s, "emergency"),)


@pytest.mark.parametrize("wall_s", [float("nan"), float("inf"), -1e300, 1e300])
def test_a_clock_that_tells_nonsense_is_not_asked(wall_s: float) -> None:
    assert Stamp(1_799_999_000.0, 1.0, "another").age_s(Stamp(wall_s, 1.0, "this")) == 0.0


@pytest.mark.parametrize("row", [row for row in FAULTS if row.clear is Clear.RESET], ids=lambda row: row.id)
def test_what_has_latched_stays_so(row: FaultRow) -> None:
    name = row.id
    entries = [Entry(A, Persisted(faults={name: PersistedFault(cause("seen"), latched=True, raised=1.0)}), 1)]
    (entry,) = decode(encode(NOW, 1, entries), NOW)[1]
    assert entry.persisted.memory(900.0).faults[name].latched


def test_the_second_format_is_read_and_its_sentences_are_kept() -> None:
    entry = {
        "bay": "bay-1", "port": "/dev/a", "can": "can0", "node_id": 16, "control": "manual", "rs485": "off", "run": 3,
        "running": False, "hold": "stopped by the operator; start to go on", "paused": False,
        "faults": {"emergency": {"text": "EMCY 0x5000", "latched": True, "raised": 60.0, "clean": None, "strikes": []},
                   "late": {"text": "", "latched": False, "raised": None, "clean": None, "strikes": [1.0]}},
        "resets": [], "session": {"started_s": 1.0, "result": ""}, "full_pct": None, "soc": None,
    }  # fmt: skip
    document = {"format": 2, "written": NEVER_SET_S, "clock_s": 1.0, "boot": "", "run": 3, "entries": [entry]}
    run, (read,) = decode(json.dumps(document).encode(), Stamp(NEVER_SET_S, 1.0, ""))
    assert (run, read.place) == (3, A)
    assert read.persisted.hold == STOPPED
    assert read.persisted.faults["emergency"] == TRIPPED.faults["emergency"]
    assert read.persisted.faults["late"] == PersistedFault(strikes=(1.0,))
    assert read.persisted.session == Session(1.0)
    for wrong in ({"hold": None}, {"faults": {"late": {"text": 1}}}, {"session": {"started_s": 1.0, "result": 2}}):
        document["entries"] = [{**entry, **wrong}]
        with pytest.raises(ValueError, match="is no sentence"):
            decode(json.dumps(document).encode(), Stamp(NEVER_SET_S, 1.0, ""))
