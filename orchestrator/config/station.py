"""A station file: the wiring, and the hard limits that no policy can widen."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from orchestrator.config.policy import Policy
from orchestrator.keys import Range, Source, key
from orchestrator.model import ControlMode
from orchestrator.protocol.objects import ObjectMap


class Rs485(StrEnum):
    """How the direction of the line is switched."""

    OFF = "off"  #: RS-232, or an RS-485 adapter that switches automatically
    KERNEL = "kernel"  #: the serial driver switches RTS (TIOCSRS485)


class Language(StrEnum):
    """The language of texts for people."""

    EN = "en"  #: English
    KO = "ko"  #: Korean


@dataclass(frozen=True, slots=True, kw_only=True)
class ChargerConfig:
    """One charger on one serial port (its address is always 0x90).

    Its documents give neither `efficiency` nor `idle_w`. The defaults are on the safe side of what a large charger may
    have by California's appliance efficiency rules (Title 20): 0.89 or better, and 10 W without a battery.
    """

    port: str = key("the serial port, best a stable name below /dev/serial/by-path", is_path=True)
    control: ControlMode = key("manual (rotary switch on 1) or automatic (2 … 5: only stop and resume)")
    steps_a: tuple[float, ...] = key(
        "what flows at most on each of this charger's five current steps, lowest first", unit="A", gt=0
    )
    tolerance_pct: float = key(
        "how much more than steps_a may flow; 0 where they are the most that was measured",
        unit="%", ge=0, le=20, default=0.0,
    )  # fmt: skip
    rs485: Rs485 = key("off, or kernel for a driver that switches the direction", default=Rs485.OFF)
    draw_w: tuple[float, ...] | None = key(
        "what the charger draws from the mains at most on each of its steps, lowest first; left out: computed",
        unit="W", gt=0, default=None,
    )  # fmt: skip
    efficiency: float = key(
        "to compute draw_w: the share of it that reaches the battery, at worst", ge=0.5, le=1, default=0.8
    )
    idle_w: float = key("what the charger draws in standby, and for itself on each step", unit="W", ge=0, default=30.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryConfig:
    """Where the bay's BMU is, and how to read it."""

    can: str = key("the name of one of the station's CAN buses")
    node_id: int = key("the BMU's CANopen node id: its board switch + 0x10", ge=1, le=127)
    map: ObjectMap = key("the object map: a shipped name or a path")
    sweep_s: float = key(
        "how often volts, amps and status are read during a charge", unit="s", ge=0.02, le=0.5, default=0.05
    )
    sdo_timeout_s: float = key("an SDO answer that takes longer counts as none", unit="s", ge=0.05, le=0.5, default=0.3)
    heartbeat_s: float | None = key(
        "heartbeat period asked of the BMU; null: none", unit="s", ge=0.1, le=2, default=0.5
    )
    tpdo_s: float | None = key(
        "TPDO event period asked of the BMU; null: SDO only", unit="s", ge=0.05, le=1, default=None
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Hard limits of the bay's hardware; the interlock uses no others."""

    voltage_v: float = key("no current above this voltage, at the charger or at the pack", unit="V", gt=0, le=120)
    current_a: float = key("no step above this current", unit="A", gt=0, le=100)
    temperature_c: Range = key("no current outside of it", unit="°C", ge=-30, le=60)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactorConfig:
    """The GPIO line that closes the contactor between charger and battery."""

    chip: str = key("the GPIO chip, as /dev/gpiochip0 (gpiodetect lists them)", is_path=True)
    line: int = key("the line's number on that chip (gpioinfo lists them)", ge=0, le=1023)
    active_low: bool = key("true if the contactor is closed while the pin is low", default=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class BayConfig:
    """One charging place: a charger, its battery's BMU, their limits and a policy."""

    name: str = key("what people call it")
    charger: ChargerConfig = key("the charger")
    battery: BatteryConfig = key("the battery's BMU")
    limits: Limits = key("hard limits; a policy may only be stricter")
    policy: Policy = key("the charging policy: a shipped name or a path")
    contactor: ContactorConfig | None = key("the contactor between charger and battery; null: none", default=None)
    source: Source = field(default=Source("<station>"), compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """Where requests and queries arrive."""

    socket: Path = key("the Unix socket for status and commands; only its owner can open it, and `group`")
    group: str | None = key(
        "the members of this group may use the control socket, too; null: nobody else", default=None
    )
    view_socket: Path | None = key(
        "a second socket, which tells the status and takes no commands; null: none", default=None
    )
    view_group: str | None = key(
        "the members of this group may use the view socket, too; null: nobody else", default=None
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalConfig:
    """Where the journal goes and how large it may grow."""

    directory: Path = key("where the journal is kept")
    snapshots: bool = key("also what every decision was made from, for a replay; false spares an SD card", default=True)
    max_mb: float = key("the most that it may take; the oldest goes first", unit="MB", ge=1, default=256.0)
    sessions_years: float = key(
        "how long the record of charges is kept, beside the journal and not counted in max_mb", unit="years", ge=1,
        default=5.0,
    )  # fmt: skip
    curves_days: float = key(
        "how long the curves of charges are kept, some 20 kB for each; 0: none are", unit="days", ge=0, default=365.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SupplyConfig:
    """A fuse or feed that bays share. What they may draw together, at worst, never exceeds its limit."""

    limit_w: float = key(
        "the most that may be drawn; of a fuse: volts × amperes × the chargers' power factor", unit="W", gt=0
    )
    within: str | None = key("the supply that feeds this one; null: none", default=None)
    bays: tuple[str, ...] = key("the bays on it; those of a supply within it count anyway", default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Station:
    """One station file."""

    station: str = key("the station's name")
    can: Mapping[str, Mapping[str, object]] = key("CAN buses by name; the keys of each are python-can's own")
    bays: tuple[BayConfig, ...] = key("one for each charger")
    stagger_s: float = key(
        "charges of this station begin at least this far apart, each once the one before was seen on its own BMU; with "
        "one bay there is nobody to wait for; 0: they may begin together, and swapped cables are found later",
        unit="s",
        ge=0,
        le=60,
        default=3.0,
    )
    language: Language = key("what status, log, journal and answers are written in: en or ko", default=Language.EN)
    supplies: Mapping[str, SupplyConfig] | None = key(
        "what the bays are fed from, by name; null: each takes what its policy allows", default=None
    )
    control: Control = key("the control socket")
    journal: JournalConfig = key("the journal")
    source: Source = field(default=Source("<station>"), compare=False)
