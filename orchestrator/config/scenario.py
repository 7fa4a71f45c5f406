"""A scenario: what happens to one bay over hours of simulated time, for trying policies on."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from orchestrator.config.station import Limits
from orchestrator.keys import Source, key
from orchestrator.model import Request


class Cell(StrEnum):
    """The cells' chemistry: it determines the open-circuit voltage at each state of charge."""

    NMC = "nmc"  #: and NCA
    LFP = "lfp"


class Sensor(StrEnum):
    """A value reported by the BMU that a scenario can falsify."""

    VOLTAGE_V = "voltage_v"
    CURRENT_A = "current_a"
    TEMPERATURE_C = "temperature_c"
    SOC_PCT = "soc_pct"
    SOH_PCT = "soh_pct"


class Defect(StrEnum):
    """What is wrong with a sensor."""

    STUCK = "stuck"  #: repeats its last value
    SILENT = "silent"  #: reports nothing
    OFFSET = "offset"  #: reads `by` too high
    DRIFT = "drift"  #: reads increasingly high, by `by` per hour


@dataclass(frozen=True, slots=True, kw_only=True)
class Weather:
    """The ambient temperature at one time; linear between rows."""

    at_h: float = key("when, from the beginning", unit="h", ge=0, le=168)
    ambient_c: float = key("how warm it is then", unit="°C", ge=-40, le=60)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChargerModel:
    """The charger."""

    steps_a: tuple[float, ...] = key(
        "what the five current-limit steps mean on this charger, lowest first", unit="A", gt=0
    )
    cv_v: float = key("the voltage that it never exceeds (constant voltage)", unit="V", gt=0, le=120)
    precharge_a: float = key("what it delivers in precharge, and in each pulse", unit="A", gt=0, default=1.0)
    cutoff_a: float = key("at constant voltage below this it says by itself: full", unit="A", gt=0, default=0.4)
    lead_ohm: float = key("between its terminals and the battery's", unit="Ω", ge=0, le=0.1, default=0.005)


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryModel:
    """One battery: an equivalent circuit and a lumped thermal mass."""

    cells: Cell = key("nmc or lfp: which voltage belongs to which state of charge")
    cells_in_series: int = key("cells in series", ge=1, le=200)
    capacity_ah: float = key("what it held when it was new", unit="Ah", gt=0, le=2000)
    soh_pct: float = key("state of health: how much of that is left", unit="%", ge=1, le=100, default=100.0)
    resistance_ohm: float = key("series resistance of the new pack at 25 °C", unit="Ω", gt=0, le=10)
    ageing_per_pct: float = key(
        "resistance that each lost percent of health adds, as a share of the new pack's", ge=0, le=1, default=0.05
    )
    arrhenius_k: float = key(
        "growth of resistance in the cold: exp(this × (1/T − 1/298 K)); 0: none", unit="K", ge=0, le=10000, default=0.0
    )
    polarisation_ohm: float = key("resistance that comes only with time; 0: none", unit="Ω", ge=0, le=10, default=0.0)
    polarisation_s: float = key("time constant of that", unit="s", ge=1, le=3600, default=60.0)
    deep_ah: float = key("charge between the bottom of the deep discharge and 0 %", unit="Ah", gt=0, default=0.4)
    heat_j_per_k: float = key("heat that warms it by one kelvin: about 1000 for each kilogram", unit="J/K", gt=0)
    cooling_w_per_k: float = key("heat that it gives off for each kelvin above the weather", unit="W/K", gt=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """One battery's stay in the bay."""

    battery: str = key("which of `batteries`")
    from_h: float = key("when it arrives", unit="h", ge=0, le=168)
    to_h: float | None = key("when it leaves; null: it stays to the end", unit="h", gt=0, le=168, default=None)
    soc_pct: float | None = key(
        "its charge on arrival; −100 … 0: a share of the deep discharge", unit="%", ge=-100, le=100, default=None
    )
    used_pct: float | None = key(
        "instead of soc_pct: what it has used of its charge since it was here last", unit="%", ge=0, le=100,
        default=None,
    )  # fmt: skip
    temperature_c: float | None = key(
        "its temperature on arrival; null: the weather's", unit="°C", ge=-40, le=80, default=None
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorFault:
    """A period in which the BMU reports a wrong value."""

    sensor: Sensor = key("voltage_v, current_a, temperature_c, soc_pct or soh_pct")
    defect: Defect = key("stuck, silent, offset or drift")
    by: float = key("how much more it tells than is true (drift: more with each hour)", default=0.0)
    from_h: float = key("when it begins", unit="h", ge=0, le=168)
    to_h: float | None = key("when it is over; null: never", unit="h", gt=0, le=168, default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """An operator's request, as with `orchestrator start` and the other verbs."""

    at_h: float = key("when", unit="h", ge=0, le=168)
    request: Request = key("start, pause, stop or reset")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One scenario file."""

    scenario: str = key("its name")
    about: str = key("one line for people", default="")
    hours: float = key("how long it lasts", unit="h", gt=0, le=168)
    weather: tuple[Weather, ...] = key("the temperature around the bay")
    charger: ChargerModel = key("the charger")
    limits: Limits = key("hard limits of the bay, as in a station file")
    batteries: Mapping[str, BatteryModel] = key("the batteries, by a name for each")
    visits: tuple[Visit, ...] = key("which battery is in the bay, from when to when")
    sensors: tuple[SensorFault, ...] = key("what the BMU tells wrong", default=())
    operator: tuple[Ask, ...] = key("what the operator asks for", default=())
    source: Source = field(default=Source("<scenario>"), compare=False)
