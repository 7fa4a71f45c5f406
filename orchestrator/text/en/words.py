"""Single words used as parameters, how advice and evidence are combined, and how lists are joined."""

from collections.abc import Mapping

WORDS: Mapping[str, str] = {
    # bits of the BMU's status
    "over_voltage": "over voltage",
    "low_voltage": "low voltage",
    "charge_over_current": "charge over current",
    "discharge_over_current": "discharge over current",
    "high_temperature": "high temperature",
    "low_temperature": "low temperature",
    "bmu_error": "bmu error",
    # NMT states
    "boot_up": "boot-up",
    "stopped": "stopped",
    "pre_operational": "pre-operational",
    # the values a charge needs
    "voltage": "voltage",
    "current": "current",
    "status": "status",
    "temperature": "temperature",
    "soc": "SOC",
    "soh": "SOH",
    "pack_voltage": "pack voltage",
    "long": "long",
    # the values of a battery by their names
    "voltage_v": "pack voltage",
    "current_a": "pack current",
    "temperature_c": "temperature",
    "soc_pct": "SOC",
    "soh_pct": "SOH",
    "time_to_full_min": "time to full",
    "time_to_empty_min": "time to empty",
    "remaining_ah": "remaining charge",
    "available_wh": "available energy",
    # how a battery's id is known
    "assumed": "assumed",
    "typed": "typed",
    "serial_number": "serial number",
    # times within an hour
    "nth_1": "1st",
    "nth_2": "2nd",
    "nth_3": "3rd",
    # the charger's modes, commands and error bits
    "manual": "manual",
    "automatic": "automatic",
    "run": "run",
    "resume": "resume",
    "stop": "stop",
    "start": "start",
    "reset": "reset",
    "limit": "limit",
    "step": "step",
    "mode": "mode",
    "precharge": "precharge",
    "length": "length",
    "command": "command",
    "order": "order",
    "checksum": "checksum",
}
FRAMES: Mapping[str, str] = {
    "advice": "{what}; {do}",
    "trip": "{do} – {what}",
    "strikes": "{do}; it came {strikes} times within an hour: reset by a person",
    "unknown": "{id} ({params})",
    "where": "{where}: {what}",
    "place": " ({place})",
    "because": "{what}: {because}",
    "list": ", ",
    "and": " and ",
    "then": "; ",
    # present and past times, and the figures then and now
    "at": "at {raised_at}, {what}",
    "since": "since {since_at}",
    "was": "{was:and} at {since_at}",
    "now": "{now:and} now",
}
