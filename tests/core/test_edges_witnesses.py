"""Charger and BMU side by side at their edges: the whole cause, with its key and every figure."""

from typing import Any

import pytest

from orchestrator.core.cells import NMC
from orchestrator.core.memory import Still
from orchestrator.core.witnesses import measured, paired
from orchestrator.core.witnesses.followed import Frozen, Sample
from orchestrator.core.witnesses.pack import collapsed
from orchestrator.model import Cause, ControlMode, CurrentStep, Session, State
from tests.core.edges import NO_PRECHARGE, PULSE, Edge, ago, by_policy, raised, witnessed
from tests.core.said import cause

UNHEARD = {"t_s": ago(9)}

# --- a pack that collapses --------------------------------------------------------------------------------------------

COLLAPSED = raised("pack_collapsed")
#: No pack under charge is this far below its precharge voltage of 39 V.
SUNK_V = 39.0 * 0.98


def sunk(pack_v: float) -> Cause:
    return by_policy("pack_sunk", "precharge.below_v", pack_v=pack_v, floor_v=39.0)


def low(pack_v: float) -> Cause:
    return by_policy("pack_stays_low", "precharge.below_v", pack_v=pack_v, floor_v=39.0)


def before(*samples: tuple[float, float, float, float]) -> dict[str, Any]:
    """Seconds ago, the pack's volts and amps, the charger's volts; oldest first."""
    return witnessed(trail=tuple(Sample(ago(age_s), pack_v, pack_a, v, 10.0) for age_s, pack_v, pack_a, v in samples))


def fell(before_v: float, pack_v: float, passed_s: float, pack_a: float = 10.0) -> Cause:
    return Cause.of("pack_fell", before_v=before_v, pack_v=pack_v, passed_s=passed_s, pack_a=pack_a)


def both(volts: float) -> dict[str, Any]:
    """Charger and BMU read the same."""
    return {"charger": {"voltage_v": volts}, "bmu": {"voltage_v": volts}}


AT_50_V = before((5.0, 50.0, 10.0, 50.0))
PACK = (
    # once it has collapsed, its voltage at rest counts
    Edge(collapsed, low(38.9), COLLAPSED, State.IDLE, bmu={"voltage_v": 38.9}),
    Edge(collapsed, None, COLLAPSED, State.IDLE, bmu={"voltage_v": 39.0}),
    Edge(collapsed, None, COLLAPSED, State.IDLE, bmu={"voltage_v": None}),
    Edge(collapsed, None, COLLAPSED, PULSE, bmu={"voltage_v": 38.9}),
    Edge(collapsed, None, state=State.IDLE, bmu={"voltage_v": 38.9}),
    Edge(collapsed, by_policy("pack_stays_low", "pack.voltage_v", pack_v=25.9, floor_v=26.0), COLLAPSED, State.IDLE,
         bmu={"voltage_v": 25.9}, policy=NO_PRECHARGE),
    Edge(collapsed, None, COLLAPSED, State.IDLE, bmu={"voltage_v": 26.0}, policy=NO_PRECHARGE),
    # under charge it may sink by 2 % below its precharge voltage
    Edge(collapsed, None, **both(SUNK_V)),
    Edge(collapsed, sunk(38.2), **both(38.2)),
    Edge(collapsed, None, **both(38.5)),
    Edge(collapsed, None, bmu={"voltage_v": 38.0}, charger={"voltage_v": 39.0}),
    Edge(collapsed, sunk(38.0), bmu={"voltage_v": 38.0}, charger={"voltage_v": 38.99}),
    Edge(collapsed, None, state=PULSE, **both(38.0)),
    Edge(collapsed, None, control=ControlMode.AUTOMATIC, **both(38.0)),
    Edge(collapsed, None, bmu={"voltage_v": 38.0, "current_a": None}, charger={"voltage_v": 38.0}),
    Edge(collapsed, None, bmu={"voltage_v": None}, charger={"voltage_v": 38.0}),
    Edge(collapsed, None, bmu={"voltage_v": 38.0}, charger=UNHEARD),
    # or fall by 5 % within the trail, if both see it and no less current flows
    Edge(collapsed, fell(50.0, 47.0, 5.0), AT_50_V, **both(47.0)),
    Edge(collapsed, None, AT_50_V, **both(47.5)),
    Edge(collapsed, fell(50.0, 47.49, 5.0), AT_50_V, **both(47.49)),
    Edge(collapsed, fell(50.0, 47.0, 5.0), before((9.0, 47.0, 10.0, 47.0), (5.0, 50.0, 10.0, 50.0)), **both(47.0)),
    Edge(collapsed, fell(50.0, 47.0, 4.0), before((9.0, 50.0, 10.0, 47.0), (4.0, 50.0, 10.0, 50.0)), **both(47.0)),
    Edge(collapsed, None, AT_50_V, bmu={"voltage_v": 47.0}, charger={"voltage_v": 48.5}),
    Edge(collapsed, None, AT_50_V, bmu={"voltage_v": 47.0}, charger={"voltage_v": 49.0}),
    Edge(collapsed, fell(50.0, 47.0, 5.0), AT_50_V, bmu={"voltage_v": 47.0}, charger={"voltage_v": 48.49}),
    Edge(collapsed, fell(50.0, 47.0, 5.0, 8.0), AT_50_V, bmu={"voltage_v": 47.0, "current_a": 8.0},
         charger={"voltage_v": 47.0}),
    Edge(collapsed, None, AT_50_V, bmu={"voltage_v": 47.0, "current_a": 7.99}, charger={"voltage_v": 47.0}),
)  # fmt: skip

