"""The interlock is tried with everything; only what is listed here passes. It imports nothing from the core."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.config.station import ChargerConfig, Limits
from orchestrator.interlock import Grant, grant, permit
from orchestrator.keys import Range
from orchestrator.model import (
    Action,
    BatteryReading,
    Cause,
    ChargeMode,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    Measurement,
    Operation,
    Precharge,
    Snapshot,
)
from orchestrator.text.catalogue import say

NOW_S = 1000.0
LIMITS = Limits(voltage_v=58.4, current_a=12.0, temperature_c=Range(0.0, 45.0))
MANUAL = ChargerConfig(port="p", control=ControlMode.MANUAL, steps_a=(2.0, 5.0, 8.0, 11.0, 14.0))
AUTOMATIC = replace(MANUAL, control=ControlMode.AUTOMATIC)
GOOD = Grant(expires_s=NOW_S + 0.5, voltage_v=50.0, temperature_c=20.0, current_step=2)

#: Every command with values from well below to well above its range.
EVERY = [Command(action, value) for action in Action for value in range(-2, 260)]

STOPS = {Command(Action.STOP, value) for value in range(-2, 260)}
RESUME = Command(Action.RESUME)
RUN = Command(Action.RUN)
SETS = {
    *(Command(Action.SET_LIMIT, step) for step in (0, 1, 2, 3)),  # step 5 is 14 A, above the station's 12 A
    *(Command(Action.SET_MODE, mode) for mode in (3, 4, 5)),
    *(Command(Action.SET_PRECHARGE, function) for function in (0, 1, 2)),
}


def passing(
    grant: Grant | None, charger: ChargerConfig = MANUAL, limits: Limits = LIMITS, now_s: float = NOW_S
) -> set[Command]:
    """The commands permitted, out of all."""
    verdicts = {command: permit(command, grant, now_s, charger, limits) for command in EVERY}
    return {command for command, why in verdicts.items() if why is None}


# --- permit ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", range(6))
def test_no_step_passes_above_what_the_supply_grants(level: int) -> None:
    lower = {command for command in SETS if command.action is not Action.SET_LIMIT or command.value < level}
    runs = {RUN} if level > 2 else set()  # the charger last reported step 3
    expected = STOPS | ({RESUME} | lower | runs if level else set())
    assert passing(replace(GOOD, level=level)) == expected
    assert passing(replace(GOOD, level=level), AUTOMATIC) == STOPS | ({RESUME} if level else set())


def test_what_is_above_the_supply_is_told() -> None:
    refused = permit(Command(Action.SET_LIMIT, 2), replace(GOOD, level=2), NOW_S, MANUAL, LIMITS)
    assert say(refused) == "set_limit: step 3 is above what the supply grants, 2"
    assert permit(RUN, replace(GOOD, current_step=None, level=5), NOW_S, MANUAL, LIMITS) is not None


def test_the_level_of_a_grant_is_the_snapshots() -> None:
    for level in (None, 0, 3):
        found = grant(replace(FRESH, granted=level), NOW_S)
        assert found is not None
        assert found.level == level


def test_in_manual_mode_only_the_listed_orders_pass() -> None:
    assert passing(GOOD) == STOPS | SETS | {RESUME, RUN}


def test_in_automatic_mode_only_stop_and_resume_pass() -> None:
    assert passing(GOOD, AUTOMATIC) == STOPS | {RESUME}


#: Evidence that permits nothing but a stop.
WORTHLESS: Mapping[str, Grant | None] = {
    "none": None,
    "expired now": replace(GOOD, expires_s=NOW_S),
    "expired long ago": replace(GOOD, expires_s=NOW_S - 60.0),
    "expiry not a number": replace(GOOD, expires_s=nan),
    "voltage just too high": replace(GOOD, voltage_v=58.41),
    "voltage infinite": replace(GOOD, voltage_v=inf),
    "voltage not a number": replace(GOOD, voltage_v=nan),
    "just too cold": replace(GOOD, temperature_c=-0.1),
    "just too hot": replace(GOOD, temperature_c=45.1),
    "temperature not a number": replace(GOOD, temperature_c=nan),
}


@pytest.mark.parametrize("charger", [MANUAL, AUTOMATIC], ids=["manual", "automatic"])
@pytest.mark.parametrize("grant", WORTHLESS.values(), ids=WORTHLESS)
def test_without_good_evidence_only_a_stop_passes(grant: Grant | None, charger: ChargerConfig) -> None:
    assert passing(grant, charger) == STOPS


@pytest.mark.parametrize(
    "grant",
    [replace(GOOD, voltage_v=58.4), replace(GOOD, temperature_c=0.0), replace(GOOD, temperature_c=45.0)],
)
def test_a_value_on_the_limit_is_still_inside(grant: Grant) -> None:
    assert passing(grant) == STOPS | SETS | {RESUME, RUN}


def test_the_time_is_the_callers_and_a_grant_runs_out_with_it() -> None:
    assert passing(GOOD, now_s=GOOD.expires_s - 0.001) == STOPS | SETS | {RESUME, RUN}
    assert passing(GOOD, now_s=GOOD.expires_s) == STOPS


@pytest.mark.parametrize("shown", [4, 5, -1, None])
def test_run_is_refused_while_the_charger_shows_a_step_that_is_too_high_or_unknown(shown: int | None) -> None:
    assert passing(replace(GOOD, current_step=shown)) == STOPS | SETS | {RESUME}


@pytest.mark.parametrize("shown", [0, 1, 2, 3])
def test_run_passes_on_every_step_that_the_station_allows(shown: int) -> None:
    assert RUN in passing(replace(GOOD, current_step=shown))


@pytest.mark.parametrize(("current_a", "highest"), [(1.9, -1), (2.0, 0), (7.99, 1), (8.0, 2), (14.0, 4), (nan, -1)])
def test_steps_pass_up_to_the_stations_current(current_a: float, highest: int) -> None:
    limits = replace(LIMITS, current_a=current_a)
    allowed = {command.value for command in passing(GOOD, limits=limits) if command.action is Action.SET_LIMIT}
    assert allowed == set(range(highest + 1))


@pytest.mark.parametrize("shown", [None, -1, 5])
def test_a_step_that_is_unknown_is_told(shown: int | None) -> None:
    why = permit(RUN, replace(GOOD, current_step=shown), NOW_S, MANUAL, LIMITS)
    assert why == Cause.of("step_unknown", command="run", step=shown)


def test_a_step_whose_current_the_station_does_not_state_is_refused() -> None:
    three = replace(MANUAL, steps_a=(2.0, 5.0, 8.0))
    assert Command(Action.SET_LIMIT, 3) not in passing(GOOD, three)
    assert RUN not in passing(replace(GOOD, current_step=3), three)


@pytest.mark.parametrize(
    ("command", "grant", "charger", "why"),
    [
        (RUN, None, MANUAL, "run: no fresh reading of charger, pack voltage and pack temperature"),
        (RUN, replace(GOOD, expires_s=NOW_S - 2), MANUAL, "run: the readings that it rests on are 2.0 s too old"),
        (RUN, replace(GOOD, voltage_v=60.0), MANUAL, "run: 60 V is above the station's 58.4 V"),
        (RESUME, replace(GOOD, temperature_c=50.0), MANUAL, "resume: 50 °C is outside the station's 0 … 45 °C"),
        (RUN, replace(GOOD, current_step=4), MANUAL, "run: step 5 is 14 A, above the station's 12 A"),
        (
            RUN,
            replace(GOOD, current_step=None),
            MANUAL,
            "run: what the charger's current limit – means is not known",
        ),
        (Command(Action.SET_LIMIT, 4), GOOD, MANUAL, "set_limit: step 5 is 14 A, above the station's 12 A"),
        (Command(Action.SET_MODE, 9), GOOD, MANUAL, "set_mode 9 is not a command for a charger in manual mode"),
        (RUN, GOOD, AUTOMATIC, "run 0 is not a command for a charger in automatic mode"),
    ],
)
def test_a_refusal_names_its_reason_with_its_evidence(
    command: Command, grant: Grant | None, charger: ChargerConfig, why: str
) -> None:
    assert say(permit(command, grant, NOW_S, charger, LIMITS)) == why


FLOATS = st.floats()
GRANTS = st.none() | st.builds(Grant, FLOATS, FLOATS, FLOATS, st.none() | st.integers())


@given(grant=GRANTS, value=st.integers(), now_s=FLOATS, control=st.sampled_from(ControlMode))
def test_a_stop_always_passes(grant: Grant | None, value: int, now_s: float, control: ControlMode) -> None:
    charger = replace(MANUAL, control=control, steps_a=())
    assert permit(Command(Action.STOP, value), grant, now_s, charger, LIMITS) is None


# --- grant -----------------------------------------------------------------------------------------------------------

CHARGER = ChargerReading(
    NOW_S - 0.2,
    50.0,
    0.0,
    ControlMode.MANUAL,
    Operation.STOPPED,
    2,
    ChargeMode.FULL,
    Precharge.OFF,
    Connection.NORMAL,
)
BATTERY = BatteryReading(voltage_v=Measurement(49.5, NOW_S - 0.1), temperature_c=Measurement(20.0, NOW_S - 0.3))
FRESH = Snapshot(charger=CHARGER, battery=BATTERY)


def with_ages(charger_s: float, volts_s: float, temperature_s: float) -> Snapshot:
    return Snapshot(
        charger=replace(CHARGER, t_s=NOW_S - charger_s),
        battery=BatteryReading(
            voltage_v=Measurement(49.5, NOW_S - volts_s), temperature_c=Measurement(20.0, NOW_S - temperature_s)
        ),
    )


def test_a_grant_holds_the_evidence() -> None:
    assert grant(FRESH, NOW_S) == Grant(NOW_S + 0.8, 50.0, 20.0, 2)


@pytest.mark.parametrize("persisted", [True, False])
def test_a_grant_says_whether_the_disk_knows_that_the_charger_may_run(persisted: bool) -> None:
    found = grant(replace(FRESH, running_persisted=persisted), NOW_S)
    assert found == Grant(NOW_S + 0.8, 50.0, 20.0, 2, kept=persisted)


def test_the_higher_voltage_counts() -> None:
    higher = replace(BATTERY, voltage_v=Measurement(51.0, NOW_S))
    found = grant(replace(FRESH, battery=higher), NOW_S)
    assert found is not None
    assert found.voltage_v == 51.0


@pytest.mark.parametrize(
    ("ages_s", "left_s"),
    [((0, 0, 0), 1.0), ((0.9, 0, 0), 0.1), ((0, 1.0, 0), 0.5), ((0, 0, 1.25), 0.25), ((0.5, 1.25, 1.0), 0.25)],
)
def test_the_reading_that_gets_too_old_first_ends_the_grant(ages_s: tuple[float, float, float], left_s: float) -> None:
    found = grant(with_ages(*ages_s), NOW_S)
    assert found is not None
    assert found.expires_s == pytest.approx(NOW_S + left_s)


@pytest.mark.parametrize("ages_s", [(1.0, 0, 0), (0, 1.5, 0), (0, 0, 1.5), (60, 60, 60)])
def test_a_reading_that_is_too_old_gives_no_grant(ages_s: tuple[float, float, float]) -> None:
    assert grant(with_ages(*ages_s), NOW_S) is None


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("age_s", [-0.01, nan])
def test_a_reading_from_the_future_gives_no_grant(place: int, age_s: float) -> None:
    ages_s = [0.1, 0.1, 0.1]
    ages_s[place] = age_s
    assert grant(with_ages(*ages_s), NOW_S) is None


@pytest.mark.parametrize(
    "snapshot",
    [
        Snapshot(),
        replace(FRESH, charger=None),
        replace(FRESH, battery=BatteryReading()),
        replace(FRESH, battery=replace(BATTERY, voltage_v=None)),
        replace(FRESH, battery=replace(BATTERY, temperature_c=None)),
    ],
)
def test_a_missing_reading_gives_no_grant(snapshot: Snapshot) -> None:
    assert grant(snapshot, NOW_S) is None


@pytest.mark.parametrize(("place", "value"), list(product(range(3), (nan, inf, -inf))))
def test_what_is_not_a_number_gives_no_grant(place: int, value: float) -> None:
    snapshot = (
        replace(FRESH, charger=replace(CHARGER, voltage_v=value)),
        replace(FRESH, battery=replace(BATTERY, voltage_v=Measurement(value, NOW_S))),
        replace(FRESH, battery=replace(BATTERY, temperature_c=Measurement(value, NOW_S))),
    )[place]
    assert grant(snapshot, NOW_S) is None


def test_the_evidence_may_be_bad_news() -> None:
    """A grant records what was read. Its use is up to `permit` and the station's limits."""
    hot = replace(BATTERY, temperature_c=Measurement(80.0, NOW_S))
    found = grant(replace(FRESH, battery=hot), NOW_S)
    assert found is not None
    assert passing(found) == STOPS


def test_nothing_but_a_stop_passes_before_it_is_on_disk_that_the_charger_may_run() -> None:
    assert passing(replace(GOOD, kept=False)) == STOPS
    assert say(permit(RUN, replace(GOOD, kept=False), NOW_S, MANUAL, LIMITS)) == (
        "run: it is not on disk that this charger may be running"
    )
