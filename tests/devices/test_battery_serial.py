"""The serial number of a battery: read once each time its BMU is heard anew, and never in the way of anything."""

import pytest

from orchestrator.devices.battery import ANSWER_LIMIT_S
from orchestrator.devices.serial_number import AFTER_S, MOST_TRIES, RETRY_S
from tests.devices.bmu_bench import HEARTBEAT, REPLY, REQUEST, WORDS, Bench

SERIAL = bytes.fromhex("40 18 10 04 00 00 00 00")
TELLS = "43 18 10 04 D2 04 00 00"  # 1234


def answering(bench: Bench, seconds: float, serial: str | None) -> int:
    """Let a healthy BMU answer for this long, and this to reads of its serial number; returns how many there were."""
    end_s, reads = bench.now_s + seconds, 0
    while frame := bench.step(end_s):
        cob_id, data = frame
        assert cob_id == REQUEST
        bench.now_s += 0.001
        if data == SERIAL:
            reads += 1
            if serial is not None:
                bench.hear(REPLY, serial)
            continue
        word = WORDS[data[1] | data[2] << 8]
        bench.hear(REPLY, (b"\x43" + data[1:4] + word.to_bytes(4, "little")).hex())
    return reads


def assert_well(bench: Bench) -> None:
    assert bench.link.online
    assert bench.link.abort is None


def test_it_is_read_once_when_everything_else_is_known() -> None:
    bench = Bench()
    assert answering(bench, AFTER_S - 0.01, TELLS) == 0
    assert bench.link.serial is None
    assert None not in (bench.reading.voltage_v, bench.reading.soc_pct, bench.reading.temperature_c)
    assert answering(bench, 60.0, TELLS) == 1
    assert bench.link.serial == 1234


@pytest.mark.parametrize("unset", ["00 00 00 00", "FF FF FF FF"])
def test_zero_is_no_serial_number(unset: str) -> None:
    bench = Bench()
    assert answering(bench, 60.0, f"43 18 10 04 {unset}") == 1
    assert bench.link.serial == 0


@pytest.mark.parametrize("code", ["00 00 02 06", "11 00 09 06"])
def test_a_bmu_without_the_object_is_not_asked_again(code: str) -> None:
    """And it is no fault: nothing is wrong."""
    bench = Bench()
    assert answering(bench, 60.0, f"80 18 10 04 {code}") == 1
    assert bench.link.serial == 0
    assert_well(bench)


@pytest.mark.parametrize("answer", ["80 18 10 04 22 00 00 08", None])
def test_what_may_pass_is_tried_again_a_few_times(answer: str | None) -> None:
    bench = Bench()
    assert answering(bench, AFTER_S + (MOST_TRIES - 1) * RETRY_S + 1, answer) == MOST_TRIES
    told = [bench.link.serial]
    assert answering(bench, 60.0, answer) == 0
    told.append(bench.link.serial)
    assert told == [None, 0]
    assert_well(bench)


def test_a_bmu_that_does_not_answer_it_stays_fresh_in_everything_else() -> None:
    bench = Bench()
    for _ in range(40):
        answering(bench, 0.5, None)
        volts = bench.reading.voltage_v
        assert volts is not None
        assert bench.now_s - volts.t_s < 0.5


def test_it_is_read_again_after_a_boot() -> None:
    bench = Bench()
    answering(bench, 10.0, TELLS)
    bench.hear(HEARTBEAT, "00")
    assert bench.link.serial is None
    assert answering(bench, 10.0, "43 18 10 04 D3 04 00 00") == 1
    assert bench.link.serial == 1235


def test_it_is_read_again_after_a_silence() -> None:
    bench = Bench()
    answering(bench, 10.0, TELLS)
    bench.run(ANSWER_LIMIT_S + 1)
    assert not bench.link.online
    assert bench.link.serial == 1234, "until it is heard again, nothing else is known"
    assert SERIAL not in [data for _, data in bench.run(30.0)]
    answering(bench, 1.0, TELLS)
    assert bench.link.serial is None
    assert answering(bench, 10.0, TELLS) == 1
    assert bench.link.serial == 1234


def test_a_boot_gives_another_chance_to_a_bmu_that_did_not_answer() -> None:
    bench = Bench()
    answering(bench, 60.0, None)
    bench.hear(HEARTBEAT, "00")
    assert answering(bench, 60.0, None) == MOST_TRIES
