"""Which battery is in a bay: by its serial number, as an operator has typed it, or assumed; never in silence."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.core.persisted import Persisted
from orchestrator.model import BatteryLink, State
from orchestrator.model.identity import LONGEST_ID, Identity, Source, is_id
from orchestrator.service.identified import Named
from orchestrator.text.catalogue import say
from orchestrator.text.document import in_language
from tests.service.bench import Bench, fields_of

TOLD = BatteryLink(online=True, serial=4711)
ASSUMED = "can0:0x10"


def named(bench: Bench, battery: str) -> Named:
    one = bench.bay.identified.name(battery)
    assert bench.bay.owes
    bench.step()
    return one


def known(bench: Bench) -> tuple[str, Source]:
    identity = bench.bay.identified.identity
    return identity.id, identity.source


def restarted(bench: Bench, directory: Path) -> Bench:
    """The next run of the service, with what is on disk."""
    persisted = bench.store.on_disk(bench.bay.place)
    assert persisted is not None
    again = directory / "again"
    again.mkdir()
    return Bench(again, persisted, now_s=bench.now_s)


def removed(bench: Bench) -> None:
    bench.battery.link = replace(bench.battery.link, online=False)
    bench.battery.values.clear()
    bench.charger.reading = replace(bench.charger.reading, voltage_v=0.0)
    bench.step(20)


def test_without_anything_better_it_is_assumed(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.step(5)
    assert known(bench) == (ASSUMED, Source.ASSUMED)
    identity = bench.bay.status()["identity"]
    assert isinstance(identity, dict)
    assert identity["text"] == "can0:0x10, assumed from node 0x10 on can0"
    assert not any("battery" in line for line in bench.said)


def test_its_serial_number_is_said_written_down_and_shown(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.step(5)
    bench.battery.link = TOLD
    bench.step(5)
    assert known(bench) == ("4711", Source.SERIAL_NUMBER)
    assert "bay-1: battery 4711, its serial number" in bench.said
    lines = [
        fields_of(line) for queue in bench.journal._waiting.values() for _, _, _, line in queue if line[0] == "battery"
    ]
    assert [(line["id"], line["source"]) for line in lines] == [(ASSUMED, "assumed"), ("4711", "serial_number")]
    assert json.loads(json.dumps(bench.bay.status()))["identity"]["id"] == "4711"


def test_what_an_operator_types_counts_and_is_kept(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.step(5)
    one = named(bench, "B-0042")
    assert one.identity is not None
    assert one.revision <= bench.store.persisted_revision
    assert say(one.identity.cause) == "B-0042, typed by an operator"
    bench = restarted(bench, tmp_path)
    bench.step()
    assert known(bench) == ("B-0042", Source.TYPED)


def test_it_is_dropped_when_the_battery_leaves(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.step(5)
    named(bench, "B-0042")
    removed(bench)
    assert known(bench) == (ASSUMED, Source.ASSUMED)
    assert bench.said[-1] == "bay-1: battery can0:0x10, assumed from node 0x10 on can0"
    bench = restarted(bench, tmp_path)
    bench.step()
    assert known(bench) == (ASSUMED, Source.ASSUMED)


def test_nobody_names_a_battery_that_is_not_there(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.step(5)
    removed(bench)
    one = named(bench, "B-0042")
    assert one.identity is None
    assert say(one.refusal) == ("no battery is heard in bay-1, or it may be another one: connect it, then identify it")


def test_it_stays_while_the_bmu_sleeps(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.step(5)
    named(bench, "B-0042")
    bench.battery.link = replace(bench.battery.link, online=False)
    bench.step(20)
    assert known(bench) == ("B-0042", Source.TYPED)


def test_a_serial_number_that_contradicts_it_is_said(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.step(5)
    named(bench, "B-0042")
    bench.battery.link = TOLD
    bench.step()
    assert known(bench) == ("4711", Source.SERIAL_NUMBER)
    sentence = (
        "4711, its serial number, although an operator typed B-0042: look which battery it is, then identify it again"
    )
    assert f"bay-1: battery {sentence}" in bench.said
    identity = bench.bay.status()["identity"]
    assert isinstance(identity, dict)
    assert (identity["text"], identity["typed"], identity["contradicted"]) == (sentence, "B-0042", True)


@pytest.mark.parametrize("typed", ["4711", "004711", "0x1267", "0X1267"])
def test_the_number_itself_contradicts_nothing(typed: str) -> None:
    identity = Identity.of("can0", 0x10, 4711, typed)
    assert not identity.contradicted
    assert say(identity.cause) == "4711, its serial number"


def test_another_serial_number_drops_what_was_typed_for_the_last_one(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.battery.link = TOLD
    bench.step(5)
    named(bench, "B-0042")
    bench.battery.link = replace(TOLD, serial=4712)
    bench.step(2)
    assert bench.bay.identified.identity == Identity.of("can0", 0x10, 4712, "")


def test_between_two_readings_of_it_the_last_one_holds(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.battery.link = TOLD
    bench.step(5)
    for link in (replace(TOLD, online=False), replace(TOLD, serial=None), TOLD):
        bench.battery.link = link
        bench.step(5)
        assert known(bench) == ("4711", Source.SERIAL_NUMBER)
    assert sum("battery 4711" in line for line in bench.said) == 1


def test_a_battery_that_is_gone_has_no_serial_number(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.battery.link = TOLD
    bench.step(5)
    removed(bench)
    assert known(bench) == (ASSUMED, Source.ASSUMED)


def test_a_battery_exchanged_in_mid_visit_ends_the_charge(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.battery.link = TOLD
    bench.charging()
    bench.battery.link = replace(TOLD, serial=4712)
    bench.until(State.HELD)
    assert known(bench) == ("4712", Source.SERIAL_NUMBER)
    assert bench.bay.decision is not None
    assert "battery_exchanged" in [fault.id for fault in bench.bay.decision.faults]


@pytest.mark.parametrize(
    ("text", "good"),
    [("B-0042", True), ("배터리 7", True), ("x" * LONGEST_ID, True), ("", False), (" B", False), ("B ", False),
     ("x" * (LONGEST_ID + 1), False), ("B\n", False), ("B\x1b[2J", False), ("\ud800", False)],
)  # fmt: skip
def test_what_a_battery_may_be_called(text: str, good: bool) -> None:
    assert is_id(text) is good


def test_the_status_says_it_in_the_reader_s_language(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.step(5)
    named(bench, "B-0042")
    document = json.loads(json.dumps({"bays": [bench.bay.status()]}))
    assert in_language(document, "ko")["bays"][0]["identity"]["text"] == "B-0042(운영자가 입력)"


def test_the_persisted_state_without_an_id_is_read(tmp_path: Path) -> None:
    bench = Bench(tmp_path, Persisted(serial=4711))
    bench.step()
    assert known(bench) == ("4711", Source.SERIAL_NUMBER)
