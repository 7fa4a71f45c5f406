"""What survives a restart, at its edges: every age, every counter."""

from dataclasses import replace

import pytest

from orchestrator.core.memory import FaultMemory
from orchestrator.core.persisted import COUNTERS_S, Persisted, PersistedFault
from orchestrator.model import Session, State
from tests.core.said import cause
from tests.core.world import remembering

S = State
SESSION = Session(10.0, unseen_s=1.0, pulse_s=2.0, continuous_s=0.5, rise_s=4.0)
PULSING = replace(SESSION, continuous_s=0.0)


@pytest.mark.parametrize(
    ("kept", "seconds", "unseen_s", "aged"),
    [
        (PULSING, 5.0, None, Session(15.0, unseen_s=6.0, pulse_s=7.0, continuous_s=0.0, rise_s=9.0)),
        (SESSION, 5.0, None, Session(15.0, unseen_s=6.0, pulse_s=2.0, continuous_s=5.5, rise_s=9.0)),
        (SESSION, COUNTERS_S, None, Session(40.0, unseen_s=31.0, pulse_s=2.0, continuous_s=30.5, rise_s=34.0)),
        (SESSION, 99.0, None, Session(109.0, unseen_s=31.0, pulse_s=2.0, continuous_s=30.5, rise_s=34.0)),
        (SESSION, 99.0, 7.0, Session(109.0, unseen_s=8.0, pulse_s=2.0, continuous_s=7.5, rise_s=11.0)),
        (PULSING, 99.0, 7.0, Session(109.0, unseen_s=8.0, pulse_s=9.0, continuous_s=0.0, rise_s=11.0)),
    ],
)
def test_a_charger_that_ran_went_on_unseen(
    kept: Session, seconds: float, unseen_s: float | None, aged: Session
) -> None:
    """At most until its counters were due to be written; it stayed in the stage of precharge that it was in."""
    assert Persisted(running=True, session=kept).aged(seconds, unseen_s).session == aged


def test_a_charger_at_rest_counts_nothing_unseen() -> None:
    assert Persisted(session=SESSION).aged(5.0).session == replace(SESSION, started_s=15.0)
    assert Persisted(running=True).aged(5.0).session is None


def test_every_age_grows() -> None:
    written = Persisted(
        uncontrollable=1.0, resets=((2.0, "runaway"), (1.0, "late")), full=3.0, soc=(4.0, 50.0),
        faults={
            "runaway": PersistedFault(raised=5.0, clean=6.0, strikes=(7.0, 8.0)), "late": PersistedFault(raised=9.0)
        },
    )  # fmt: skip
    assert written.aged(10.0) == Persisted(
        uncontrollable=11.0, resets=((12.0, "runaway"), (11.0, "late")), full=13.0, soc=(14.0, 50.0),
        faults={
            "runaway": PersistedFault(raised=15.0, clean=16.0, strikes=(17.0, 18.0)),
            "late": PersistedFault(raised=19.0),
        },
    )  # fmt: skip
    assert Persisted().aged(10.0) == Persisted()


def test_times_are_written_as_ages_and_read_back() -> None:
    memory = remembering(resets=((90.0, "runaway"),), charge=(95.0, 50.0), full_s=70.0)
    written = Persisted.of(memory, 100.0)
    assert (written.resets, written.soc, written.full) == (((10.0, "runaway"),), (5.0, 50.0), 30.0)
    read = written.memory(1000.0)
    assert read.operator.resets == ((990.0, "runaway"),)
    assert read.battery.charge == (995.0, 50.0)
    assert read.battery.full_s == 970.0


def test_a_soc_that_nobody_knows_is_not_written() -> None:
    written = Persisted.of(remembering(charge=(95.0, None)), 100.0)
    assert written.soc is None
    assert written.memory(1000.0).battery.charge == (0.0, None)


@pytest.mark.parametrize(
    ("state", "intends", "unverified", "running"),
    [
        (S.CHARGING, False, False, True),
        (S.QUALIFYING, True, False, True),
        (S.OFFLINE, False, True, True),
        (S.QUALIFYING, False, False, False),
        (S.IDLE, False, False, False),
    ],
)
def test_whether_the_charger_may_be_running(state: State, intends: bool, unverified: bool, running: bool) -> None:
    memory = remembering(state=state, intends=intends, unverified=unverified)
    assert Persisted.of(memory, 100.0).running is running


def test_of_a_fault_that_is_over_only_its_strikes_are_written() -> None:
    over = FaultMemory(cause=cause("SOC 140 %"), strikes=(40.0, 90.0))
    active = replace(over, raised_s=90.0, clean_s=95.0)
    memory = remembering(faults={"implausible": over, "late": active, "overrun": FaultMemory(seen_s=1.0)})
    assert Persisted.of(memory, 100.0).faults == {
        "implausible": PersistedFault(strikes=(60.0, 10.0)),
        "late": PersistedFault(cause("SOC 140 %"), raised=10.0, clean=5.0, strikes=(60.0, 10.0)),
    }


@pytest.mark.parametrize(
    ("state", "stopping_s", "since_s", "age_s"),
    [
        (S.UNCONTROLLABLE, 80.0, 90.0, 20.0),
        (S.UNCONTROLLABLE, None, 90.0, 10.0),
        (S.UNCONTROLLABLE, None, None, 0.0),
        (S.STOPPING, 80.0, 90.0, None),
    ],
)
def test_how_long_a_charger_has_been_out_of_control(
    state: State, stopping_s: float | None, since_s: float | None, age_s: float | None
) -> None:
    memory = remembering(state=state, stopping_s=stopping_s, since_s=since_s)
    assert Persisted.of(memory, 100.0).uncontrollable == age_s
