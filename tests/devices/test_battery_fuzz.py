"""A BMU and a bus that do anything at all: the node never raises and never believes a foreign answer."""

from collections import deque

from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.model import BatteryReading, Measurement
from orchestrator.model.moment import moment
from orchestrator.protocol.objects import FieldMap
from tests.core.said import say
from tests.devices.bmu_bench import EMERGENCY, HEARTBEAT, REPLY, TABOS, Bench, config

FRAMES = st.tuples(
    st.sampled_from([REPLY, REPLY, REPLY, HEARTBEAT, EMERGENCY, 0x190, 0x290, 0x390]),
    st.one_of(
        st.binary(max_size=8),
        st.builds(
            lambda command, index, word: bytes((command, index, 0x60, 0)) + word,
            st.sampled_from([0x43, 0x4B, 0x4F, 0x60, 0x80, 0x41]),
            st.integers(0, 5),
            st.binary(min_size=4, max_size=4),
        ),
    ),
    st.floats(0.0, 0.7),
)
RANGES: dict[str, FieldMap] = {field.name: field for entry in TABOS.objects for field in entry.fields}


@settings(max_examples=600)
@given(st.lists(FRAMES, max_size=60))
def test_no_frame_makes_it_raise_and_every_value_shown_is_in_range(frames: list[tuple[int, bytes, float]]) -> None:
    bench = Bench(config(heartbeat_s=0.5, tpdo_s=0.1))
    for cob_id, data, pause_s in frames:
        bench.run(pause_s)
        bench.node.on_frame(cob_id, data, bench.now_s)
        for name in BatteryReading.__slots__:
            value = getattr(bench.reading, name)
            if value is not None:
                assert isinstance(value, Measurement)
                assert value.value in RANGES[name].range
                assert value.t_s <= moment(bench.now_s)
        assert bench.link.online == (say(bench.link.problem) == "")
    assert all(cob_id in (0x000, 0x610) for cob_id, _ in bench.sent)


FATES = st.lists(st.tuples(st.floats(0.0, 1.2), st.sampled_from([1, 1, 1, 0, 2])), min_size=5, max_size=80)


@settings(max_examples=600)
@given(FATES)
def test_a_word_is_never_shown_with_the_time_of_another_request(fates: list[tuple[float, int]]) -> None:
    """Every answer carries its request's number as the voltage; a reading must match the request of its time."""
    bench, coming, last_s = Bench(), deque[tuple[float, bytes]](), 0.0
    asked_s: dict[int, float] = {}
    for number, (delay_s, copies) in enumerate(fates):
        while (frame := bench.step(min([bench.now_s + 5.0, *(arrival_s for arrival_s, _ in coming)]))) is None:
            arrival_s, answer = coming.popleft()
            bench.now_s = max(bench.now_s, arrival_s)
            bench.node.on_frame(REPLY, answer, bench.now_s)
            volts = bench.reading.voltage_v
            assert volts is None or moment(asked_s[round(volts.value * 100)]) == volts.t_s
        _, request = frame
        asked_s[number] = bench.now_s
        last_s = min(max(last_s, bench.now_s + delay_s), bench.now_s + 1.29)  # in order, at most the quiet time late
        word = number << 16 if request[1] == 0 else 0
        coming.extend([(last_s, b"\x43" + request[1:4] + word.to_bytes(4, "little"))] * copies)
