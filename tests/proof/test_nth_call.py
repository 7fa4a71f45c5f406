"""The short form of "fail the Nth call": a sample of every call with every error; a leaking boundary is found."""

import pytest

from orchestrator.link import serial as serial_module
from tests.proof.nth_call import ERRORS, Case, cases, charge

#: Every Nth of all failures; `make campaign` plays them all.
SAMPLE = 200
#: Enough to have the error that a boundary is made to leak.
DENSER = 100


@pytest.fixture(name="sample", scope="module")
def _sample() -> list[Case]:
    return list(cases(SAMPLE))


@pytest.mark.parametrize("call", ERRORS)
def test_nothing_but_a_verified_stop_or_a_recovery(call: str, sample: list[Case]) -> None:
    chosen = [case for case in sample if case.call == call]
    for case in chosen:
        assert not charge(case, brief=True).violations, case


def test_every_call_of_a_charge_has_its_errors() -> None:
    assert set(charge(None).calls) == set(ERRORS)


def test_a_charge_goes_on_after_a_port_that_failed() -> None:
    played = charge(Case("write", "EIO", lasting=True, number=500))
    assert (played.word, played.full) == ("recovered", True)


def test_an_exception_that_leaks_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_module, "_FAILURES", (OSError,))
    leaks = [case for case in cases(DENSER) if (case.call, case.error) == ("read", "TypeError")]
    assert any(charge(case, brief=True).violations for case in leaks)
