"""What the parts of the memory keep from one decision to the next, at their edges: the whole part."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.core import latches, sequence
from orchestrator.core.facts import Facts
from orchestrator.core.faults import ROW
from orchestrator.core.history import battery, charger, entered
from orchestrator.core.history import session as sessions
from orchestrator.core.memory import BatteryHistory, ChargerHistory, FaultMemory, Sequence, Stage, Still, Stop
from orchestrator.core.sequence import RUN
from orchestrator.core.states import ENERGISED
from orchestrator.model import (
    BatteryReading,
    ChargeMode,
    ControlMode,
    CurrentStep,
    Measurement,
    Session,
    State,
)
from tests.core.edges import BMU, CONTINUOUS, NOW_S, PULSE, STANDS_BY, UNHEARD, Edge, ago
from tests.core.said import cause

S = State
WHY = cause("the reason")

# --- a state that begins ----------------------------------------------------------------------------------------------

BEFORE: dict[str, Any] = {
    "confirmed": True, "command": RUN, "command_s": 3.0, "tries": 2, "resumed": True, "resume_s": 4.0,
    "full_pct": 90.0, "search_s": 5.0, "idle_s": 6.0, "wake_s": 7.0, "counted_t_s": 8.0, "taper_s": 9.0,
}  # fmt: skip


def enters(state: State) -> Any:
    """Everything that is remembered when this state has just begun."""

    def after(f: Facts) -> tuple[object, ...]:
        now = entered(f, state, WHY)
        assert (now.state, now.since_s, now.stage) == (state, NOW_S, Stage())
        return now.stop, now.charger, now.sequence, now.session, now.battery

    after.__name__ = f"enters {state}"
    return after


KNOWN_CHARGER = ChargerHistory(runs_s=ago(50), search_s=5.0, idle_s=6.0, wake_s=7.0, counted_t_s=8.0)
KNOWN_BATTERY = BatteryHistory(full_pct=90.0)
OPEN = Session(1.0, charged_ah=2.0)
TOLD = Sequence(RUN, 3.0, 2, resumed=True, resume_s=4.0)
ENTERED = (
    # current stops: nothing is confirmed or commanded any more, the charge goes on
    Edge(enters(S.STOPPING), (Stop(WHY, NOW_S), KNOWN_CHARGER, replace(TOLD, command=None), OPEN, KNOWN_BATTERY),
         {**BEFORE, "session": OPEN}),
    # current begins: a new charge …
    Edge(enters(S.CHARGING), (
        Stop(unverified=True), ChargerHistory(runs_s=ago(50), counted_t_s=NOW_S),
        replace(TOLD, command=None, resumed=False, resume_s=NOW_S),
        Session(NOW_S, soc_start_pct=50.0, soc_pct=50.0), BatteryHistory()), BEFORE, S.QUALIFYING),
    # … or an open one
    Edge(enters(S.CHARGING), (
        Stop(unverified=True), replace(KNOWN_CHARGER, search_s=0.0, idle_s=0.0),
        replace(TOLD, command=None, resumed=False, resume_s=NOW_S), OPEN, BatteryHistory()),
        {**BEFORE, "session": OPEN}, S.QUALIFYING),
    # it goes on in another stage, as it is commanded
    Edge(enters(S.CHARGING), (Stop(unverified=True), KNOWN_CHARGER, TOLD, OPEN, KNOWN_BATTERY),
         {**BEFORE, "session": OPEN}, CONTINUOUS),
    Edge(enters(S.CHARGING), (Stop(unverified=True), KNOWN_CHARGER, TOLD, None, KNOWN_BATTERY), BEFORE, CONTINUOUS),
)  # fmt: skip


def test_what_ends_is_unchanged_if_nothing_was_commanded() -> None:
    known = Sequence(command_s=3.0)
    assert sequence.ends(known) is known
    assert sequence.ends(TOLD) == replace(TOLD, command=None)


# --- the charger ------------------------------------------------------------------------------------------------------

STILL = Still(ago(9), 48.0, 10.0, 48.0, 10.0)
STEP_5 = {"step": CurrentStep(4, 14.0, cause(""))}


def of_charger(f: Facts) -> ChargerHistory:
    return charger.update(f, 0.25)


def shows(**known: Any) -> ChargerHistory:
    """The history of a running charger that shows step 5, and whose values have stood still."""
    return ChargerHistory(**{"runs_s": ago(50), "limit": 4, "still": STILL, **known})


KEPT = {"still": STILL, "limit": 4}
CHARGER = (
    # unheard: it does not run, and its values are not compared
    Edge(of_charger, ChargerHistory(), {"still": STILL}, charger=UNHEARD),
    Edge(of_charger, ChargerHistory(), {"still": STILL, "runs_s": None}, charger=UNHEARD),
    Edge(of_charger, ChargerHistory(), {"still": None}, charger=UNHEARD),
    # the reading up to which a charge is counted
    Edge(of_charger, shows(counted_t_s=5.0), {**KEPT, "counted_t_s": 5.0}),
    Edge(of_charger, shows(counted_t_s=NOW_S), {**KEPT, "counted_t_s": 5.0, "session": OPEN}),
    # the step that it shows
    Edge(of_charger, shows(limit_before=2, limit_s=1.0), {**KEPT, "limit_before": 2, "limit_s": 1.0}),
    Edge(of_charger, shows(limit_before=2, limit_s=NOW_S),
         {**KEPT, "limit": 2, "limit_before": 1, "limit_s": 1.0}),
    Edge(of_charger, shows(confirmed=True), {**KEPT, **STEP_5}),
    Edge(of_charger, shows(), {**KEPT, **STEP_5, "confirmed": True}, control=ControlMode.AUTOMATIC),
    Edge(of_charger, shows(), {**KEPT, **STEP_5}, control=ControlMode.AUTOMATIC),
    Edge(of_charger, shows(), {**KEPT, **STEP_5}, S.STOPPING, bmu={"current_a": 10.0}),
    # and one that reverts
    Edge(of_charger, shows(limit=2, limit_before=4, limit_s=NOW_S, reverts=(ago(59.9), NOW_S)),
         {**KEPT, **STEP_5, "confirmed": True, "reverts": (ago(60), ago(59.9))}, charger={"current_step": 2}),
    Edge(of_charger, shows(limit=2, limit_before=4, limit_s=NOW_S, reverts=(ago(60),)),
         {**KEPT, **STEP_5, "reverts": (ago(60),)}, charger={"current_step": 2}),
)  # fmt: skip


def test_another_step_is_to_be_confirmed_anew() -> None:
    assert charger.told_anew(shows(confirmed=True)) == shows()
    known = shows()
    assert charger.told_anew(known) is known


@pytest.mark.parametrize(("state", "stage"), [(PULSE, (5.25, 6.0)), (CONTINUOUS, (5.0, 6.25)), (S.CHARGING, None)])
def test_precharge_is_counted_by_its_stage(state: State, stage: tuple[float, float] | None) -> None:
    f = Edge(of_charger, None, {"session": Session(0.0, pulse_s=5.0, continuous_s=6.0, rise_s=7.0)}, state).facts
    after = sessions.update(f, 0.25, None)
    assert after is not None
    assert (after.pulse_s, after.continuous_s) == (stage or (5.0, 6.0))
    assert after.rise_s == (7.25 if stage else 7.0)
    assert after.energised_s == (0.25 if state in ENERGISED else 0.0)


# --- the battery ------------------------------------------------------------------------------------------------------

SOC_50, C_20 = (NOW_S, 50.0), (NOW_S, 20.0)


def of_battery(f: Facts) -> BatteryHistory:
    return battery.update(f)


def heard(**values: tuple[float, float]) -> dict[str, Any]:
    """Some of the BMU's values, with their ages."""
    return {"battery": replace(BMU, **{name: Measurement(x, ago(age_s)) for name, (x, age_s) in values.items()})}


