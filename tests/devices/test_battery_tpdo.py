"""Readings by TPDO: configured, decoded, checked against SDO reads, and replaced by SDO when they stop."""

import pytest

from orchestrator.model import Measurement
from orchestrator.model.moment import moment
from tests.core.said import say
from tests.devices.bmu_bench import HEARTBEAT, REPLY, REQUEST, RX, TX, WORDS, Bench, Dialogue, config

TPDO1, TPDO2, TPDO3 = 0x190, 0x290, 0x390
START = (0x000, bytes.fromhex("01 10"))

SET_UP: Dialogue = [
    (TX, REQUEST, "40 00 60 00 00 00 00 00"),
    (RX, REPLY, "43 00 60 00 F8 FF 40 09"),
    (TX, REQUEST, "2B 00 18 05 64 00 00 00"),  # event timers: 100 ms
    (RX, REPLY, "60 00 18 05 00 00 00 00"),
    (TX, REQUEST, "2B 01 18 05 64 00 00 00"),
    (RX, REPLY, "60 01 18 05 00 00 00 00"),
    (TX, REQUEST, "2B 02 18 05 64 00 00 00"),
    (RX, REPLY, "60 02 18 05 00 00 00 00"),
]


def tpdo_bench() -> Bench:
    """A started node with configured TPDOs."""
    bench = Bench(config(tpdo_s=0.1))
    bench.play(SET_UP)
    assert bench.next_frame() == START
    return bench


def live(bench: Bench, seconds: float, words: dict[int, int] = WORDS) -> None:
    """All TPDOs every 100 ms, with SDO answers in between."""
    for _ in range(round(seconds / 0.1)):
        bench.hear(TPDO1, "F8 FF 40 09 FF FF 05 00")
        bench.hear(TPDO2, "64 5A FF FF D0 07 E8 03")
        bench.hear(TPDO3, "FA 00 00 00")
        bench.answer_reads(0.1, words)


def test_the_timers_are_written_and_the_node_is_started() -> None:
    bench = tpdo_bench()
    assert bench.next_frame()[0] == REQUEST
    bench.answer_reads(5.0, WORDS)
    assert bench.sent.count(START) == 1


def test_no_tpdo_is_configured_or_heard_unless_asked_for() -> None:
    bench = Bench()
    assert set(bench.node.cob_ids) == {0x590, 0x610, 0x710, 0x090}
    bench.answer_reads(3.0, WORDS)
    assert all(cob_id == REQUEST and data[0] == 0x40 for cob_id, data in bench.sent)


def test_all_is_configured_again_after_a_boot() -> None:
    bench = tpdo_bench()
    bench.hear(HEARTBEAT, "00")
    bench.play(SET_UP[2:])  # type: ignore[index]  # it is a list
    assert bench.next_frame() == START


@pytest.mark.parametrize("state", ["7F", "04"])
def test_a_node_that_is_not_operational_is_started_again_with_each_heartbeat(state: str) -> None:
    bench = tpdo_bench()
    bench.hear(HEARTBEAT, "05")
    live(bench, 1.0)
    assert bench.sent.count(START) == 1
    for number in (2, 3):
        bench.hear(HEARTBEAT, state)
        live(bench, 0.5)
        assert bench.sent.count(START) == number
    assert bench.link.nmt_state == int(state, 16)


def test_a_node_that_need_not_send_tpdos_is_left_in_its_state() -> None:
    bench = Bench(config(heartbeat_s=0.5))
    bench.answer_reads(1.0, WORDS)
    bench.hear(HEARTBEAT, "7F")
    bench.answer_reads(1.0, WORDS)
    assert START not in bench.sent


def test_a_refused_timer_leaves_the_sdo_reads_as_they_were() -> None:
    bench = Bench(config(tpdo_s=0.1))
    bench.play(SET_UP[:2])  # type: ignore[index]  # it is a list
    for index in range(3):
        bench.play(
            [(TX, REQUEST, f"2B {index:02X} 18 05 64 00 00 00"), (RX, REPLY, f"80 {index:02X} 18 05 02 00 01 06")]
        )
    bench.answer_reads(2.0, WORDS)
    assert all(cob_id == REQUEST for cob_id, _ in bench.sent)  # and no NMT start
    assert sum(data[1] == 0 for _, data in bench.sent) > 30
    assert say(bench.link.abort) == ""