# --- whose battery it is ----------------------------------------------------------------------------------------------


def alone(seconds: float, **known: Any) -> dict[str, Any]:
    """The charger's current has not shown on this BMU for so long; it saw 2 A before."""
    return witnessed(**{"alone_s": seconds, "before_a": 2.0, **known})


def unproved(seen_a: float) -> Cause:
    return Cause.of("pairing_not_proved", bay="bay-1", charger_a=10.0, node_id=0x10, seen_a=seen_a)


PAIRED = (
    Edge(paired.pairing_not_proved, unproved(0.5), alone(3.0), bmu={"current_a": 2.5}),
    Edge(paired.pairing_not_proved, None, alone(2.99), bmu={"current_a": 2.5}),
    Edge(paired.pairing_not_proved, unproved(-2.0), alone(3.0), bmu={"current_a": None}),
    Edge(paired.pairing_not_proved, None, alone(3.0, proved=True), bmu={"current_a": 2.5}),
    Edge(paired.pairing_not_proved, None, alone(3.0), State.IDLE, bmu={"current_a": 2.5}),
    Edge(paired.pairing_not_proved, None, alone(3.0), bmu={"current_a": 2.5}, charger=UNHEARD),
    Edge(paired.pairing_not_proved,
         Cause.of("moves_other", bay="bay-1", other="bay-2", charger_a=10.0, seen_a=0.5),
         alone(3.0), bmu={"current_a": 2.5}, snapshot={"moves": "bay-2"}),
)  # fmt: skip

# --- which of the two is wrong ----------------------------------------------------------------------------------------

BMU_WRONG = Cause.of("bmu_likelier_wrong", by=Cause("by_soc"))
CHARGER_WRONG = Cause.of("charger_likelier_wrong", by=Cause("by_soc"))
LOWEST_V, HIGHEST_V = (13 * cell_v for cell_v in NMC.bounds_v(50.0))
assert NMC.bounds_v(50.0) == (LOWEST_V / 13, HIGHEST_V / 13), "the division must hit the bound exactly"


def volts(charger_v: float, pack_v: float, wrong: Cause | None) -> Edge:
    says = Cause.of("volts_disagree", charger_v=charger_v, pack_v=pack_v, wrong=wrong)
    return Edge(measured.volts_disagree, says, charger={"voltage_v": charger_v}, bmu={"voltage_v": pack_v})


def amps(step_a: float, pack_a: float, wrong: str) -> Edge:
    by = Cause.of("by_step", step_a=step_a)
    says = Cause.of("amps_disagree", charger_a=10.0, pack_a=pack_a, wrong=Cause.of(wrong, by=by) if wrong else None)
    return Edge(measured.amps_disagree, says, {"step": CurrentStep(2, step_a, cause(""))}, bmu={"current_a": pack_a})


