"""A battery's health for people and for programs. Pure."""

from collections.abc import Iterator

from orchestrator.model import Cause
from orchestrator.record.capacity import HIGHEST_C, LEAST, LEAST_RISE_PCT, LOWEST_C, Estimate
from orchestrator.record.change import LEAST_A
from orchestrator.record.health import SOURCES, Health
from orchestrator.record.lasting import lasting
from orchestrator.record.measured import HIGH_SHARE, HOT_C
from orchestrator.record.resistance import LEAST as LEAST_STEPS
from orchestrator.record.resistance import PACK_C, SOC_PCT
from orchestrator.record.stamp import as_fields as stamp_fields
from orchestrator.text.catalogue import say


def health_lines(health: Health, language: str) -> list[str]:
    """One line for each thing that can be said, unfolded; which battery it is, the reader has seen before."""
    return [say(cause, language) for cause in _said(health)]


def warning(health: Health) -> Cause | None:
    """Why a person should look at this battery; None if nothing is wrong with the figures."""
    own = health.soh_pct
    if own is None or not health.parts:
        return None
    return Cause.of("health_parts", bmu_pct=health.bmu_soh_pct, low=own.low, high=own.high)


def _said(health: Health) -> Iterator[Cause]:
    if health.newest is None:
        yield Cause.of("health_none", battery=health.battery)
        return
    yield Cause.of("health_method", method=health.method, charges=health.charges, end_at=health.newest.local())
    yield from filter(None, (warning(health), _mixed(health)))
    yield _capacity(health)
    if (own := health.soh_pct) is not None:
        yield Cause.of("health_soh", pct=own.value, rated_ah=health.rated_ah, low=own.low, high=own.high)
    if health.bmu_soh_pct is not None:
        yield Cause.of("health_bmu", pct=health.bmu_soh_pct)
    yield _resistance(health)
    if health.balance is not None:
        yield Cause.of("health_balance", pct=100 * health.balance)
    if (rest := health.rest) is not None:
        yield Cause.of("health_rest", pack_v=rest.pack_v, soc_pct=rest.soc_pct, begin_at=rest.at.local())
    share_pct, high, hot = 100 * HIGH_SHARE, lasting(health.high_s), lasting(health.hot_s)
    yield Cause.of("health_stress", high=high, share_pct=share_pct, hot=hot, hot_c=HOT_C)
    yield Cause.of("health_deep", deep=health.deep_discharges, charges=health.charges)
    faults = tuple(f"{id_} ×{times}" for id_, _, times in health.faults)
    yield Cause.of("health_faults", faults=faults) if faults else Cause("health_no_faults")


def _mixed(health: Health) -> Cause | None:
    return Cause("health_mixed") if health.source == SOURCES[0] else None


def _capacity(health: Health) -> Cause:
    found = health.capacity
    if found is not None:
        return Cause.of("health_capacity", ah=found.value, low=found.low, high=found.high, charges=found.charges)
    return Cause.of(
        "health_capacity_none", least=LEAST, rise_pct=LEAST_RISE_PCT, lowest_c=LOWEST_C, highest_c=HIGHEST_C,
        charges=health.usable[0],
    )  # fmt: skip


def _resistance(health: Health) -> Cause:
    found = health.resistance
    if found is None:
        (low_pct, high_pct), (low_c, high_c) = SOC_PCT, PACK_C
        return Cause.of(
            "health_resistance_none", least=LEAST_STEPS, least_a=LEAST_A, low_pct=low_pct, high_pct=high_pct,
            lowest_c=low_c, highest_c=high_c, charges=health.usable[1],
        )  # fmt: skip
    mohm = found.mohm
    return Cause.of(
        "health_resistance", mohm=mohm.value, low=mohm.low, high=mohm.high, charges=mohm.charges,
        changes=found.changes, lowest_c=found.lowest_c, highest_c=found.highest_c,
    )  # fmt: skip


def as_fields(health: Health) -> dict[str, object]:
    """As JSON has it; null where nothing can be said."""
    steps, rest = health.resistance, health.rest
    return {
        "battery": {"id": health.battery, "source": health.source},
        "method": health.method,
        "charges": health.charges,
        "newest": health.newest and stamp_fields(health.newest),
        "capacity_ah": _estimate(health.capacity, 3),
        "rated_ah": health.rated_ah,
        "soh_pct": _estimate(health.soh_pct, 2),
        "bmu_soh_pct": health.bmu_soh_pct,
        "parts": health.parts,
        "resistance_mohm": steps
        and {
            **(_estimate(steps.mohm, 3) or {}),
            "changes": steps.changes,
            "lowest_c": steps.lowest_c,
            "highest_c": steps.highest_c,
        },
        "balance": health.balance and round(health.balance, 5),
        "rest": rest and {"pack_v": rest.pack_v, "soc_pct": rest.soc_pct, **stamp_fields(rest.at)},
        "high_s": round(health.high_s, 1),
        "hot_s": round(health.hot_s, 1),
        "deep_discharges": health.deep_discharges,
        "faults": [{"id": id_, "effect": effect, "times": times} for id_, effect, times in health.faults],
    }


def _estimate(found: Estimate | None, digits: int) -> dict[str, object] | None:
    if found is None:
        return None
    low, value, high = (round(one, digits) for one in (found.low, found.value, found.high))
    return {"value": value, "low": low, "high": high, "charges": found.charges}
