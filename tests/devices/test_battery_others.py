"""Others on the bus: masters using the same BMU, and senders answering in its name (faults B26, B27, B28)."""

from collections.abc import Callable

import pytest

from orchestrator.devices.two_answers import DOUBT_S
from orchestrator.model.moment import moment
from orchestrator.protocol.sdo import read_request, write_request
from tests.core.said import say as text_of
from tests.devices.bmu_bench import HEARTBEAT, ONCE, REPLY, REQUEST, WORDS, Bench, config

TEMPERATURE, VOLTS = 0x6004, 0x6000
FORGED = 0x00000258  # 60.0 °C
ALL = WORDS | ONCE


def online(**keys: float | None) -> Bench:
    bench = Bench(config(**keys))  # type: ignore[arg-type]  # its own keys
    bench.answer_reads(1.5, WORDS)
    assert bench.link.online
    return bench


def next_read(bench: Bench, index: int | None = None) -> bytes:
    """Answer until the node asks for this object; leave that request unanswered."""
    while True:
        _, data = bench.next_frame()
        if index in (None, data[1] | data[2] << 8):
            return data
        bench.now_s += 0.001
        say(bench, answer(data))


def answer(request: bytes, word: int | None = None) -> bytes:
    value = ALL[request[1] | request[2] << 8] if word is None else word
    return b"\x43" + request[1:4] + value.to_bytes(4, "little")


def refusal(request: bytes, code: int = 0x06010002) -> bytes:
    return b"\x80" + request[1:4] + code.to_bytes(4, "little")


def say(bench: Bench, *replies: bytes, after_s: float = 0.0005) -> None:
    for reply in replies:
        bench.now_s += after_s
        bench.node.on_frame(REPLY, reply, bench.now_s)


def other_asks(bench: Bench, *requests: bytes, after_s: float = 0.0005) -> None:
    for request in requests:
        bench.now_s += after_s
        bench.node.on_frame(REQUEST, request, bench.now_s)


# --- another master --------------------------------------------------------------------------------------------------


def test_a_master_that_reads_everything_all_the_time_is_said_and_disturbs_nothing() -> None:
    bench = online(heartbeat_s=None)
    bad = bench.link.bad_frames
    for number in range(2000):
        request = read_request(0x6000 + number % 5, 0)
        ours = bench.step(bench.now_s + 0.01)
        other_asks(bench, request)
        replies = [answer(request)] if ours is None else [answer(ours[1]), answer(request)]
        say(bench, *(replies if number % 3 else reversed(replies)))
        assert bench.link.online, number
    assert (text_of(bench.link.problem), bench.link.implausible, text_of(bench.link.abort)) == ("", {}, "")
    assert bench.link.bad_frames == bad
    assert text_of(bench.link.other_master).startswith("another CANopen master reads 0x600")
    assert bench.link.other_master_t_s is not None
    assert bench.now_s - bench.link.other_master_t_s <= 1.1
    assert bench.reading.voltage_v is not None
    assert bench.now_s - bench.reading.voltage_v.t_s < 0.3


@pytest.mark.parametrize("ours_first", [True, False])
def test_a_refusal_of_somebody_elses_write_is_not_ours(ours_first: bool) -> None:
    bench = online()
    request, write = next_read(bench, VOLTS), write_request(VOLTS, 0, 1, 4)
    other_asks(bench, write)
    say(bench, *([answer(request), refusal(write)] if ours_first else [refusal(write), answer(request)]))
    bench.answer_reads(3.0, WORDS)
    assert text_of(bench.link.abort) == ""
    assert bench.link.abort_code == 0
    assert text_of(bench.link.other_master) == "another CANopen master writes 0x6000:00"
    assert bench.now_s - bench.reading.voltage_v.t_s < 0.1  # type: ignore[union-attr]  # online


def test_a_refusal_to_write_is_never_the_answer_to_a_read_even_if_the_write_was_not_heard() -> None:
    bench = online()
    request = next_read(bench, VOLTS)
    say(bench, refusal(request), answer(request))
    assert (text_of(bench.link.abort), bench.link.implausible) == ("", {})


