"""The status document as text for a terminal: one line a bay, and why."""

from collections.abc import Mapping, Sequence
from typing import cast

HEAD = ("BAY", "STATE", "SOC", "PACK", "CURRENT", "TEMP", "STEP", "WHY")


def table(bays: Sequence[Mapping[str, object]]) -> str:
    """All bays, aligned; below each one its faults beyond the one that is the reason."""
    rows = [HEAD, *(_row(bay) for bay in bays)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD) - 1)]
    lines = []
    for row, bay in zip(rows, [None, *bays], strict=True):
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        lines.append("  ".join([*cells, row[-1]]).rstrip())
        if bay is not None:
            lines.extend(f"  {fault['effect']}: {fault['text']}" for fault in other_faults(bay))
            if cast("Mapping[str, object]", bay.get("policy", {})).get("waiting_sha256"):
                lines.append("  POLICY: a changed one comes into force when this bay stands by")
    return "\n".join(lines)


def other_faults(bay: Mapping[str, object]) -> list[Mapping[str, object]]:
    """The faults that the reason does not tell already."""
    faults = cast("list[Mapping[str, object]]", bay["faults"])
    return [fault for fault in faults if str(fault["text"]) not in str(bay["reason"])]


def _row(bay: Mapping[str, object]) -> tuple[str, ...]:
    battery = cast("Mapping[str, object]", bay["battery"])
    charger = cast("Mapping[str, object]", bay["charger"])
    step, amps = bay["step"], bay.get("step_current_a")
    return (
        str(bay["name"]),
        str(bay["state"]),
        figure(battery["soc_pct"], "{:.0f} %"),
        figure(battery["voltage_v"], "{:.2f} V"),
        figure(charger["current_a"], "{:.2f} A"),
        figure(battery["temperature_c"], "{:.1f} °C"),
        "–" if step is None else f"{step} ({figure(amps, '{:g} A')})",
        str(bay["reason"]),
    )


def figure(value: object, form: str) -> str:
    """A number with its unit, a dash where there is none."""
    return form.format(value) if isinstance(value, int | float) else "–"
