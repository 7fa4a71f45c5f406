"""How a fault comes and goes, at its edges: all that is remembered of it, every figure."""

from typing import Any

import pytest

from orchestrator.core import latches
from orchestrator.core.facts import Facts
from orchestrator.core.memory import FaultMemory
from orchestrator.model import Cause, CurrentStep, Effect
from tests.core.edges import NOW_S, Edge, ago
from tests.core.said import cause


def remembered(name: str) -> Any:
    """All that is remembered of this fault after a decision."""

    def after(f: Facts) -> FaultMemory | None:
        return latches.update(f).get(name)

    after.__name__ = name
    return after


#: It must last for two seconds and be seen in two replies, latches, and has one figure.
ABOVE = remembered("above_step")
#: It is raised at once, and ends by itself after a while.
IMPLAUSIBLE = remembered("implausible")
SAID = cause("SOC 140 %")
WRONG: dict[str, Any] = {"implausible": {"soc_pct": SAID}}
BEFORE = cause("as it was")


def above(a: float = 14.0) -> Cause:
    return Cause.of("above_step", charger_a=a, limit_a=8.0 * 110 / 100 + 0.3, step_a=8.0)


def known(name: str = "above_step", **fault: Any) -> dict[str, Any]:
    """What was known of the fault a quarter of a second ago, on a step of 8 A."""
    return {"faults": {name: FaultMemory(**fault)}, "looked_s": ago(0.25), "step": CurrentStep(2, 8.0, cause(""))}


A_14 = {"current_a": 14.0}
A_8 = {"current_a": 8.0}
RAISED = FaultMemory(
    present=True, seen_s=2.0, polls=2.0, poll_t_s=NOW_S, raised_s=NOW_S, cause=above(), latched=True, now=above(),
    worst=14.0,
)  # fmt: skip
COMES = (
    # it is not a fault yet
    Edge(ABOVE, FaultMemory(present=True, seen_s=0.0, polls=1.0, poll_t_s=NOW_S),
         {"looked_s": ago(0.25), "step": CurrentStep(2, 8.0, cause(""))}, charger=A_14),
    Edge(ABOVE, FaultMemory(present=True, seen_s=1.25, polls=2.0, poll_t_s=NOW_S),
         known(present=True, seen_s=1.0, polls=1.0, poll_t_s=ago(0.25), clean_s=ago(5)), charger=A_14),
    Edge(ABOVE, FaultMemory(present=True, seen_s=9.25, polls=1.0, poll_t_s=NOW_S),
         known(present=True, seen_s=9.0, polls=1.0, poll_t_s=NOW_S), charger=A_14),
    Edge(ABOVE, FaultMemory(present=False, seen_s=0.9375, polls=0.75, poll_t_s=NOW_S),
         known(present=True, seen_s=1.0, polls=1.0, poll_t_s=ago(0.25)), charger=A_8),
    Edge(ABOVE, None, known(present=True, seen_s=0.0625, polls=0.25, poll_t_s=ago(0.25)), charger=A_8),
    # it is raised
    Edge(ABOVE, RAISED, known(present=True, seen_s=1.75, polls=1.0, poll_t_s=ago(0.25)), charger=A_14),
    Edge(ABOVE, RAISED, known(present=False, seen_s=2.0, polls=1.0, poll_t_s=ago(0.25), clean_s=ago(5)), charger=A_14),
    # it is still there, or there again
    Edge(ABOVE, FaultMemory(present=True, seen_s=3.25, polls=4.0, poll_t_s=NOW_S, raised_s=ago(9), cause=above(12.0),
                            latched=True, now=above(), worst=15.0),
         known(present=True, seen_s=3.0, polls=3.0, poll_t_s=ago(0.25), raised_s=ago(9), cause=above(12.0),
               latched=True, now=above(13.0), worst=15.0), charger=A_14),
    Edge(ABOVE, FaultMemory(present=True, seen_s=0.0, polls=1.0, poll_t_s=NOW_S, raised_s=ago(9), cause=above(12.0),
                            latched=True, now=above(), worst=14.0),
         known(present=False, raised_s=ago(9), clean_s=ago(5), cause=above(12.0), latched=True, worst=13.0),
         charger=A_14),
    Edge(ABOVE, FaultMemory(present=False, raised_s=ago(9), clean_s=NOW_S, cause=above(12.0), latched=True, worst=13.0,
                            poll_t_s=ago(0.25)),
         known(present=True, seen_s=3.0, polls=3.0, poll_t_s=ago(0.25), raised_s=ago(9), cause=above(12.0),
               latched=True, now=above(12.0), worst=13.0), charger=A_8),
)  # fmt: skip


def struck(*ages_s: float, latched: bool = False) -> FaultMemory:
    """Raised just now, with the strikes of the last hour."""
    return FaultMemory(
        present=True, polls=1.0, poll_t_s=NOW_S, raised_s=NOW_S, cause=SAID, now=SAID, latched=latched,
        strikes=(*map(ago, ages_s), NOW_S),
    )  # fmt: skip


def strikes(*ages_s: float) -> dict[str, Any]:
    return known("implausible", strikes=tuple(map(ago, ages_s)))


STRIKES = (
    Edge(IMPLAUSIBLE, struck(), {"looked_s": ago(0.25)}, bmu_link=WRONG),
    Edge(IMPLAUSIBLE, struck(3599.9), strikes(3600, 3599.9), bmu_link=WRONG),
    Edge(IMPLAUSIBLE, struck(30, 20), strikes(30, 20), bmu_link=WRONG),
    Edge(IMPLAUSIBLE, struck(30, 20, 10, latched=True), strikes(30, 20, 10), bmu_link=WRONG),
    Edge(IMPLAUSIBLE, struck(30, 20), strikes(3600, 30, 20), bmu_link=WRONG),
    Edge(IMPLAUSIBLE, FaultMemory(strikes=(ago(3599.9),)), strikes(3600, 3599.9)),
    Edge(IMPLAUSIBLE, None, strikes(3600)),
)  # fmt: skip


@pytest.mark.parametrize("edge", [*COMES, *STRIKES], ids=lambda edge: edge.name)
def test_what_is_remembered_of_a_fault(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


@pytest.mark.parametrize(("latched", "effect"), [(False, Effect.STOP), (True, Effect.TRIP)])
def test_a_latched_fault_trips(latched: bool, effect: Effect) -> None:
    assert latches.effect("implausible", FaultMemory(latched=latched)) is effect
