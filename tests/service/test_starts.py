"""Whose turn it is to start, and whose BMU moves: the facts each bay gets, from the views of all bays."""

from dataclasses import replace

import pytest

from orchestrator.core.memory import Memory
from orchestrator.core.witnesses.followed import Witnessed
from orchestrator.model import (
    BatteryReading,
    ChargeMode,
    ChargerReading,
    Connection,
    ControlMode,
    Measurement,
    Operation,
    Precharge,
    Snapshot,
    State,
)
from orchestrator.service.starts import TURN_S, Starts
from orchestrator.text.catalogue import say
from tests.core.world import remembering

READY = remembering(state=State.QUALIFYING, ready=True)
BEGUN = Memory(state=State.CHARGING)
PROVED = Memory(state=State.CHARGING, witnessed=Witnessed(proved=True))
READING = ChargerReading(
    0.0, 48.0, 0.0, ControlMode.MANUAL, Operation.RUNNING, 4, ChargeMode.CHARGE, Precharge.OFF, Connection.NORMAL
)


def shows(charger_a: float = 0.0, bmu_a: float = 0.0) -> Snapshot:
    return Snapshot(
        charger=replace(READING, current_a=charger_a), battery=BatteryReading(current_a=Measurement(bmu_a, 0.0))
    )


def turns(stagger_s: float = 3.0) -> Starts:
    """It is bay-1's turn; bay-2 is there too."""
    starts = Starts(stagger_s, "station.yaml:9")
    starts.follow("bay-2", 10.0, Memory(), shows())
    starts.follow("bay-1", 10.0, READY, shows())
    return starts


def test_a_bay_begins_when_it_is_its_turn_and_the_others_wait() -> None:
    starts = turns()
    assert say(starts.waits("bay-1", 10.2)) == ""
    assert say(starts.waits("bay-2", 10.2)) == "waits for its turn: bay-1 begins its charge"


def test_nobody_begins_without_a_turn() -> None:
    assert say(Starts(3.0, "station.yaml:9").waits("bay-1", 10.0)) == (
        "waits for its turn: charges of this station begin 3 s apart (station.yaml:9)"
    )


def test_a_station_that_does_not_stagger_lets_everybody_begin() -> None:
    starts = turns(stagger_s=0.0)
    assert (say(starts.waits("bay-1", 10.2)), say(starts.waits("bay-2", 10.2))) == ("", "")


@pytest.mark.parametrize(("after_s", "gets"), [(2.9, False), (3.0, True)])
def test_the_next_turn_comes_once_the_first_amperes_were_seen_and_the_time_has_passed(
    after_s: float, gets: bool
) -> None:
    starts = turns()
    starts.follow("bay-1", 11.0, BEGUN, shows(0.0))
    starts.follow("bay-1", 12.0, PROVED, shows(14.0, 14.0))
    starts.follow("bay-2", 11.0 + after_s, READY, shows())
    assert (say(starts.waits("bay-2", 11.0 + after_s)) == "") is gets


def test_a_bay_that_is_not_proved_keeps_its_turn_until_it_is_over() -> None:
    starts = turns()
    starts.follow("bay-1", 11.0, BEGUN, shows(14.0))
    starts.follow("bay-2", 15.0, READY, shows())
    assert say(starts.waits("bay-2", 15.0))
    starts.follow("bay-1", 15.1, Memory(state=State.STOPPING), shows())
    starts.follow("bay-2", 15.2, READY, shows())
    assert say(starts.waits("bay-2", 15.3)) == ""


def test_a_turn_that_nobody_uses_ends() -> None:
    starts = turns()
    assert say(starts.waits("bay-2", 10.0 + TURN_S)) == "waits for its turn: bay-1 begins its charge"
    assert "begin 3 s apart" in say(starts.waits("bay-2", 10.1 + TURN_S))
    starts.follow("bay-2", 10.2 + TURN_S, READY, shows())
    assert say(starts.waits("bay-2", 10.3 + TURN_S)) == ""


def test_the_bay_whose_bmu_moves_instead_is_named() -> None:
    starts = turns()
    starts.follow("bay-1", 11.0, BEGUN, shows())
    starts.follow("bay-2", 12.0, Memory(), shows(0.0, 13.8))
    starts.follow("bay-1", 12.1, BEGUN, shows(14.0, 0.0))
    assert starts.moves("bay-1") == "bay-2"
    assert starts.moves("bay-2") == ""


def test_a_bay_that_raises_its_own_step_is_not_moved() -> None:
    starts = turns()
    starts.follow("bay-2", 10.5, BEGUN, shows(5.0, 5.0))
    starts.follow("bay-1", 11.0, BEGUN, shows())
    starts.follow("bay-2", 12.0, BEGUN, shows(14.0, 14.0))
    starts.follow("bay-1", 12.1, BEGUN, shows(14.0, 0.0))
    assert starts.moves("bay-1") == ""