def test_a_tpdo_carries_the_maps_objects_and_is_as_old_as_its_arrival() -> None:
    bench = tpdo_bench()
    bench.now_s += 0.05
    bench.hear(TPDO1, "10 00 60 09 3C 00 02 00")
    assert bench.reading.voltage_v == Measurement(24.0, moment(bench.now_s))
    assert bench.reading.current_a == Measurement(0.16, moment(bench.now_s))
    assert bench.reading.status == Measurement(2, moment(bench.now_s))
    assert bench.reading.time_to_full_min == Measurement(60, moment(bench.now_s))
    bench.hear(TPDO3, "0C 01 00 00")
    assert bench.reading.temperature_c == Measurement(26.8, moment(bench.now_s))
    bench.hear(TPDO2, "64 46 78 00 D0 07 E8 03")
    assert bench.reading.soc_pct == Measurement(70, moment(bench.now_s))


def test_a_tpdo_of_another_length_is_dropped() -> None:
    bench = tpdo_bench()
    before = bench.reading
    bench.hear(TPDO1, "10 00 60 09")
    bench.hear(TPDO3, "0C 01 00 00 00 00 00 00")
    assert bench.reading == before
    assert bench.link.bad_frames == 2


def test_what_tpdos_bring_is_read_only_once_a_second_until_they_stay_away() -> None:
    bench = tpdo_bench()
    live(bench, 1.0)
    begin = len(bench.sent)
    live(bench, 5.0)
    asked = [data[1] for _, data in bench.sent[begin:]]
    assert all(4 <= asked.count(index) <= 6 for index in range(5))
    begin = len(bench.sent)
    bench.answer_reads(3.0, WORDS)
    assert sum(data[1] == 0 for _, data in bench.sent[begin:]) > 30


def test_an_older_sdo_value_does_not_replace_a_newer_tpdo_value() -> None:
    bench = tpdo_bench()
    while (request := bench.next_frame()[1])[1] != 0:
        bench.now_s += 0.001
        bench.hear(REPLY, f"43 {request[1:4].hex()} 00 00 00 00")
    bench.now_s += 0.01
    bench.hear(TPDO1, "10 00 60 09 FF FF 00 00")
    newest = bench.reading.voltage_v
    bench.now_s += 0.01
    bench.hear(REPLY, "43 00 60 00 10 00 5F 09")
    assert bench.reading.voltage_v == newest


def test_tpdo_and_sdo_that_tell_different_stories_are_both_not_believed() -> None:
    bench = tpdo_bench()
    live(bench, 1.5)
    assert bench.link.implausible == {}
    other = WORDS | {0x6000: 0x1388FFF8}  # 50.00 V by SDO, 23.68 V by TPDO
    live(bench, 1.0, other)
    assert bench.link.implausible == {}  # once proves nothing: the value may just have changed
    live(bench, 2.0, other)
    assert "a TPDO says 23.68, the SDO read 50" in say(bench.link.implausible["voltage_v"])
    assert "current_a" not in bench.link.implausible
    live(bench, 1.5)
    assert bench.link.implausible == {}


def test_a_sender_that_lies_every_other_time_is_found_out() -> None:
    bench = tpdo_bench()
    live(bench, 1.5)
    other = WORDS | {0x6000: 0x1388FFF8}
    found = False
    for _ in range(6):
        for words in (other, WORDS):
            live(bench, 1.0, words)
            found |= "a TPDO says" in say(bench.link.implausible.get("voltage_v"))
    assert found


@pytest.mark.parametrize(
    ("request_", "used"),
    [
        ("23 00 18 01 90 02 00 00", False),  # another COB-ID
        ("23 00 1A 01 20 00 04 60", False),  # another object
        ("2F 00 18 02 FE 00 00 00", False),  # another moment
        ("2B 00 18 05 64 00 00 00", True),  # our own period
        ("2B 00 14 05 64 00 00 00", True),  # what it receives
    ],
)
def test_tpdos_that_another_master_has_changed_are_used_no_more_until_the_node_boots(request_: str, used: bool) -> None:
    bench = tpdo_bench()
    live(bench, 1.0)
    bench.hear(REQUEST, request_)
    bench.hear(REPLY, f"60 {bytes.fromhex(request_)[1:4].hex()} 00 00 00 00")
    bench.now_s += 0.01
    bench.hear(TPDO1, "10 00 60 09 FF FF 00 00")
    assert (bench.reading.voltage_v.value == 24.0) == used  # type: ignore[union-attr]  # live
    bench.hear(HEARTBEAT, "00")
    bench.hear(TPDO1, "10 00 60 09 FF FF 00 00")
    assert bench.reading.voltage_v.value == 24.0  # type: ignore[union-attr]  # just heard


def test_tpdos_alone_do_not_make_a_node_online() -> None:
    bench = tpdo_bench()
    for _ in range(30):
        bench.hear(TPDO1, "F8 FF 40 09 FF FF 00 00")
        bench.run(0.1)
    assert not bench.link.online
    assert bench.reading.voltage_v is not None
