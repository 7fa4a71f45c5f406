"""The dialogue with one BMU, frame by frame, in simulated time."""

from dataclasses import replace
from itertools import pairwise

import pytest

from orchestrator.devices.battery import ANSWER_LIMIT_S
from orchestrator.model import BatteryReading, Measurement
from orchestrator.protocol.objects import ObjectMap
from tests.core.said import cause, say
from tests.devices.bmu_bench import EMERGENCY, HEARTBEAT, REPLY, REQUEST, RX, TABOS, TX, WORDS, Bench, Dialogue, config

#: protocol/bmu.md, "Golden exchanges": a complete first round with the sample of §4.1.
FIRST_ROUND: Dialogue = [
    (TX, REQUEST, "40 00 60 00 00 00 00 00"),
    (RX, REPLY, "43 00 60 00 F8 FF 40 09"),
    (TX, REQUEST, "40 01 60 00 00 00 00 00"),
    (RX, REPLY, "43 01 60 00 FF FF 05 00"),
    (TX, REQUEST, "40 02 60 00 00 00 00 00"),
    (RX, REPLY, "43 02 60 00 64 5A 78 00"),
    (TX, REQUEST, "40 03 60 00 00 00 00 00"),
    (RX, REPLY, "43 03 60 00 D0 07 E8 03"),
    (TX, REQUEST, "40 04 60 00 00 00 00 00"),
    (RX, REPLY, "43 04 60 00 F6 FF 00 00"),
]
HEARTBEAT_WRITE = "2B 17 10 00 F4 01 00 00"  # 500 ms


def online(settings: object = None) -> Bench:
    bench = Bench(config() if settings is None else settings)  # type: ignore[arg-type]  # None or a BatteryConfig
    bench.play(FIRST_ROUND)
    return bench


def test_the_documents_own_bytes_become_a_reading() -> None:
    bench = Bench()
    bench.play(FIRST_ROUND)
    values = {name: getattr(bench.reading, name) for name in BatteryReading.__slots__}
    assert {name: m and m.value for name, m in values.items()} == {
        "voltage_v": 23.68,
        "current_a": -0.08,
        "status": 5,
        "temperature_c": -1.0,
        "soc_pct": 90,
        "soh_pct": 100,
        "time_to_full_min": None,  # FF FF: not available
        "time_to_empty_min": 120,
        "remaining_ah": 10.0,
        "available_wh": 200.0,
    }
    assert bench.link.online
    assert say(bench.link.problem) == ""


def test_a_value_is_as_old_as_its_request() -> None:
    bench = Bench()
    bench.play(FIRST_ROUND[:1])  # type: ignore[index]  # it is a list
    asked_s = bench.now_s
    bench.now_s += 0.25
    bench.hear(REPLY, "43 00 60 00 F8 FF 40 09")
    assert bench.reading.voltage_v == Measurement(23.68, asked_s)


def test_every_answer_is_told_once_and_at_once() -> None:
    bench = Bench()
    bench.play(FIRST_ROUND)
    assert bench.changes == 5


def asked_in_10_s(bench: Bench, words: dict[int, int]) -> list[int]:
    """How often each object was asked for."""
    begin = len(bench.sent)
    bench.answer_reads(10.0, words)
    asked = [data[1] for _, data in bench.sent[begin:]]
    return [asked.count(index) for index in range(5)]


EVERY_SWEEP = pytest.approx(200, rel=0.05)
#: The serial number is read once meanwhile, which may delay one of them into the next seconds.
TWICE_A_SECOND = pytest.approx(20, abs=1)
CLOSELY, AT_REST = [EVERY_SWEEP, EVERY_SWEEP, 10, 10, TWICE_A_SECOND], [20, 20, 10, 10, 20]


def test_volts_amps_and_status_each_sweep_temperature_twice_a_second_the_others_once() -> None:
    assert asked_in_10_s(online(), WORDS) == CLOSELY


