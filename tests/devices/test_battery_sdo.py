"""No answer is ever matched to the wrong request, whatever is lost, late or doubled."""

from collections import deque
from itertools import count

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.devices.sdo_client import QUIET_S, Key, SdoClient, Verdict
from orchestrator.model import Cause
from orchestrator.protocol.sdo import SdoAbort, SdoMalformed, SdoReply, SdoValue, SdoWritten

TIMEOUT_S = 0.3
#: The longest delay a node can have without being misunderstood: the time-out plus a second of quiet.
LATEST_S = 1.3
VOLTS, STATUS, SOC = (0x6000, 0), (0x6001, 0), (0x6002, 0)


def value(key: Key, number: int = 0) -> SdoValue:
    return SdoValue(*key, number, 4)


def late(*keys: Key) -> tuple[SdoClient, float]:
    """A client that asked for these in turn and got no answer."""
    client, now_s = SdoClient(TIMEOUT_S), 0.0
    for key in keys:
        client.ask(key, now_s)
        now_s += TIMEOUT_S
        assert client.expire(now_s)
    return client, now_s


def test_the_answer_ends_the_request() -> None:
    client = SdoClient(TIMEOUT_S)
    client.ask(VOLTS, 0.0)
    assert client.take(value(VOLTS), 0.01) is Verdict.ACCEPTED
    assert client.pending is None
    assert not client.expire(9.0)


def test_an_object_is_not_asked_again_before_another_one_was_answered() -> None:
    client, now_s = late(VOLTS)
    assert not client.may_ask(VOLTS)
    client.ask(STATUS, now_s)
    assert client.take(value(STATUS), now_s + 0.01) is Verdict.ACCEPTED
    assert client.may_ask(VOLTS)  # in order: everything asked before STATUS is done
    assert not client.may_ask(STATUS)  # it may be repeated by the bus


def test_a_late_answer_is_discarded_and_clears_what_was_asked_before_it() -> None:
    client, now_s = late(VOLTS, STATUS)
    client.ask(SOC, now_s)
    assert client.take(value(STATUS), now_s) is Verdict.LATE
    assert client.pending == SOC
    assert client.take(value(SOC), now_s) is Verdict.ACCEPTED
    assert client.may_ask(VOLTS)


def test_an_answer_behind_the_deadline_is_late_even_if_nobody_looked_in_between() -> None:
    client = SdoClient(TIMEOUT_S)
    client.ask(VOLTS, 0.0)
    assert client.take(value(VOLTS), TIMEOUT_S) is Verdict.LATE


def test_a_second_answer_and_one_that_nobody_asked_for_are_told_apart() -> None:
    client = SdoClient(TIMEOUT_S)
    client.ask(VOLTS, 0.0)
    assert client.take(value(VOLTS), 0.01) is Verdict.ACCEPTED
    assert client.take(value(VOLTS, 7), 0.02) is Verdict.SECOND
    assert client.first == value(VOLTS)
    assert client.take(value(SOC), 0.03) is Verdict.STRAY


def test_a_late_abort_clears_like_a_value() -> None:
    client, now_s = late(VOLTS)
    client.ask(STATUS, now_s)
    assert client.take(SdoAbort(*STATUS, 0x06020000), now_s) is Verdict.ACCEPTED
    assert client.may_ask(VOLTS)


@pytest.mark.parametrize(("write", "reply"), [(True, value(VOLTS)), (False, SdoWritten(*VOLTS))])
def test_a_value_does_not_answer_a_write_nor_the_other_way_round(write: bool, reply: SdoReply) -> None:
    client = SdoClient(TIMEOUT_S)
    client.ask(VOLTS, 0.0, write=write)
    assert client.take(reply, 0.01) is Verdict.STRAY
    assert client.pending == VOLTS


def test_a_malformed_answer_changes_nothing() -> None:
    client = SdoClient(TIMEOUT_S)
    client.ask(VOLTS, 0.0)
    assert client.take(SdoMalformed(Cause.of("sdo_length", size=0, expected=8, data="")), 0.01) is Verdict.MALFORMED
    assert client.pending == VOLTS


def test_the_quiet_time_runs_from_the_deadline_and_from_every_answer() -> None:
    client, now_s = late(VOLTS)
    assert client.quiet_s == now_s + QUIET_S
    client.take(value(SOC), now_s + 0.5)
    assert client.quiet_s == now_s + 0.5 + QUIET_S


def test_after_a_broken_bus_the_answer_may_still_come() -> None:
    client = SdoClient(TIMEOUT_S)
    client.ask(VOLTS, 0.0)
    client.drop()
    assert not client.may_ask(VOLTS)
    assert client.take(value(VOLTS), 0.1) is Verdict.LATE


class Wire:
    """A node that answers requests in order with individual delays, some never, some twice."""

    def __init__(self) -> None:
        self.coming: deque[tuple[float, SdoReply]] = deque()
        self._last_s = 0.0

    def ask(self, key: Key, number: int, now_s: float, delay_s: float, copies: int) -> None:
        # Answers keep their order; no delay exceeds what the quiet time covers.
        self._last_s = min(max(self._last_s, now_s + delay_s), now_s + LATEST_S - 0.001)
        self.coming.extend([(self._last_s, value(key, number))] * copies)


DELAY_S = st.one_of(st.just(0.005), st.floats(0.0, LATEST_S))
FATES = st.lists(st.tuples(DELAY_S, st.sampled_from([1, 1, 1, 0, 2, 3])), min_size=1, max_size=60)


@settings(max_examples=600)
@given(fates=FATES, objects=st.integers(1, 5), step_s=st.sampled_from([0.01, 0.1, 0.37]))
def test_no_value_is_accepted_for_a_request_that_it_does_not_belong_to(
    fates: list[tuple[float, int]], objects: int, step_s: float
) -> None:
    client, wire, now_s, numbers, accepted = SdoClient(TIMEOUT_S), Wire(), 0.0, count(1), 0
    keys = deque((0x6000 + i, 0) for i in range(objects))
    number = 0
    todo = deque(fates)
    while todo or wire.coming:
        while wire.coming and wire.coming[0][0] <= now_s:
            arrival_s, reply = wire.coming.popleft()
            client.expire(arrival_s)
            if client.take(reply, arrival_s) is Verdict.ACCEPTED:
                assert isinstance(reply, SdoValue)
                assert reply.value == number, "the answer to an earlier request was accepted"
                accepted += 1
        client.expire(now_s)
        if client.pending is None and now_s >= client.quiet_s and not any(map(client.may_ask, keys)):
            client.clear()
        free = next((key for key in keys if client.may_ask(key)), None)
        if todo and free is not None:
            delay_s, copies = todo.popleft()
            number = next(numbers)
            client.ask(free, now_s)
            wire.ask(free, number, now_s, delay_s, copies)
            keys.rotate(-1)
        now_s += step_s
    if objects > 1 and all(fate == (0.005, 1) for fate in fates):
        assert accepted == len(fates)  # when nothing goes wrong every answer counts