def was(**known: Any) -> dict[str, Any]:
    """What was known of a battery at rest."""
    return {"full_s": 5.0, "charge": SOC_50, "sample": C_20, **known}


def after(**known: Any) -> BatteryHistory:
    return BatteryHistory(**was(**known))


OLDER, OLD = (ago(20), 18.0), (ago(1), 19.0)
BATTERY = (
    Edge(of_battery, after(), was(), S.IDLE),
    # only the SOC is new, or only the temperature
    Edge(of_battery, after(), was(charge=(ago(1), 50.0)), S.IDLE),
    Edge(of_battery, after(sample_before=OLD, warmth=(OLDER, C_20)), was(sample=OLD, warmth=(OLDER,)), S.IDLE),
    Edge(of_battery, after(sample_before=OLDER, warmth=(OLD,)), was(sample_before=OLDER, warmth=(OLD,)), S.IDLE),
    Edge(of_battery, after(sample_before=None, warmth=(C_20,)), was(sample=None), S.IDLE),
    # after a silence nothing is compared
    Edge(of_battery, after(sample=None), was(sample=OLD, sample_before=OLDER, warmth=(OLDER,)), S.IDLE,
         snapshot=heard(temperature_c=(19.0, 2.0))),
    Edge(of_battery, after(sample=None), was(sample=OLD, sample_before=OLDER, warmth=(OLDER,)), S.IDLE,
         bmu={"temperature_c": None}),
    Edge(of_battery, after(charge=(ago(5), 50.0)), was(charge=(ago(5), 50.0)), S.IDLE,
         snapshot=heard(soc_pct=(50.0, 4.0))),
    Edge(of_battery, after(charge=(ago(5), 50.0)), was(charge=(ago(5), 50.0)), S.IDLE, bmu={"soc_pct": None}),
    # a plug that was loose is told once
    Edge(of_battery, after(), was(returned_s=ago(0.25)), S.IDLE),
    Edge(of_battery, after(returned_s=NOW_S, left_as=(50.0, 48.0)), was(left_s=ago(59), left_as=(50.0, 48.0)), S.IDLE),
    Edge(of_battery, after(left_as=(50.0, 48.0)), was(left_s=ago(60), left_as=(50.0, 48.0)), S.IDLE),
    # the highest SOC under charge
    Edge(of_battery, after(peak=SOC_50), was()),
    Edge(of_battery, after(peak=(ago(9), 50.5)), was(peak=(ago(9), 50.5))),
)  # fmt: skip