def test_at_rest_nothing_is_read_more_often_than_twice_a_second() -> None:
    bench = online()
    bench.node.attend(closely=False)
    bench.answer_reads(1.0, WORDS)
    assert asked_in_10_s(bench, WORDS) == AT_REST


def test_who_is_to_be_watched_closely_is_read_at_once() -> None:
    bench = online()
    bench.node.attend(closely=False)
    bench.answer_reads(10.3, WORDS)
    bench.node.attend(closely=True)
    begin_s, begin = bench.now_s, len(bench.sent)
    bench.answer_reads(0.01, WORDS)
    assert {data[1] for _, data in bench.sent[begin:]} == {0x00, 0x01}
    assert bench.reading.voltage_v.t_s >= begin_s  # type: ignore[union-attr]  # it is read
    assert asked_in_10_s(bench, WORDS) == CLOSELY


def test_current_into_a_pack_at_rest_is_watched_closely_whoever_let_it_flow() -> None:
    bench = online()
    bench.node.attend(closely=False)
    bench.answer_reads(1.0, WORDS)
    assert asked_in_10_s(bench, WORDS | {0x6000: 0x09400000 + 40}) == AT_REST  # 0.4 A: an offset
    bench.answer_reads(1.0, WORDS | {0x6000: 0x09400000 + 1400})
    assert asked_in_10_s(bench, WORDS | {0x6000: 0x09400000 + 1400}) == CLOSELY
    bench.answer_reads(1.0, WORDS)
    assert asked_in_10_s(bench, WORDS) == AT_REST


def test_what_was_not_answered_is_asked_again_before_its_next_turn() -> None:
    bench = online()
    asked_s: list[float] = []
    while len(asked_s) < 2:
        _, data = bench.next_frame()
        if data[1] == 2:
            asked_s.append(bench.now_s)
        else:
            bench.now_s += 0.001
            bench.hear(REPLY, f"43 {data[1:4].hex()} F8 FF 00 00")
    assert asked_s[1] - asked_s[0] == pytest.approx(0.5, abs=0.05)


def test_only_one_request_is_in_flight() -> None:
    bench = Bench()
    bench.next_frame()
    assert bench.run(0.29) == []


# --- silence and refusal ---------------------------------------------------------------------------------------------


def test_silence_is_noticed_after_the_limit_and_values_keep_their_age() -> None:
    bench = online()
    answered_s, before = bench.now_s, bench.reading
    bench.run(1.49)
    assert bench.link.online
    bench.run(0.02)
    assert not bench.link.online
    assert "does not answer" in say(bench.link.problem)
    assert "check its power" in say(bench.link.problem)
    assert bench.reading == before
    assert bench.now_s - answered_s < 1.52


def test_a_node_that_falls_silent_is_called_so_at_the_time_that_it_asked_for() -> None:
    """Whatever the digits of that time: without rounding, the node would ask for the same moment for ever."""
    for answer_s in (1023.3499999999991, *(1000.0 + number / 7 for number in range(200))):
        bench = online()
        bench.node._answer_s = answer_s
        bench.node.turn(answer_s + ANSWER_LIMIT_S, lambda _cob_id, _data: None)
        assert not bench.link.online, answer_s


def test_a_silent_node_is_asked_twice_a_second_and_its_return_is_noticed() -> None:
    bench = online()
    bench.run(2.0)
    asked = bench.run(20.0)
    assert 20 <= len(asked) <= 41
    _, request = bench.next_frame()
    bench.now_s += 0.01
    bench.hear(REPLY, f"43 {request[1:4].hex()} F8 FF 00 00")
    assert bench.link.online
    assert say(bench.link.problem) == ""
    assert bench.next_frame(within_s=0.001)


def test_a_node_that_never_answered_says_so() -> None:
    bench = Bench()
    assert "not asked yet" in say(bench.link.problem)
    bench.run(1.0)
    assert "does not answer" in say(bench.link.problem)
    assert not bench.link.online


