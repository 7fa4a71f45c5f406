"""What outlives the process, and what a bay makes of it."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.core.faults import FAULTS, ROW, Clear
from orchestrator.core.latches import shown
from orchestrator.core.memory import FaultMemory, Memory
from orchestrator.model import ENERGISED, Effect, State
from orchestrator.service.kept import FILE, UNFINISHED, Kept, read_kept, write_kept

NOW_S = 50.0
#: A row for each way a fault can end.
BY_CLEAR = {clear: next(row.id for row in FAULTS if row.clear is clear) for clear in Clear}


def raised(*, latched: bool = False) -> FaultMemory:
    return FaultMemory(raised_s=3.0, text="seen", latched=latched)


@pytest.mark.parametrize("state", State)
def test_a_charger_may_be_running_from_its_start_to_its_verified_stop(state: State) -> None:
    running = state in ENERGISED or state in (State.STOPPING, State.UNCONTROLLABLE)
    assert Kept.of(Memory(state=state)).running is running


def test_only_what_waits_for_a_person_is_kept() -> None:
    faults = {
        BY_CLEAR[Clear.AUTO]: raised(),
        BY_CLEAR[Clear.BACKOFF]: raised(),
        BY_CLEAR[Clear.OPERATOR]: raised(),
        BY_CLEAR[Clear.RESET]: raised(latched=True),
        "over_voltage": FaultMemory(present_s=3.0, text="not yet a fault"),
    }
    assert set(Kept.of(Memory(faults=faults)).faults) == {BY_CLEAR[Clear.OPERATOR], BY_CLEAR[Clear.RESET]}
    often = {BY_CLEAR[Clear.BACKOFF]: raised(latched=True)}
    assert Kept.of(Memory(faults=often)).faults == {BY_CLEAR[Clear.BACKOFF]: "seen"}


@pytest.mark.parametrize("name", [row.id for row in FAULTS if row.clear in (Clear.RESET, Clear.OPERATOR)])
def test_a_fault_comes_back_as_it_was(name: str) -> None:
    (fault,) = shown(Kept(faults={name: "seen"}).memory(NOW_S).faults)
    assert (fault.id, fault.since_s) == (name, NOW_S)
    assert fault.effect is (Effect.TRIP if ROW[name].clear is Clear.RESET else ROW[name].effect)
    assert fault.text.startswith("seen; ")


def test_a_fault_that_latched_by_coming_often_comes_back_latched() -> None:
    (fault,) = shown(Kept(faults={"bmu_silent": "seen"}).memory(NOW_S).faults)
    assert fault.effect is Effect.TRIP
    assert "it came 4 times within an hour" in fault.text


def test_a_charge_that_was_cut_off_is_a_fault_of_its_own() -> None:
    (fault,) = shown(Kept(running=True).memory(NOW_S).faults)
    assert fault.id == "found_running"
    assert fault.text.startswith(UNFINISHED)


def test_a_fault_of_another_version_holds_the_bay() -> None:
    memory = Kept(faults={"of_the_future": "seen"}).memory(NOW_S)
    assert memory.hold == "seen; start to go on"
    assert not memory.faults


@given(
    st.dictionaries(
        st.text(max_size=8),
        st.builds(
            Kept,
            running=st.booleans(),
            hold=st.text(max_size=8),
            paused=st.booleans(),
            faults=st.dictionaries(st.sampled_from(sorted(ROW)), st.text(max_size=8), max_size=3),
        ),
        max_size=3,
    )
)
def test_what_is_written_is_read(tmp_path_factory: pytest.TempPathFactory, kept: Mapping[str, Kept]) -> None:
    directory = tmp_path_factory.mktemp("kept") / "journal"
    write_kept(directory, kept)
    assert read_kept(directory, kept) == kept


def test_at_first_there_is_nothing(tmp_path: Path) -> None:
    assert read_kept(tmp_path / "none", ["bay-1"]) == {"bay-1": Kept()}


def test_what_is_lost_is_no_first_start(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").write_text("{}\n")
    kept = read_kept(tmp_path, ["bay-1"])["bay-1"]
    assert kept.hold == (
        f"{tmp_path / FILE} is lost, though this service has run here before: "
        "nobody knows which faults were latched; start to go on"
    )


def test_a_bay_that_is_new_has_nothing(tmp_path: Path) -> None:
    write_kept(tmp_path, {"bay-1": Kept(paused=True), "gone": Kept()})
    assert read_kept(tmp_path, ["bay-1", "bay-2"]) == {"bay-1": Kept(paused=True), "bay-2": Kept()}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "5",
        '"bay-1"',
        '{"bay-1": 5}',
        '{"bay-1": []}',
        '{"bay-1": {"strange": 1}}',
        '{"bay-1": {"running": 1}}',
        '{"bay-1": {"hold": null}}',
        '{"bay-1": {"faults": []}}',
        '{"bay-1": {"faults": {"emergency": 5}}}',
        '{"bay-1": {"hold": "\\ud800"}}',
        '{"bay-1": {"faults": {"emergency": "\\udcff"}}}',
        '{"bay-1": {"\\ud800": 1}}',
        "[" * 5000,
        "\udcff",
    ],
)
def test_what_cannot_be_read_holds_every_bay(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_bytes(text.encode(errors="surrogateescape"))
    for name, kept in read_kept(tmp_path, ["bay-1", "bay-2"]).items():
        if name == "bay-1" or not text.startswith('{"bay-1'):
            assert kept.hold.startswith(f"{tmp_path / FILE} cannot be read (")
            assert kept.memory(NOW_S).hold == kept.hold
            assert kept.hold.encode(), "it can be shown and written"


def test_a_directory_in_its_place_holds_every_bay(tmp_path: Path) -> None:
    (tmp_path / FILE).mkdir()
    assert read_kept(tmp_path, ["bay-1"])["bay-1"].hold