# --- faults of a battery that is taken out ----------------------------------------------------------------------------

GONE: dict[str, Any] = {
    "state": S.IDLE, "charger": {**STANDS_BY, "voltage_v": 0.0}, "bmu_link": {"online": False},
    "snapshot": {"battery": BatteryReading()},
}  # fmt: skip


def faults(f: Facts) -> tuple[tuple[str, FaultMemory], ...]:
    return tuple(latches.update(f).items())


def silent(**known: Any) -> dict[str, Any]:
    return {"looked_s": ago(0.25), "faults": {"bmu_silent": FaultMemory(cause=WHY, **known)}}


REMOVED = (
    Edge(faults, (), {"looked_s": ago(0.25)}, **GONE),
    Edge(faults, (), {"looked_s": ago(0.25)}, **{**GONE, "state": S.QUALIFYING}),
    Edge(faults, (), silent(present=True, raised_s=ago(1), strikes=(ago(1),)), **GONE),
    Edge(faults, (("bmu_silent", FaultMemory(strikes=(ago(100),))),),
         silent(present=True, raised_s=ago(1), strikes=(ago(100), ago(1))), **GONE),
    # a latched one waits for a person, but is not looked for
    Edge(faults, (("bmu_silent", FaultMemory(
        raised_s=ago(1), clean_s=NOW_S, cause=WHY, latched=True, unheard=True, poll_t_s=7.0)),),
        silent(present=True, raised_s=ago(1), latched=True, poll_t_s=7.0, now=WHY), **GONE),
)  # fmt: skip

EDGES = (*ENTERED, *CHARGER, *BATTERY, *REMOVED)


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: edge.name)
def test_what_is_kept_at_its_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_without_faults_nothing_new_is_remembered() -> None:
    f = Edge(faults, None, state=S.IDLE, charger=STANDS_BY).facts
    assert latches.update(f) is f.memory.faults


def test_another_fault_table_is_looked_at_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    f = Edge(faults, None, charger={"charge_mode": ChargeMode.ERROR_STOP}).facts
    assert list(latches.update(f)) == ["error_stop"]
    monkeypatch.setattr(latches, "FAULTS", (ROW["late"],))
    assert not latches.update(f)
    monkeypatch.setattr(latches, "_USUAL", {})  # as in a service that has just started
    assert not latches.update(f)