def test_an_abort_is_a_refusal_not_silence() -> None:
    bench = Bench()
    for _ in range(40):
        _, request = bench.next_frame()
        bench.now_s += 0.1
        if request[1] == 0x04:
            bench.hear(REPLY, "80 04 60 00 00 00 02 06")
        else:
            word = WORDS[0x6000 | request[1]].to_bytes(4, "little")
            bench.hear(REPLY, f"43 {request[1:4].hex()} {word.hex()}")
    assert bench.link.online
    assert bench.link.abort_code == 0x06020000
    assert "0x6004" in say(bench.link.abort)
    assert "does not exist" in say(bench.link.abort)
    assert bench.reading.temperature_c is None
    bench.answer_reads(0.2, WORDS)
    assert (say(bench.link.abort), bench.link.abort_code) == ("", 0)
    assert bench.reading.temperature_c is not None


def test_only_aborts_are_alive_too() -> None:
    bench = Bench()
    for _ in range(30):
        _, request = bench.next_frame()
        bench.now_s += 0.1
        bench.hear(REPLY, f"80 {request[1:4].hex()} 22 00 00 08")
    assert bench.link.online
    assert bench.link.abort_code == 0x08000022
    assert bench.reading == BatteryReading()


# --- answers that are none -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("answer", "because"),
    [
        ("41 00 60 00 04 00 00 00", "the beginning of a segmented transfer"),
        ("00 F8 FF 40 09 00 00 00", "a segment"),
        ("C0 00 60 00 00 00 00 00", "a block transfer"),
        ("43 00 60 00 F8 FF 40", "seven bytes"),
        ("", "no bytes"),
        ("43 00 60 01 F8 FF 40 09", "another sub-index"),
        ("43 01 60 00 F8 FF 40 09", "another object"),
        ("80 01 60 00 00 00 02 06", "the abort of another object"),
        ("60 00 60 00 00 00 00 00", "a write's answer"),
    ],
)
def test_what_is_no_answer_is_dropped_and_counted(answer: str, because: str) -> None:
    bench = Bench()
    bench.play([(TX, REQUEST, "40 00 60 00 00 00 00 00"), (RX, REPLY, answer)])
    assert bench.reading == BatteryReading(), because
    assert not bench.link.online
    assert bench.link.bad_frames == 1
    bench.hear(REPLY, "43 00 60 00 F8 FF 40 09")  # the real answer still counts
    assert bench.reading.voltage_v is not None


def test_an_endless_segmented_answer_is_silence() -> None:
    bench = online()
    end_s = bench.now_s + 3.0
    while bench.now_s < end_s:
        bench.run(0.001)
        bench.hear(REPLY, "41 00 60 00 FF FF 00 00")
    assert not bench.link.online
    assert "not understood" in say(bench.link.problem) or "frames a second" in say(bench.link.problem)


def test_another_size_than_the_maps_is_implausible() -> None:
    bench = online()
    before = bench.reading.voltage_v
    bench.play([(TX, REQUEST, "40 00 60 00 00 00 00 00"), (RX, REPLY, "4B 00 60 00 40 09 00 00")])
    assert set(bench.link.implausible) == {"voltage_v", "current_a"}
    assert "came with a size of 2, the map says 4" in say(bench.link.implausible["voltage_v"])
    assert bench.reading.voltage_v == before


def test_an_implausible_value_leaves_the_last_one_until_a_plausible_comes() -> None:
    bench = online()
    bench.answer_reads(0.6, WORDS)
    before = bench.reading.temperature_c
    bench.answer_reads(1.0, WORDS | {0x6004: 0x7FFF})
    assert list(bench.link.implausible) == ["temperature_c"]
    assert "3276.7" in say(bench.link.implausible["temperature_c"])
    assert before is not None
    assert bench.reading.temperature_c is not None
    assert bench.reading.temperature_c.value == 25.0
    assert bench.now_s - bench.reading.temperature_c.t_s > 0.9
    bench.answer_reads(0.5, WORDS)
    assert bench.link.implausible == {}