def test_a_refusal_that_may_be_ours_counts_once_it_can_only_be_ours() -> None:
    bench = online()
    for _ in range(3):
        request = next_read(bench, TEMPERATURE)
        other_asks(bench, request)
        say(bench, refusal(request, 0x06020000), refusal(request, 0x06020000))
        assert text_of(bench.link.abort) == ""
    asked_s = bench.now_s
    say(bench, refusal(next_read(bench, TEMPERATURE), 0x06020000))
    assert "0x6004" in text_of(bench.link.abort)
    assert bench.now_s - asked_s < 0.5  # asked again soon, not at its next turn


def test_a_confirmation_of_somebody_elses_write_does_not_arm_our_heartbeat() -> None:
    bench = Bench(config(heartbeat_s=0.5))
    while (data := bench.next_frame()[1])[0] == 0x40:
        say(bench, answer(data))
    other_asks(bench, write_request(0x1017, 0, 5000, 2))
    say(bench, b"\x60" + data[1:4] + bytes(4))
    assert bench.link.heartbeat_s is None
    bench.answer_reads(3.0, WORDS)
    assert bench.link.heartbeat_s == 0.5


def test_a_value_is_as_old_as_the_older_of_two_requests() -> None:
    bench = online()
    say(bench, answer(next_read(bench, 0x6001)))
    other_asks(bench, read_request(TEMPERATURE, 0))
    asked_s = bench.now_s
    request = bench.next_frame()[1]
    assert request == read_request(TEMPERATURE, 0)
    assert bench.now_s - asked_s > 0.02
    say(bench, answer(request))
    assert bench.reading.temperature_c.t_s == moment(asked_s)  # type: ignore[union-attr]  # just read


def test_a_request_that_the_node_lost_makes_no_later_value_old() -> None:
    bench = online()
    other_asks(bench, read_request(VOLTS, 0))
    bench.answer_reads(0.3, WORDS)
    assert bench.now_s - bench.reading.voltage_v.t_s < 0.12  # type: ignore[union-attr]  # read each sweep


def test_each_request_explains_one_answer_and_no_more() -> None:
    bench = online()
    request = next_read(bench, TEMPERATURE)
    other_asks(bench, request)
    say(bench, answer(request), answer(request))
    assert bench.link.implausible == {}
    say(bench, answer(request, FORGED))
    assert text_of(bench.link.implausible["temperature_c"]) == "temperature: two answers to one request, 25.0 and 60.0"


def test_a_forger_cannot_hide_behind_a_request_of_its_own() -> None:
    bench = online()
    request = next_read(bench, TEMPERATURE)
    other_asks(bench, request)
    say(bench, answer(request, 200), answer(request, FORGED))
    assert "20.0 and 60.0" in text_of(bench.link.implausible["temperature_c"])


def test_two_masters_at_once_are_both_explained() -> None:
    bench = online()
    for _ in range(50):
        request = next_read(bench)
        other_asks(bench, request, request)
        say(bench, answer(request), answer(request), answer(request))
    assert (text_of(bench.link.problem), bench.link.implausible) == ("", {})


NAME = b"BMU of another make, 2022"


def segmented() -> list[tuple[bytes, bytes]]:
    frames = [(read_request(0x1008, 0), bytes.fromhex("41081000") + len(NAME).to_bytes(4, "little"))]
    for number, at in enumerate(range(0, len(NAME), 7)):
        part = NAME[at : at + 7]
        last = at + 7 >= len(NAME)
        toggle = number % 2 << 4
        frames.append(
            (bytes((0x60 | toggle,)) + bytes(7), bytes((toggle | (7 - len(part)) << 1 | last,)) + part.ljust(7, b"\0"))
        )
    return frames


def test_a_segmented_read_goes_first_and_explains_all_its_frames() -> None:
    bench = online()
    bad = bench.link.bad_frames
    for _ in range(100):
        for request, reply in segmented():
            other_asks(bench, request, after_s=0.0001)
            assert bench.step(bench.now_s + 0.002) is None, "a node with one transfer at a time would break it off"
            say(bench, reply, after_s=0.0001)
        bench.answer_reads(0.02, WORDS)
    assert (text_of(bench.link.problem), bench.link.implausible, bench.link.bad_frames) == ("", {}, bad)
    assert text_of(bench.link.other_master) == "another CANopen master reads 0x1008:00"