WRONG = (
    volts(48.0, 40.0, BMU_WRONG),
    volts(40.0, 48.0, CHARGER_WRONG),
    volts(48.0, 51.0, None),
    volts(LOWEST_V, 40.0, BMU_WRONG),
    volts(LOWEST_V - 0.01, 40.0, None),
    volts(HIGHEST_V, 60.0, BMU_WRONG),
    volts(HIGHEST_V + 0.01, 60.0, None),
    amps(9.0, 12.0, "bmu_likelier_wrong"),
    amps(8.99, 12.0, ""),
    amps(13.0, 12.0, "charger_likelier_wrong"),
    amps(13.01, 12.0, ""),
)

# --- values that stand still ------------------------------------------------------------------------------------------


def frozen(seconds: float = 60.0, charger_v: float = 48.0, charged_ah: float = 0.0, ah: float = 0.0) -> dict[str, Any]:
    """The BMU's report has stood still for so long; the charger's volts and the charge then, and the charge now."""
    still = Frozen(ago(seconds), (), charger_v, charged_ah)
    return {**witnessed(frozen=still), "session": Session(0.0, charged_ah=ah)}


def stands(lasted_s: float, moved_v: float, moved_ah: float) -> Cause:
    return Cause.of("bmu_frozen", lasted_s=lasted_s, moved_v=moved_v, moved_ah=moved_ah)


#: Two per cent of a whole charge of 44 Ah.
SHARE_AH = 0.02 * 44
BMU_FROZEN = (
    Edge(measured.bmu_frozen, stands(60.0, 0.0, 1.0), frozen(ah=1.0)),
    Edge(measured.bmu_frozen, stands(60.0, 0.0, 1.0), frozen(charged_ah=2.0, ah=3.0)),
    Edge(measured.bmu_frozen, None, frozen(59.9, ah=1.0)),
    Edge(measured.bmu_frozen, stands(60.0, 0.0, SHARE_AH), frozen(ah=SHARE_AH)),
    Edge(measured.bmu_frozen, None, frozen(ah=SHARE_AH - 0.01)),
    Edge(measured.bmu_frozen, None, frozen(charged_ah=2.0, ah=2.0)),
    Edge(measured.bmu_frozen, None, frozen(charger_v=0.0), charger={"voltage_v": 0.2}),
    Edge(measured.bmu_frozen, stands(60.0, 0.25, 0.0), frozen(charger_v=0.0), charger={"voltage_v": 0.25}),
    Edge(measured.bmu_frozen, None, frozen(ah=1.0), charger=UNHEARD),
    Edge(measured.bmu_frozen, None, {**frozen(), "session": None}),
    Edge(measured.bmu_frozen, None, {"session": Session(0.0, charged_ah=9.0)}),
    # found frozen, it stays so
    Edge(measured.bmu_frozen, Cause.of("bmu_still_frozen", lasted_s=7.0), {**frozen(7.0), **raised("bmu_frozen")}),
    Edge(measured.bmu_frozen, Cause.of("bmu_still_frozen", lasted_s=7.0), {**frozen(7.0), **raised("bmu_frozen")},
         State.SUSPENDED, charger=UNHEARD),
    Edge(measured.bmu_frozen, None, raised("bmu_frozen")),
)  # fmt: skip


def still(amps: float) -> dict[str, Any]:
    return {"still": Still(ago(60), 48.0, amps, 47.0, 10.0)}


CHARGER_FROZEN = (
    Edge(measured.charger_frozen, None, still(1.0)),
    Edge(measured.charger_frozen, Cause.of(
        "charger_frozen", charger_v=48.0, charger_a=1.01, lasted_s=60.0, moved_v=1.0, moved_a=0.0), still(1.01)),
)  # fmt: skip


@pytest.mark.parametrize("edge", [*PACK, *PAIRED, *WRONG, *BMU_FROZEN, *CHARGER_FROZEN], ids=lambda edge: edge.name)
def test_both_witnesses_at_their_edges(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says