# --- late answers ----------------------------------------------------------------------------------------------------


def test_a_late_answer_is_not_taken_for_the_next_read_of_the_object() -> None:
    bench = Bench()
    bench.play([(TX, REQUEST, "40 00 60 00 00 00 00 00")])
    assert [data[1] for _, data in bench.run(0.55)] == [0x01]  # another object: 0x6000 is not asked again
    bench.hear(REPLY, "43 00 60 00 F8 FF 40 09")
    assert bench.reading == BatteryReading()
    assert bench.link.bad_frames == 1


def test_a_node_that_always_answers_too_late_is_offline_and_told_why() -> None:
    bench = Bench()
    due: list[tuple[float, str]] = []
    for _ in range(400):
        for _, data in bench.run(0.01):
            due.append((bench.now_s + 0.35, f"43 {data[1:4].hex()} 01 00 02 00"))
        while due and due[0][0] <= bench.now_s:
            bench.hear(REPLY, due.pop(0)[1])
    assert bench.reading == BatteryReading()
    assert "later than 0.3 s" in say(bench.link.problem)
    assert bench.link.bad_frames > 3


def two_objects() -> ObjectMap:
    """Volts and amps at the fast rate, percentages at the slow one, nothing else."""
    return replace(TABOS, objects=(TABOS.objects[0], TABOS.objects[2]), tpdos=())


def test_when_all_two_objects_are_unanswered_there_is_a_pause() -> None:
    bench = Bench(config(object_map=two_objects()))
    times = [0.0] * 10
    for i in range(10):
        bench.next_frame()
        times[i] = bench.now_s
    gaps = [later - earlier for earlier, later in pairwise(times)]
    assert gaps[0::2] == pytest.approx([0.5] * 5)
    assert gaps[1::2] == pytest.approx([1.3] * 4)  # the time-out and a second of quiet


def test_a_single_fast_object_is_read_each_sweep_with_another_one_in_between() -> None:
    bench = Bench(config(object_map=two_objects()))
    bench.answer_reads(5.0, WORDS)
    asked = [data[1] for _, data in bench.sent]
    assert asked.count(0) > 80
    assert not any(earlier == later for earlier, later in pairwise(asked))


def test_when_nothing_is_answered_an_object_is_asked_again_only_after_quiet() -> None:
    bench = Bench()
    times: dict[int, list[float]] = {}
    end_s = bench.now_s + 20.0
    while bench.now_s < end_s:
        _, data = bench.next_frame()
        times.setdefault(data[1], []).append(bench.now_s)
    assert len(times) == 5
    assert all(later - earlier >= 1.3 for asked in times.values() for earlier, later in pairwise(asked))


def test_a_second_node_on_the_id_is_found_out() -> None:
    bench = online()
    for _ in range(10):
        _, request = bench.next_frame()
        for word in ("F8 FF 40 09", "00 00 00 00"):
            bench.now_s += 0.001
            bench.hear(REPLY, f"43 {request[1:4].hex()} {word}")
    assert not bench.link.online
    assert "answered twice" in say(bench.link.problem)
    bench.answer_reads(1.0, WORDS)  # the second one was removed
    assert bench.link.online


def test_one_repeated_frame_is_nothing() -> None:
    bench = online()
    for _ in range(50):
        bench.answer_reads(0.1, WORDS)
        bench.hear(REPLY, "43 00 60 00 F8 FF 40 09")
    assert bench.link.online
    assert bench.link.bad_frames == 50


def test_a_babbling_node_is_not_believed() -> None:
    bench = online()
    for _ in range(1500):
        bench.now_s += 0.001
        bench.hear(HEARTBEAT, "05")
    assert not bench.link.online
    assert "500 frames a second" in say(bench.link.problem)