def test_a_transfer_without_end_does_not_keep_us_from_reading() -> None:
    bench = online()
    other_asks(bench, read_request(0x1008, 0))
    say(bench, segmented()[0][1])
    for number in range(1000):
        other_asks(bench, bytes((0x60 | number % 2 << 4,)) + bytes(7), after_s=0.004)
        say(bench, bytes((number % 2 << 4,)) + b"endless", after_s=0.001)
        if frame := bench.step(bench.now_s + 0.001):
            say(bench, answer(frame[1]))
        assert bench.link.online, number
    ages_s = [bench.now_s - getattr(bench.reading, name).t_s for name in ("voltage_v", "status", "temperature_c")]
    assert max(ages_s) < 1.5


def test_a_node_that_breaks_their_transfer_off_for_us_is_asked_again_at_once() -> None:
    bench = online()
    (read, begun), (more, _), *_ = segmented()
    other_asks(bench, read)
    say(bench, begun)
    next_read(bench)
    other_asks(bench, more)
    say(bench, refusal(read, 0x05040001))
    assert text_of(bench.link.abort) == ""
    say(bench, answer(bench.next_frame(within_s=0.1)[1]))
    assert bench.link.online
    assert bench.link.implausible == {}


def test_segments_of_a_block_that_look_like_answers_are_none() -> None:
    bench = online()
    request = next_read(bench, TEMPERATURE)
    before = bench.reading
    other_asks(bench, bytes.fromhex("a00010007f000000"))
    say(bench, bytes.fromhex("c6001000e8030000"))
    other_asks(bench, bytes.fromhex("a300000000000000"))
    for number in range(1, 0x70):  # 0x43 is a value, 0x60 a confirmation
        say(bench, bytes((number,)) + request[1:4] + FORGED.to_bytes(4, "little"), after_s=0.0001)
    assert bench.reading == before
    assert (text_of(bench.link.problem), bench.link.implausible) == ("", {})


def test_what_is_written_in_blocks_is_not_taken_for_requests() -> None:
    bench = online(heartbeat_s=0.5)
    other_asks(bench, bytes.fromhex("c2501f0100100000"))
    say(bench, bytes.fromhex("a4501f017f000000"))
    said = text_of(bench.link.other_master)
    other_asks(bench, bytes.fromhex("2b17100088130000"))
    assert text_of(bench.link.other_master) == said == "another CANopen master writes 0x1F50:01"
    bench.answer_reads(1.1, WORDS)
    other_asks(bench, bytes.fromhex("80501f0100000000"))
    other_asks(bench, bytes.fromhex("2b17100088130000"))
    assert text_of(bench.link.other_master) == "another CANopen master writes 0x1017:00"


def test_a_master_that_reads_a_thousand_times_a_second_makes_no_babble() -> None:
    bench = online()
    for _ in range(3000):
        request = read_request(0x1018, 1)
        other_asks(bench, request)
        say(bench, answer(request, 7))
        if frame := bench.step(bench.now_s + 0.0001):
            say(bench, answer(frame[1]))
    assert text_of(bench.link.problem) == ""


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("02 10", "another CANopen master has stopped this node (NMT)"),
        ("81 00", "another CANopen master has reset all nodes (NMT)"),
        ("80 10", "another CANopen master has set this node to pre-operational (NMT)"),
        ("02 11", ""),
        ("77 10", ""),
        ("02", ""),
    ],
)
def test_who_gave_an_nmt_command_is_said_and_kept_over_the_boot_up(data: str, words: str) -> None:
    bench = online()
    bench.node.on_nmt(bytes.fromhex(data), bench.now_s)
    bench.hear(HEARTBEAT, "00")
    assert text_of(bench.link.other_master) == words


def test_however_much_they_do_is_news_once_a_second() -> None:
    bench = online()
    changes = bench.changes
    for number in range(1000):
        other_asks(bench, write_request(0x2000 + number, 0, 1, 1), read_request(0x3000 + number, 0))
    assert bench.changes - changes <= 2


def test_reading_does_not_hide_what_is_graver() -> None:
    bench = online()
    other_asks(bench, write_request(0x1800, 2, 1, 1), read_request(VOLTS, 0))
    assert text_of(bench.link.other_master) == "another CANopen master writes 0x1800:02"
    bench.answer_reads(1.1, WORDS)
    other_asks(bench, read_request(VOLTS, 0))
    assert text_of(bench.link.other_master) == "another CANopen master reads 0x6000:00"


