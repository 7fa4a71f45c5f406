"""What a charge shows of its battery's health, as it was measured; `health.py` makes figures of it, later. Pure.

The record has the measurements and not the figures: with another method they can be worked out anew, for all charges.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from orchestrator.record import change as changing
from orchestrator.record import stretch as stretching
from orchestrator.record.change import Change, Changes
from orchestrator.record.look import Look
from orchestrator.record.stamp import figure
from orchestrator.record.stretch import Point, Stretch, Stretches

#: From here on a temperature wears a battery, and from this share of its end voltage a voltage.
HOT_C, HIGH_SHARE = 40.0, 0.97
#: Between two moments no more counts: nobody knows what was meanwhile.
GAP_S = 10.0
#: The member of a record.
NAME = "measured"


@dataclass(frozen=True, slots=True)
class Measured:
    """Of one charge.

    Moments are not in its record: a run of the service that goes on with it measures nothing across the gap.
    """

    stretches: Stretches = Stretches()
    changes: Changes = Changes()
    hot_s: float = 0.0  #: at or above `HOT_C`
    high_s: float = 0.0  #: at or above `HIGH_SHARE` of the end voltage
    t_s: float | None = None  #: the last moment, by the monotonic clock

    @property
    def stretch(self) -> Stretch | None:
        """The longest one."""
        return self.stretches.best

    @property
    def steps(self) -> tuple[Change, ...]:
        """The changes of the current."""
        return self.changes.all


def seen(look: Look, charger_ah: float, bmu_ah: float) -> Point:
    """What one decision shows."""
    battery = look.snapshot.battery
    volts = battery.voltage_v
    return Point(
        volts.t_s if volts is not None else look.now_s,
        look.fresh(battery.soc_pct),
        look.fresh(volts),
        look.fresh(battery.current_a),
        look.fresh(battery.temperature_c),
        charger_ah,
        bmu_ah,
    )


def follow(measured: Measured, now_s: float, point: Point, end_v: float | None) -> Measured:
    """The same after one more moment; `end_v` is the pack's end voltage."""
    gap_s = 0.0 if measured.t_s is None else min(max(now_s - measured.t_s, 0.0), GAP_S)
    hot = point.temperature_c is not None and point.temperature_c >= HOT_C
    high = point.pack_v is not None and end_v is not None and point.pack_v >= HIGH_SHARE * end_v
    return Measured(
        stretching.follow(measured.stretches, point),
        changing.follow(measured.changes, point),
        measured.hot_s + gap_s * hot,
        measured.high_s + gap_s * high,
        now_s,
    )


def as_fields(measured: Measured) -> dict[str, object]:
    """As it stands in a record."""
    return {
        NAME: {
            "stretch": stretching.as_fields(measured.stretch),
            "steps": changing.as_fields(measured.steps),
            "hot_s": round(measured.hot_s, 1),
            "high_s": round(measured.high_s, 1),
        }
    }


def from_fields(record: Mapping[str, Any]) -> Measured:
    """The inverse; nothing for a record of an earlier version. Raises as those of its parts do."""
    value = record.get(NAME)
    if value is None:
        return Measured()
    return Measured(
        Stretches(stretching.from_fields(value["stretch"])),
        Changes(changing.from_fields(value["steps"])),
        figure(value["hot_s"]),
        figure(value["high_s"]),
    )