# --- heartbeat, boot-up, emergency -----------------------------------------------------------------------------------


def test_the_heartbeat_is_asked_for_after_the_first_answer() -> None:
    bench = Bench(config(heartbeat_s=0.5))
    bench.play(
        [
            (TX, REQUEST, "40 00 60 00 00 00 00 00"),
            (RX, REPLY, "43 00 60 00 F8 FF 40 09"),
            (TX, REQUEST, HEARTBEAT_WRITE),
            (RX, REPLY, "60 17 10 00 00 00 00 00"),
        ]
    )
    assert (bench.link.heartbeat_s, bench.link.heartbeat_t_s) == (0.5, bench.now_s)
    bench.play([(TX, REQUEST, "40 01 60 00 00 00 00 00")])
    changes = bench.changes
    bench.now_s += 0.2
    bench.hear(HEARTBEAT, "05")
    assert (bench.link.heartbeat_t_s, bench.link.nmt_state) == (bench.now_s, 5)
    bench.now_s += 0.2
    bench.hear(HEARTBEAT, "05")
    assert bench.link.heartbeat_t_s == bench.now_s
    assert bench.changes == changes + 1  # the state was new; the second heartbeat brings nothing new


def test_a_refused_heartbeat_is_no_fault_and_not_asked_for_again() -> None:
    bench = Bench(config(heartbeat_s=0.5))
    bench.play(
        [
            (TX, REQUEST, "40 00 60 00 00 00 00 00"),
            (RX, REPLY, "43 00 60 00 F8 FF 40 09"),
            (TX, REQUEST, HEARTBEAT_WRITE),
            (RX, REPLY, "80 17 10 00 02 00 01 06"),
        ]
    )
    bench.answer_reads(5.0, WORDS)
    assert (bench.link.heartbeat_s, say(bench.link.abort), bench.link.online) == (None, "", True)
    assert sum(data[0] == 0x2B for _, data in bench.sent) == 1


def test_an_unanswered_heartbeat_write_is_tried_again() -> None:
    bench = Bench(config(heartbeat_s=0.5))
    bench.play(FIRST_ROUND[:2])  # type: ignore[index]  # it is a list
    writes: list[float] = []
    while len(writes) < 3:
        _, data = bench.next_frame()
        if data[0] == 0x2B:
            assert data.hex(" ").upper() == HEARTBEAT_WRITE
            writes.append(bench.now_s)
        else:
            bench.now_s += 0.001
            bench.hear(REPLY, f"43 {data[1:4].hex()} 00 00 00 00")
    assert all(1.0 <= later - earlier < 1.4 for earlier, later in pairwise(writes))
    assert bench.link.heartbeat_s is None


def test_heartbeats_that_stop_stay_lost_though_they_are_asked_for_again() -> None:
    bench = Bench(config(heartbeat_s=0.5))
    bench.answer_reads(0.2, WORDS)
    bench.hear(HEARTBEAT, "7F")
    heard_s = bench.now_s
    bench.answer_reads(5.0, WORDS)
    assert bench.link.heartbeat_t_s == heard_s
    assert sum(data[0] == 0x2B for _, data in bench.sent) > 2
    bench.hear(HEARTBEAT, "7F")
    assert bench.link.heartbeat_t_s == bench.now_s


