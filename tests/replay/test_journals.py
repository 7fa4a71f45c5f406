"""Recorded decisions are reproduced: every journal here, replayed with its own rules."""

import json
from pathlib import Path

import pytest

from orchestrator.model import State
from orchestrator.model.cause import from_plain, plain
from orchestrator.workbench.replay.again import again
from orchestrator.workbench.replay.recording import read
from tests.core.said import say
from tests.replay.record import JOURNALS, SEEDS

PATHS = sorted(JOURNALS.rglob("*.jsonl.gz"))


def test_the_journals_are_there() -> None:
    names = {"demo.jsonl.gz", *(f"script-{seed}.jsonl.gz" for seed in SEEDS)}
    for directory in (JOURNALS, JOURNALS / "version-4"):
        assert {path.name for path in directory.glob("*.gz")} >= names


@pytest.mark.parametrize("path", PATHS, ids=lambda path: str(path.relative_to(JOURNALS)))
def test_every_decision_is_the_one_that_was_recorded(path: Path) -> None:
    wrong = {
        f"{bay} {one.recorded.wall}": one.wrong
        for bay, steps in read([path]).bays.items()
        for one in again(steps)
        if one.wrong
    }
    assert not wrong, "on purpose? python -m tests.replay.record"


def test_they_have_all_that_matters_in_them() -> None:
    taken = [one for path in PATHS for steps in read([path]).bays.values() for one in again(steps)]
    assert len(taken) > 2000
    assert {one.decision.state for one in taken} == set(State)
    assert len({fault.id for one in taken for fault in one.decision.faults}) >= 8


def test_every_cause_that_was_decided_is_read_as_it_was_written_and_said_in_each_language() -> None:
    taken = [one for path in PATHS for steps in read([path]).bays.values() for one in again(steps)]
    causes = {cause for one in taken for cause in (one.decision.cause, *(fault.cause for fault in one.decision.faults))}
    assert len(causes) > 100
    for cause in causes:
        assert from_plain(json.loads(json.dumps(plain(cause)))) == cause
        say(cause)
