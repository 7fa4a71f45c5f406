"""Contactors the guardian opens when nothing else is left."""

import os
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.lastresort.guardian import ACTED, CONTACTOR, DONE
from orchestrator.lastresort.lastopen import OPEN, SET_VALUES
from orchestrator.service.guarded import GuardianLink
from tests.guardian.chargers import running_chargers
from tests.guardian.watched import END_S, watched
from tests.waiting import wait_until

#: A charger that has obeyed has no current.
OBEYED_S = 0.2


class Contactor:
    """A pipe in place of a line."""

    def __init__(self) -> None:
        self.reader, self.writer = os.pipe()
        os.set_blocking(self.reader, False)
        self.opened_s: float | None = None  #: when it was first opened

    def opened(self) -> int:
        """How often it was opened since the last call; asserts that nothing else was done to it."""
        try:
            asked = list(struct.iter_unpack("=dI16s", os.read(self.reader, 4096)))
        except BlockingIOError:
            return 0
        assert {tuple(ask[1:]) for ask in asked} == {(SET_VALUES, OPEN)}
        self.opened_s = self.opened_s or asked[0][0]
        return len(asked)

    def close(self) -> None:
        os.close(self.reader)
        os.close(self.writer)


@pytest.fixture
def contactor() -> Iterator[Contactor]:
    made = Contactor()
    yield made
    made.close()


def test_a_contactor_opens_after_the_charger_has_had_its_stop(tmp_path: Path, contactor: Contactor) -> None:
    """Without load where the stop was obeyed: a contactor breaking a current may weld."""
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(CONTACTOR + b"bay-1", contactor.writer)
        guardian.beat()
        assert contactor.opened() == 0
        guardian.link.close()
        wait_until(lambda: contactor.opened() > 0, END_S)
        assert not bench.runs
        stop_s = bench.wire.counters.first_stop_s
        assert contactor.opened_s is not None
        assert stop_s is not None
        assert contactor.opened_s - stop_s > OBEYED_S
        assert guardian.ended() == ACTED
        assert guardian.log.splitlines()[-1] == "guardian: contactor bay-1: open"


def test_a_charger_that_does_not_obey_is_cut_off_within_a_second(tmp_path: Path, contactor: Contactor) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, "VERIFY_S=5") as guardian:
        bench.charger.ignores_stop = True
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(CONTACTOR + b"bay-1", contactor.writer)
        guardian.beat()
        guardian.link.close()
        wait_until(lambda: contactor.opened() > 0, END_S)
        assert guardian.process.poll() is None, "it goes on to stop the charger"
        assert bench.runs
        assert bench.stops <= 2 * 2, "in the first round; one more on a busy machine"


@pytest.mark.parametrize("orderly", [True, False])
def test_contactors_open_where_no_charger_has_to_be_stopped(
    tmp_path: Path, contactor: Contactor, *, orderly: bool
) -> None:
    with watched(tmp_path, controller="pass") as guardian:
        guardian.send(CONTACTOR + b"bay-1", contactor.writer)
        guardian.beat()
        if orderly:
            guardian.send(DONE)
        guardian.link.close()
        assert guardian.ended() == 0
        assert contactor.opened() == 1


def test_a_line_that_is_given_back_is_free(tmp_path: Path, contactor: Contactor) -> None:
    with watched(tmp_path, controller="pass") as guardian:
        guardian.beat()
        before = guardian.files
        for _ in range(2):  # the second one takes the first one's place
            guardian.send(CONTACTOR + b"bay-1", contactor.writer)
        guardian.beat()
        wait_until(lambda: guardian.files == before + 1)
        guardian.send(CONTACTOR + b"bay-1")
        guardian.beat()
        wait_until(lambda: guardian.files == before)
        guardian.link.close()
        assert guardian.ended() == 0
        assert contactor.opened() == 0


def test_the_controllers_own_words_for_a_line_are_understood(tmp_path: Path, contactor: Contactor) -> None:
    other = Contactor()
    with watched(tmp_path, controller="pass") as guardian:
        link = GuardianLink(os.dup(guardian.link.fileno()))
        link.hold_contactor("bay-1", contactor.writer)
        link.hold_contactor("bay-2", other.writer)
        link.hold_contactor("bay-2", None)
        link._socket.close()
        guardian.link.close()
        assert guardian.ended() == 0
    assert (contactor.opened(), other.opened()) == (1, 0)
    other.close()