def test_a_boot_up_in_mid_sweep_forgets_everything_and_configures_again() -> None:
    bench = Bench(config(heartbeat_s=0.5))
    bench.answer_reads(1.0, WORDS)
    bench.hear(HEARTBEAT, "05")
    bench.hear(EMERGENCY, "10 42 08 00 00 00 00 00")
    _, in_flight = bench.next_frame()
    bench.now_s += 0.001
    bench.hear(HEARTBEAT, "00")
    assert bench.reading == BatteryReading()
    assert (bench.link.boots, bench.link.boot_t_s) == (1, bench.now_s)
    assert (bench.link.heartbeat_s, bench.link.heartbeat_t_s, say(bench.link.emergency)) == (None, None, "")
    bench.hear(REPLY, f"43 {in_flight[1:4].hex()} 01 00 02 00")  # an answer from before the boot
    assert bench.reading == BatteryReading()
    bench.play([(TX, REQUEST, HEARTBEAT_WRITE)])
    bench.hear(REPLY, "60 17 10 00 00 00 00 00")
    assert bench.link.heartbeat_s == 0.5
    bench.hear(HEARTBEAT, "00")
    assert bench.link.boots == 2


def test_a_boot_up_of_a_silent_node_brings_it_back_at_once() -> None:
    bench = Bench()
    bench.run(10.0)
    bench.hear(HEARTBEAT, "00")
    assert bench.next_frame(within_s=0.001) == (REQUEST, bytes.fromhex("40 00 60 00 00 00 00 00"))


def test_a_stopped_node_is_told_from_a_dead_one() -> None:
    bench = online()
    bench.hear(HEARTBEAT, "04")
    bench.run(2.0)
    assert bench.link.nmt_state == 4
    assert "NMT start wakes it" in say(bench.link.problem)


@pytest.mark.parametrize(("cob_id", "data"), [(HEARTBEAT, ""), (HEARTBEAT, "00 00"), (EMERGENCY, "10")])
def test_frames_of_a_wrong_length_are_dropped_and_counted(cob_id: int, data: str) -> None:
    bench = online()
    before = bench.reading
    bench.hear(cob_id, data)
    assert bench.link.bad_frames == 1
    assert (bench.reading, bench.link.boots, say(bench.link.emergency)) == (before, 0, "")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("10 42 08 01 02 03 04 05", "EMCY 0x4210, temperature"),
        ("10 42", "EMCY 0x4210, temperature"),  # canopen would lose a short one
        ("30 31 04 00 00 00 00 00", "EMCY 0x3130, voltage"),
        ("01 FF 00 00 00 00 00 00", "device-specific"),
    ],
)
def test_an_emergency_is_shown_in_words_until_it_is_reset(data: str, words: str) -> None:
    bench = online()
    bench.hear(EMERGENCY, data)
    assert words in say(bench.link.emergency)
    bench.hear(EMERGENCY, "00 00 00 00 00 00 00 00")
    assert say(bench.link.emergency) == ""


def test_an_emergency_is_forgotten_when_the_node_has_left() -> None:
    """The next battery may never reset it, and its boot-up frame may be missed."""
    bench = online()
    bench.hear(EMERGENCY, "10 42 08 01 02 03 04 05")
    bench.run(1.6)
    assert (bench.link.online, say(bench.link.emergency)) == (False, "")


def test_the_bus_that_breaks_takes_the_node_offline_with_its_reason() -> None:
    bench = online()
    before = bench.reading
    bench.next_frame()
    bench.node.fail(cause("CAN bus can0 is down"), bench.now_s)
    assert (bench.link.online, say(bench.link.problem)) == (False, "CAN bus can0 is down")
    assert bench.reading == before
    assert bench.run(0.4) == []
    bench.answer_reads(1.0, WORDS)
    assert (bench.link.online, say(bench.link.problem)) == (True, "")


def test_an_answer_to_what_was_asked_before_a_failure_is_late() -> None:
    bench = Bench()
    bench.next_frame()
    bench.node.fail(cause("a bug"), bench.now_s)
    bench.hear(REPLY, "43 00 60 00 F8 FF 40 09")
    assert bench.reading == BatteryReading()
    assert say(bench.link.problem) == "a bug"


def test_trouble_on_the_bus_is_the_reason_of_silence() -> None:
    bench = online()
    bench.node.trouble = cause("nobody acknowledges")
    bench.run(2.0)
    assert say(bench.link.problem).endswith("nobody acknowledges")
