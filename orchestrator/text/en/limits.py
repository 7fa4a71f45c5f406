"""What limits the current, with its evidence and the line that sets it."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    "limit_none": "the highest step, nothing limits it",
    "limit_fault": "the fault {fault}",
    "limit_pack": "the pack bears {allowed_a:.1f} A, {place}",
    "limit_station": "the station's current limit, {place}",
    "limit_unknown": "{quantity:word} unknown, {place}",
    "limit_outside": "{value} outside of its table, {place}",
    "limit_row": "{spans:and} {allows}, {place}",
    # a quantity with its value, and the row it is in
    "value_temperature_c": "temperature {pack_c:.1f} °C",
    "value_soc_pct": "SOC {soc_pct:.0f} %",
    "value_soh_pct": "SOH {soh_pct:.0f} %",
    "value_voltage_v": "pack voltage {pack_v:.2f} V",
    "span_unknown": "{quantity:word} unknown",
    "span_in": "{value} in {low:g} … {high:g}",
    "span_near": "{value} not yet {well:g} beyond {low:g} … {high:g}",
    "span_left": "{value} has left {low:g} … {high:g}, which",
    "span_kept": "{value} beyond {low:g} … {high:g}, to which it came back too often in this charge:",
    # what the row allows
    "allows_nothing": "allows no current",
    "allows_a": "allows {allowed_a:.1f} A",
    "allows_c": "allows {allowed_a:.1f} A ({max_c:g} C)",
    # what else bounds a charge
    "limit_volts": "no current above {most_v:g} V, {place}",
    "limit_temperature": "no current outside {low:g} … {high:g} °C, {place}",
    "limit_ah": "a charge of more than {most:.3g} Ah is a fault, {place}",
    "limit_h": "a charge of more than {most:.3g} h is a fault, {place}",
    # what a supply leaves
    "supply_promises": "supply {supply}: {used_w:,.0f} of {limit_w:,.0f} W are promised",
    "supply_waiting": "waiting for it: {bays}",
    "supply_full": "supply {supply}: {used_w:,.0f} of {limit_w:,.0f} W are promised{at}",
    "supply_turn": "supply {supply}: {used_w:,.0f} of {limit_w:,.0f} W are promised{at}; waits for {other}, in turn at {turn_at}",
    "supply_line": "supply {supply}: {used_w:,.0f} of {limit_w:,.0f} W are promised{at}; waits in line for a place",
    "supply_never": "supply {supply} has {limit_w:,.0f} W{at}, too little for the lowest step: that needs {need_w:,.0f} W",
    "supply_unproved": "supply {supply}: {used_w:,.0f} of {limit_w:,.0f} W are still counted{at}; waits until less is seen at {others:and}",
    "supply_asks": "supply {supply} has not been asked for more until now",
    "supply_raise": "supply {supply} has room; the first step comes at {raise_at}",
    "supply_rises": "supply {supply} has room; the step rises within a minute",
    "supply_not_in_hand": "its charger is not in hand, so it counts with {counts_w:,.0f} W in supply {supply} until its standby is seen",
    "supply_unknown_bays": "counted with their highest steps, their chargers not being in hand: {bays}",
}
