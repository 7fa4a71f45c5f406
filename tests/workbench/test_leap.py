"""Leaps in time change no decision: hours in leaps and hours in ticks end alike."""

from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from dataclasses import replace

import pytest

from orchestrator.config.load import load_policy, load_scenario
from orchestrator.config.scenario import Ask, Defect, Sensor, SensorFault
from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory, names, paths, value_of, with_values
from orchestrator.core.parts import Kind
from orchestrator.model import Decision, Request, State
from orchestrator.workbench.processes import cores
from orchestrator.workbench.simulate import simulation
from orchestrator.workbench.simulate.devices import TICK_S
from orchestrator.workbench.simulate.leap import outline
from orchestrator.workbench.simulate.simulation import Run, Simulation, simulate
from tests.workbench.scenarios import battery, scenario

#: Hours of each shipped scenario simulated tick by tick: until after its special event.
SHIPPED = {
    "aged-pack": 2.2,
    "agv-day": 2.1,
    "cold-morning": 3.4,
    "deep-discharge": 0.3,
    "faulty-sensor": 1.85,
    "hot-afternoon": 0.75,
}
#: A warm pack's temperature rises by 0.0001 K in a tick: two ways of summing it up may differ by some of them.
SAME_S = 4 * TICK_S


def same(leaps: Run, ticks: Run) -> None:
    """Every state, current step, rule and fault, in the same order and at the same time."""
    assert [span.rule for span in leaps.trail.spans] == [span.rule for span in ticks.trail.spans]
    for leapt, ticked in zip(leaps.trail.spans, ticks.trail.spans, strict=True):
        assert leapt.from_s == pytest.approx(ticked.from_s, abs=SAME_S), (leapt, ticked)
        assert leapt.faults == ticked.faults
    assert leaps.charged_ah == pytest.approx(ticks.charged_ah, rel=1e-4)
    assert leaps.steps < ticks.steps / 2  # even where most of the time is spent in pulses


def leaps_and_ticks(name: str) -> tuple[Run, Run]:
    cut = replace(load_scenario(name), hours=SHIPPED[name])
    policy = load_policy("li-ion-48v")
    return simulate(policy, cut), simulate(policy, cut, stretch=False)


@pytest.fixture(name="played", scope="module")
def _played() -> Iterator[Mapping[str, Future[tuple[Run, Run]]]]:
    """Tens of thousands of decisions each, on all cores."""
    with cores() as pool:
        yield {name: pool.submit(leaps_and_ticks, name) for name in SHIPPED}


@pytest.mark.timeout(600)  # on a machine that may be busy
@pytest.mark.parametrize("name", SHIPPED)
def test_leaps_decide_what_ticks_decide(played: Mapping[str, Future[tuple[Run, Run]]], name: str) -> None:
    same(*played[name].result())


def test_leaps_decide_what_ticks_decide_to_the_end_of_a_charge() -> None:
    whole, policy = scenario(0.55), load_policy("li-ion-48v", changes={"finish.full.taper.for_s": "10"})
    leaps = simulate(policy, whole)
    same(leaps, simulate(policy, whole, stretch=False))
    assert leaps.trail.spans[-1].state is State.FULL


def test_leaps_decide_what_ticks_decide_where_limits_are_held_and_left() -> None:
    """A policy with many bands, a drifting sensor, an operator's pause, and the Ah limit at the end."""
    policy = load_policy("lfp-48v", changes={"pack.cells_in_series": "13", "pack.voltage_v[1]": "55.2",
                                             "current.voltage_v.rows[2].to": "56.5", "finish.max_ah": "3",
                                             "pack.chemistry": "nmc",
                                             "finish.full.taper.above_v": "53"})  # fmt: skip
    busy = scenario(
        1.0,
        batteries={"pack-1": battery(soh_pct=77)},
        sensors=(SensorFault(sensor=Sensor.TEMPERATURE_C, defect=Defect.DRIFT, by=-30, from_h=0.1),),
        operator=(Ask(at_h=0.2, request=Request.PAUSE), Ask(at_h=0.3, request=Request.START)),
    )
    leaps, ticks = simulate(policy, busy), simulate(policy, busy, stretch=False)
    same(leaps, ticks)
    assert len({span.step for span in leaps.trail.spans}) > 2
    assert "ah_limit" in leaps.trail.spans[-1].faults


def test_the_memory_after_a_leap_is_that_of_the_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sums and remembered temperatures too: a leap must not lose what the fault table uses."""
    memories: list[Memory] = []

    def recorded(*arguments: object) -> tuple[Decision, Memory]:
        decision, memory = decide(*arguments)  # type: ignore[arg-type]  # handed on as it came
        memories.append(memory)
        return decision, memory

    monkeypatch.setattr(simulation, "decide", recorded)
    last = []
    for max_leap in (simulation.MAX_LEAP, 1):
        memories.clear()
        Simulation(load_policy("li-ion-48v"), scenario(0.25), max_leap).run(lambda _: None)
        last.append((memories[-1], len(memories)))
    (leapt, few), (ticked, many) = last
    assert few < many / 20
    assert leapt.state is ticked.state is State.CHARGING
    assert leapt.session is not None
    assert ticked.session is not None
    assert leapt.session.charged_ah == pytest.approx(ticked.session.charged_ah, abs=14 * TICK_S / 3600)
    assert leapt.session.charged_wh == pytest.approx(ticked.session.charged_wh, rel=1e-3)
    assert leapt.session.energised_s == ticked.session.energised_s
    assert [t_s for t_s, _ in leapt.battery.warmth] == [t_s for t_s, _ in ticked.battery.warmth]
    assert [c for _, c in leapt.battery.warmth] == pytest.approx([c for _, c in ticked.battery.warmth], abs=0.1)
    for name in ("sample", "counted_t_s", "last_s"):
        assert value_of(leapt, name) == value_of(ticked, name)
    assert outline(Decision(State.CHARGING, Memory().cause), leapt) == outline(
        Decision(State.CHARGING, Memory().cause), ticked
    )


@pytest.mark.parametrize("name", names())
def test_an_outline_has_what_is_an_event_and_nothing_else(name: str) -> None:
    """What a field is, it says itself; of a total that there is anything."""
    if name in ("faults", "session", "witnessed", "state"):
        return
    memory = with_values(Memory(), search_s=1.0, wake_s=1.0, idle_s=1.0)
    decision = Decision(State.CHARGING, Memory().cause)
    kinds = [kind for kind in Kind if any(path.rpartition(".")[2] == name for path in paths(kind))]
    for value, same in (("another", kinds != [Kind.EVENT]), (0.0, kinds == [Kind.MEASURED])):
        if kinds == [Kind.TOTAL] and value == "another":
            continue
        if value_of(memory, name) != value:
            assert (outline(decision, with_values(memory, **{name: value})) == outline(decision, memory)) is same
