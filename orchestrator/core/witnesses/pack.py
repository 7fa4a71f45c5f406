"""Whether the pack is the one the policy is for, and whether it still holds its voltage."""

from orchestrator.core.cells import chemistry
from orchestrator.core.facts import Facts
from orchestrator.model import Cause, State

#: A pack under charge may briefly sink below its precharge voltage by this share.
MARGIN = 0.02
#: A fall by this share within the trail's seconds, while no less current flows, is a failing cell or contact.
FALL = 0.05
#: If the charger sees less than this share of a fall, it is a mistake of the BMU.
SEEN_BY_BOTH = 0.5
#: … no less than this share of the earlier current.
SAME_CURRENT = 0.8


def another_pack(f: Facts) -> Cause | None:
    """FAULTS B25, P3: volts per cell, SOC and chemistry contradict each other.

    During a charge, a voltage that is high for the SOC means that the SOC is wrong: the voltage limit and the taper end
    that charge. A low one means another pack, or one with a dead cell, which would be overcharged.
    """
    pack = f.rules.policy.pack
    if f.pack_v is None or f.soc is None:
        return None
    kind, cell_v = chemistry(pack), f.pack_v / pack.cells_in_series
    low_v, high_v = kind.bounds_v(f.soc)
    if low_v <= cell_v and (cell_v <= high_v or f.energised):
        return None
    id_, bound_v = ("pack_too_low", low_v) if cell_v < low_v else ("pack_too_high", high_v)
    return f.rules.by_policy(
        id_, "pack.cells_in_series",
        pack_v=f.pack_v, soc_pct=f.soc, cells=pack.cells_in_series, kind=kind.name, cell_v=cell_v, bound_v=bound_v,
    )  # fmt: skip


def collapsed(f: Facts) -> Cause | None:
    """FAULTS B24: a cell that fails under current takes its share of the voltage with it, and both witnesses see it.

    Once it has failed, the voltage at rest counts, too, for as long as it is that low.
    """
    rule, pack = f.rules.policy.precharge, f.rules.policy.pack
    floor_v, key = (rule.below_v, "precharge.below_v") if rule is not None else (pack.voltage_v.low, "pack.voltage_v")
    if "pack_collapsed" in f.raised and not f.energised and f.pack_v is not None and f.pack_v < floor_v:
        return f.rules.by_policy("pack_stays_low", key, pack_v=f.pack_v, floor_v=floor_v)
    if f.memory.state is not State.CHARGING or f.pack_v is None or f.pack_a is None or f.volts is None:
        return None
    if f.rules.manual and f.pack_v < floor_v * (1 - MARGIN) and f.volts < floor_v:
        return f.rules.by_policy("pack_sunk", key, pack_v=f.pack_v, floor_v=floor_v)
    pack_v = f.pack_v
    for sample in f.memory.witnessed.trail:
        fell_v = sample.pack_v - pack_v
        if fell_v <= FALL * sample.pack_v:
            continue
        both_fell = sample.charger_v - f.volts > SEEN_BY_BOTH * fell_v
        if both_fell and f.pack_a >= SAME_CURRENT * sample.pack_a:
            passed_s = f.now_s - sample.t_s
            return Cause.of("pack_fell", before_v=sample.pack_v, pack_v=f.pack_v, passed_s=passed_s, pack_a=f.pack_a)
    return None