# --- a forged answer -------------------------------------------------------------------------------------------------

Forge = Callable[[bytes], list[bytes]]


@pytest.mark.parametrize(
    ("forge", "words"),
    [
        (lambda request: [answer(request), answer(request, 600)], "25.0 and 60.0"),
        (lambda request: [answer(request, 200), answer(request)], "20.0 and 25.0"),
        (lambda request: [b"\x4b" + answer(request)[1:], answer(request)], "a size of 2"),
        (lambda request: [answer(request), b"\x4b" + answer(request)[1:]], "a size of 2"),
        (lambda request: [answer(request), refusal(request, 0x06020000)], "25.0 and a refusal"),
        (lambda request: [refusal(request, 0x06020000), answer(request)], "a refusal and 25.0"),
        (lambda request: [answer(request), answer(request, 0x7FFF)], "outside"),
    ],
    ids=["after", "first", "size first", "size after", "refusal after", "refusal first", "sensor"],
)
def test_two_answers_that_differ_are_implausible_at_once(forge: Forge, words: str) -> None:
    bench = online()
    say(bench, *forge(next_read(bench, TEMPERATURE)))
    assert words in text_of(bench.link.implausible["temperature_c"])
    assert bench.changes


def test_one_that_forges_now_and_then_is_not_believed_in_between() -> None:
    bench = online()
    for _ in range(5):
        request = next_read(bench, TEMPERATURE)
        say(bench, answer(request, FORGED), answer(request))
        begun_s = bench.now_s
        while bench.now_s < begun_s + DOUBT_S - 0.2:
            bench.answer_reads(0.1, WORDS)
            assert "temperature_c" in bench.link.implausible
    bench.answer_reads(DOUBT_S + 0.2, WORDS)
    assert bench.link.implausible == {}


def test_where_one_field_of_an_object_is_forged_none_of_it_is_believed() -> None:
    bench = online()
    request = next_read(bench, VOLTS)
    say(bench, answer(request), answer(request, 0x0940FC18))
    assert {name: text_of(why) for name, why in bench.link.implausible.items()} == {
        "voltage_v": "pack voltage: two answers to one request, which differ in pack current",
        "current_a": "pack current: two answers to one request, -0.1 and -10.0",
    }


def test_an_answer_before_the_request_is_never_used_and_one_that_differs_is_found_out() -> None:
    bench = online()
    say(bench, answer(read_request(TEMPERATURE, 0), FORGED))
    assert bench.reading.temperature_c.value == 25.0  # type: ignore[union-attr]  # online
    assert "25.0 and 60.0" in text_of(bench.link.implausible["temperature_c"])


def test_a_repeated_frame_is_no_forgery() -> None:
    bench = online()
    for _ in range(20):
        request = next_read(bench, TEMPERATURE)
        say(bench, answer(request), answer(request))
        bench.answer_reads(0.2, WORDS)
    assert (bench.link.implausible, text_of(bench.link.problem)) == ({}, "")


# --- a heartbeat that somebody else sets -----------------------------------------------------------------------------


def beat(bench: Bench, seconds: float, words: dict[int, int], period_s: float | None) -> None:
    """Let time pass, with a heartbeat each `period_s`."""
    end_s = bench.now_s + seconds
    while bench.now_s < end_s - 1e-6:
        bench.answer_reads(min(period_s or seconds, end_s - bench.now_s), words)
        if period_s:
            bench.hear(HEARTBEAT, "7F")


def oldest_s(bench: Bench) -> float:
    return bench.now_s - (bench.link.heartbeat_t_s or 0.0)


