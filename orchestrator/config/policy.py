"""A charging policy: what people tune, each key with its meaning and its bounds."""

from dataclasses import dataclass, field

from orchestrator.keys import Range, Source, key


@dataclass(frozen=True, slots=True, kw_only=True)
class Pack:
    """The battery that this policy is for. Outside of these values no current flows."""

    cells_in_series: int = key("cells in series; the voltages of this file are checked against it", ge=1, le=200)
    voltage_v: Range = key("pack voltage: below it a charge is refused, above it is over-voltage", unit="V", gt=0)
    temperature_c: Range = key("outside of it charging pauses until well inside again", unit="°C", ge=-30, le=55)
    soh_min_pct: float = key("a pack with less health is refused", unit="%", ge=1, le=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """When a battery that has just arrived is charged."""

    soc_below_pct: float = key("charge a battery that arrives with less than this", unit="%", ge=1, le=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recharge:
    """When a battery that was charged full, and stayed, is charged again."""

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
    """What a pack that can be saved shows during precharge; a pack that does not is left alone, latched."""

    volts: float = key("the pack voltage must rise by this much …", unit="V", gt=0)
    within_min: float = key("… in every period of this length", unit="min", gt=0, le=30)


@dataclass(frozen=True, slots=True, kw_only=True)
class PrechargeRule:
    """How a deeply discharged pack is brought to where it may be charged; always on step 0."""

    below_v: float = key("precharge below this pack voltage", unit="V", gt=0)
    pulse: Pulse = key("the first stage")
    continuous: Continuous = key("the second stage")
    rise: Rise = key("what is expected of the pack meanwhile")


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """One row of a table: from `from` (included) to `to` (excluded; the last row's is included) at most this step."""

    from_: float = key("where the row begins (included)")
    to: float = key("where the row ends; the next row begins there")
    step: int = key("the highest current-limit step allowed, 0 (lowest) … 4", ge=0, le=4)


Table = tuple[Band, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Current:
    """The current-limit step: of all tables and limits the lowest wins; down at once, up after a hold."""

    raise_after_s: float = key("a higher step is taken after it was allowed for this long", unit="s", ge=1, le=3600)
    temperature_c: Table = key("by pack temperature; must cover `pack.temperature_c`", unit="°C")
    soc_pct: Table | None = key("by state of charge; must cover 0 … 100", unit="%", default=None)
    soh_pct: Table | None = key("by state of health; must cover `pack.soh_min_pct` … 100", unit="%", default=None)
    voltage_v: Table | None = key("by pack voltage; must cover `pack.voltage_v`", unit="V", default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Taper:
    """The constant-voltage phase's end: the current has fallen and stays low."""

    below_a: float = key("the charger's current is below this …", unit="A", gt=0)
    above_v: float = key("… while the pack is above this voltage …", unit="V", gt=0)
    for_s: float = key("… for this long", unit="s", ge=1, le=3600)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finish:
    """When a charge is over. The first that comes true ends it; hours and Ah are limits and end it as a fault."""

    soc_pct: float = key("full at this state of charge", unit="%", ge=1, le=100)
    taper: Taper | None = key("full when the current has tapered off", default=None)
    charger_full: bool = key("full when the charger itself says so (mode 5)", default=True)
    max_hours: float = key("a charge that takes longer is a fault", unit="h", gt=0, le=12)
    max_ah: float = key(
        "a charge that took more is a fault; one that begins above SOC 20 % may take that much less", unit="Ah", gt=0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """Limits of the fault table. Each default is the loosest that is allowed: a policy may only be stricter."""

    temperature_trip_c: float = key("latch at or above this", unit="°C", le=55, gt=0, default=55.0)
    temperature_rise_k_per_min: float = key(
        "latch when it rises faster over 3 min", unit="K/min", gt=0, le=1, default=1.0
    )
    over_current_pct: float = key(
        "latch above this share of the step's current", unit="%", gt=100, le=110, default=110.0
    )
    volts_differ_v: float = key("charger and BMU may differ by this …", unit="V", gt=0, le=1, default=1.0)
    volts_differ_pct: float = key("… or by this share, whichever is more", unit="%", gt=0, le=2, default=2.0)
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
    finish: Finish = key("when it is over")
    faults: Thresholds = key("stricter fault thresholds", default_factory=Thresholds)
    source: Source = field(default=Source("<policy>"), compare=False)
