"""A charging policy: the values that people tune, each key with its meaning and bounds.

A policy is written for a pack, in amperes or C; the bay translates them to its charger's steps (`core/limits.py`).
"""

from dataclasses import dataclass, field
from enum import StrEnum

from orchestrator.keys import Range, Source, key


class CellType(StrEnum):
    """The cells' chemistry: it determines the voltage at each state of charge, and the effect of cold."""

    NMC = "nmc"
    NCA = "nca"
    LFP = "lfp"
    LTO = "lto"


class Needs(StrEnum):
    """How many signs of a full pack are required."""

    ANY = "any"
    ALL = "all"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """The battery that this policy is for. Outside these values no current flows."""

    chemistry: CellType = key("what the cells are made of: nmc, nca, lfp or lto")
    cells_in_series: int = key("cells in series; the voltages of this file are checked against it", ge=1, le=200)
    capacity_ah: float | None = key(
        "rated capacity; with it rows may say max_c, and max_ah, max_hours and taper have defaults",
        unit="Ah", gt=0, le=2000, default=None,
    )  # fmt: skip
    current_a: float = key("the highest charging current that the data sheet allows", unit="A", gt=0, le=1000)
    voltage_v: Range = key("pack voltage: below it a charge is refused, above it is over-voltage", unit="V", gt=0)
    temperature_c: Range = key("outside of it charging pauses until well inside again", unit="°C", ge=-30, le=55)
    soh_min_pct: float = key("a pack with less health is refused", unit="%", ge=1, le=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """When a newly arrived battery is charged."""

    soc_below_pct: float = key("charge a battery that arrives with less than this", unit="%", ge=1, le=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recharge:
    """When a full battery that has stayed in the bay is charged again."""

    soc_below_pct: float = key("charge again below this", unit="%", ge=1, lt=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """First stage of precharge: the charger's pulse mode (precharge function 1)."""

    until_v: float = key("go on to the continuous stage at this pack voltage", unit="V", gt=0)
    max_min: float = key("go on to the continuous stage after this long at the latest", unit="min", gt=0, le=30)


@dataclass(frozen=True, slots=True, kw_only=True)
class Continuous:
    """Second stage of precharge: the charger's continuous mode (precharge function 2)."""

    max_min: float = key("the pack must have reached `below_v` by then, else the bay trips", unit="min", gt=0, le=30)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rise:
    """The voltage rise that a recoverable pack shows during precharge; a pack that does not rise is latched."""

    volts: float = key("the pack voltage must rise by this much …", unit="V", gt=0)
    within_min: float = key("… in every period of this length", unit="min", gt=0, le=30)


@dataclass(frozen=True, slots=True, kw_only=True)
class PrechargeRule:
    """How a deeply discharged pack is prepared for charging; always on the charger's lowest step."""

    below_v: float = key("precharge below this pack voltage", unit="V", gt=0)
    max_a: float = key("no precharge at a charger whose lowest step is above this", unit="A", gt=0, le=1000)
    pulse: Pulse = key("the first stage")
    continuous: Continuous = key("the second stage")
    rise: Rise = key("what is expected of the pack meanwhile")


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """One row of a table: the maximum from `from` (included) to `to` (excluded, but included in the last row).

    Without `max_a` and `max_c`, the pack's own `current_a` applies.
    """

    from_: float = key("where the row begins (included)")
    to: float = key("where the row ends; the next row begins there")
    max_a: float | None = key("at most this current; 0: a pause", unit="A", ge=0, le=1000, default=None)
    max_c: float | None = key("at most this share of pack.capacity_ah; 0: a pause", unit="C", ge=0, le=20, default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """The current allowed by one quantity."""

    hysteresis: float | None = key(
        "more current only when the value is this far inside the next row; left out: twice the sensor's resolution",
        ge=0, le=20, default=None,
    )  # fmt: skip
    rows: tuple[Band, ...] = key("no gaps, no overlaps, lowest first")


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """A rule on several quantities: the maximum inside all of its ranges (ends included)."""

    temperature_c: Range | None = key("[low, high] of the pack temperature", unit="°C", ge=-30, le=60, default=None)
    soc_pct: Range | None = key("[low, high] of the state of charge", unit="%", ge=0, le=100, default=None)
    soh_pct: Range | None = key("[low, high] of the state of health", unit="%", ge=0, le=100, default=None)
    voltage_v: Range | None = key("[low, high] of the pack voltage", unit="V", gt=0, le=1000, default=None)
    max_a: float | None = key("at most this current; 0: a pause", unit="A", ge=0, le=1000, default=None)
    max_c: float | None = key("at most this share of pack.capacity_ah; 0: a pause", unit="C", ge=0, le=20, default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Current:
    """How much current: the lowest of everything that applies wins; it drops at once and rises after a hold."""

    raise_after_s: float = key("more is taken after it was allowed for this long", unit="s", ge=1, le=3600)
    temperature_c: Table = key("by pack temperature; must cover `pack.temperature_c`", unit="°C")
    soc_pct: Table | None = key("by state of charge; must cover 0 … 100", unit="%", default=None)
    soh_pct: Table | None = key("by state of health; must cover `pack.soh_min_pct` … 100", unit="%", default=None)
    voltage_v: Table | None = key("by pack voltage; must cover `pack.voltage_v`", unit="V", default=None)
    where: tuple[Where, ...] = key("rules on more than one quantity", default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Taper:
    """The end of the constant-voltage phase: the current has fallen and stays low."""

    below_a: float | None = key("the charger's current is below this …", unit="A", gt=0, le=1000, default=None)
    below_c: float | None = key("… or below this share of pack.capacity_ah …", unit="C", gt=0, le=1, default=None)
    above_v: float | None = key(
        "… while the pack is above this voltage; left out: 97 % of its end voltage …", unit="V", gt=0, default=None
    )
    for_s: float = key("… for this long", unit="s", ge=1, le=3600, default=120.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Full:
    """The signs of a full pack."""

    needs: Needs = key("any or all of those that stand here", default=Needs.ANY)
    soc_pct: float | None = key(
        "the BMU's state of charge; leave it out where that is not to be trusted", unit="%", ge=80, le=100, default=None
    )
    taper: Taper | None = key("the current has tapered off at the end voltage", default=None)
    charger: bool | None = key(
        'the charger\'s own "full" (mode 5), after a taper; false: not believed; left out: believed, never required',
        default=None,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Finish:
    """When a charge ends. Hours and Ah are limits; exceeding them is a fault."""

    target_soc_pct: float = key(
        "below 100: the charge ends at this state of charge", unit="%", ge=20, le=100, default=100.0
    )
    full: Full = key("how full is known", default_factory=Full)
    hold_min: float = key("stay on at the top for so long, to balance", unit="min", ge=0, le=720, default=0.0)
    full_every_days: float | None = key(
        "with a target below 100: once in so many days all the way", unit="d", ge=1, le=365, default=None
    )
    max_hours: float | None = key(
        "a charge that takes longer is a fault; left out: 1.5 times what the capacity takes on the lowest step that "
        "the rows lead to",
        unit="h", gt=0, le=240, default=None,
    )  # fmt: skip
    max_ah: float | None = key(
        "a charge that took more is a fault; one that begins above SOC 20 % may take that much less; left out: 110 % "
        "of the capacity",
        unit="Ah", gt=0, le=2500, default=None,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """Limits of the fault table. Each default is the loosest value allowed: a policy may only be stricter."""

    temperature_trip_c: float = key("latch at or above this", unit="°C", le=55, gt=0, default=55.0)
    temperature_rise_k_per_min: float = key(
        "latch when it rises faster over 3 min", unit="K/min", gt=0, le=1, default=1.0
    )
    over_current_pct: float = key(
        "latch above this share of the step's current", unit="%", gt=100, le=110, default=110.0
    )
    volts_differ_v: float | None = key(
        "charger and BMU may differ by this; left out, both: 1 V or 2 %, whichever is more …",
        unit="V", gt=0, le=1, default=None,
    )  # fmt: skip
    volts_differ_pct: float | None = key(
        "… or by this share; where both stand here, whichever is less", unit="%", gt=0, le=2, default=None
    )
    amps_differ_a: float = key("charger and BMU may differ by this …", unit="A", gt=0, le=1, default=1.0)
    amps_differ_pct: float = key("… or by this share, whichever is more", unit="%", gt=0, le=10, default=10.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """One policy file."""

    policy: str = key("the name that status and journal show")
    about: str = key("one line for people", default="")
    pack: Pack = key("the battery that this is for")
    start: Start = key("when an arriving battery is charged")
    recharge: Recharge = key("when a full battery that stays is charged again")
    precharge: PrechargeRule | None = key(
        "how a deeply discharged pack is woken; without it such a pack is refused", default=None
    )
    current: Current = key("how much current, when")
    finish: Finish = key("when it is over", default_factory=Finish)
    faults: Thresholds = key("stricter fault thresholds", default_factory=Thresholds)
    source: Source = field(default=Source("<policy>"), compare=False)