@pytest.mark.parametrize("heartbeat_s", [0.1, 0.5, 2.0])
@pytest.mark.parametrize(("found_ms", "words"), [(0, "was off"), (30_000, "had set the BMU's heartbeat to 30 s")])
def test_a_heartbeat_that_was_set_is_set_again_before_it_counts_as_lost(
    heartbeat_s: float, found_ms: int, words: str
) -> None:
    ours_ms = round(1000 * heartbeat_s)
    bench = Bench(config(heartbeat_s=heartbeat_s))
    bench.answer_reads(0.1, WORDS)
    beat(bench, 5 * heartbeat_s, WORDS | {0x1017: ours_ms}, heartbeat_s)
    assert text_of(bench.link.heartbeat_set) == ""
    heard_s = bench.now_s
    set_to = WORDS | {0x1017: found_ms}
    while text_of(bench.link.heartbeat_set) == "" and bench.now_s < heard_s + 6 * heartbeat_s:
        bench.answer_reads(0.01, set_to)
    assert words in text_of(bench.link.heartbeat_set)
    assert bench.link.heartbeat_set_t_s == pytest.approx(heard_s + 3 * heartbeat_s, abs=0.1)
    while oldest_s(bench) > heartbeat_s:
        bench.answer_reads(0.01, set_to)
        assert oldest_s(bench) < 4.5 * heartbeat_s
    assert bench.sent.count((REQUEST, write_request(0x1017, 0, ours_ms, 2))) == 2


def test_one_that_is_ours_and_does_not_come_is_lost_all_the_same() -> None:
    bench = online(heartbeat_s=0.5)
    beat(bench, 1.5, WORDS, 0.5)
    heard_s = bench.now_s
    bench.answer_reads(6.0, WORDS)
    assert bench.link.heartbeat_t_s == heard_s
    assert text_of(bench.link.heartbeat_set) == ""


def test_setting_it_again_and_again_does_not_make_a_lost_one_look_alive() -> None:
    bench = online(heartbeat_s=0.5)
    beat(bench, 1.5, WORDS, 0.5)
    bench.answer_reads(2.0, WORDS | {0x1017: 0})
    armed_s = bench.link.heartbeat_t_s
    bench.answer_reads(6.0, WORDS | {0x1017: 0})
    assert bench.link.heartbeat_t_s == armed_s


@pytest.mark.parametrize("period_s", [0.1, 1.0])
def test_one_that_comes_at_another_period_is_looked_into(period_s: float) -> None:
    bench = online(heartbeat_s=0.5)
    beat(bench, 1.5, WORDS, 0.5)
    beat(bench, 3.5, WORDS | {0x1017: round(period_s * 1000)}, period_s)
    assert f"to {period_s:g} s; it is set to 0.5 s again" in text_of(bench.link.heartbeat_set)


def test_one_that_is_seen_being_set_is_looked_into_at_once() -> None:
    bench = online(heartbeat_s=0.5)
    beat(bench, 1.5, WORDS, 0.5)
    other_asks(bench, write_request(0x1017, 0, 5000, 2))
    say(bench, b"\x60\x17\x10\0" + bytes(4))
    bench.answer_reads(0.2, WORDS | {0x1017: 5000})
    assert "to 5 s; it is set to 0.5 s again" in text_of(bench.link.heartbeat_set)
    assert text_of(bench.link.other_master) == "another CANopen master writes 0x1017:00"


def test_another_master_with_the_same_period_is_left_alone() -> None:
    bench = online(heartbeat_s=0.5)
    beat(bench, 1.5, WORDS, 0.5)
    sent = len(bench.sent)
    other_asks(bench, write_request(0x1017, 0, 500, 2))
    say(bench, b"\x60\x17\x10\0" + bytes(4))
    bench.answer_reads(0.4, WORDS)
    assert not any(data[1:3] == b"\x17\x10" for _, data in bench.sent[sent:])


def test_a_tpdo_timer_that_somebody_else_sets_is_set_again_once_a_second() -> None:
    bench = online(tpdo_s=0.1)
    sent = len(bench.sent)
    for _ in range(20):
        other_asks(bench, write_request(0x1801, 5, 0, 2))
        say(bench, b"\x60\x01\x18\x05" + bytes(4))
        bench.answer_reads(0.1, WORDS)
    assert 1 <= bench.sent[sent:].count((REQUEST, write_request(0x1801, 5, 100, 2))) <= 2


def test_answers_to_a_master_that_guards_the_node_are_no_unknown_state() -> None:
    bench = online(heartbeat_s=0.5)
    for data, state in (("85", 0x05), ("05", 0x05), ("FF", 0x7F), ("84", 0x04)):
        bench.hear(HEARTBEAT, data)
        assert bench.link.nmt_state == state
    boots = bench.link.boots
    bench.hear(HEARTBEAT, "80")
    assert (bench.link.boots, bench.link.nmt_state) == (boots, 0x04)
