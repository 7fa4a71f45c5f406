"""A battery's health, as its charges show it."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    "health": "Health:",
    "health_none": "battery {battery}: no charge of it on record has ended",
    "health_method": "health by method {method}; charges: {charges}, the newest ended on {end_at}",
    "health_mixed": "other batteries may have been there under this id: give each its own with orchestrator identify",
    "health_capacity": "capacity: {ah:.2f} Ah (95 %: {low:.2f} … {high:.2f} Ah), from {charges} charges",
    "health_capacity_none": "capacity: not known yet: it takes {least} charges within a year that raise the SOC by "
    "{rise_pct:g} % or more at {lowest_c:g} … {highest_c:g} °C without a jump; there are {charges}",
    "health_soh": "state of health: {pct:.0f} % of the rated {rated_ah:g} Ah (95 %: {low:.0f} … {high:.0f} %)",
    "health_bmu": "SOH by its BMU: {pct:.0f} %",
    "health_parts": "the BMU's SOH of {bmu_pct:.0f} % does not fit its charges, which show {low:.0f} … {high:.0f} %; limits "
    "by SOH go by the BMU's: measure the capacity, and have the BMU calibrated if it is wrong",
    "health_resistance": "resistance: {mohm:.1f} mΩ at 25 °C (95 %: {low:.1f} … {high:.1f} mΩ), from {changes} changes of the "
    "current in {charges} charges at {lowest_c:.0f} … {highest_c:.0f} °C",
    "health_resistance_none": "resistance: not known yet: it takes {least} charges within a year whose current changes by "
    "{least_a:g} A or more at once, at {low_pct:g} … {high_pct:g} % SOC and {lowest_c:g} … {highest_c:g} °C; there are "
    "{charges}",
    "health_balance": "coulombic balance: its BMU counts {pct:.1f} % of what the charger delivers",
    "health_rest": "rest voltage: {pack_v:.2f} V at SOC {soc_pct:.0f} % before the charge of {begin_at}",
    "health_stress": "in charges: {high} at or above {share_pct:.0f} % of the end voltage, {hot} at or above {hot_c:g} °C",
    "health_deep": "deep discharges: {deep} of {charges} (charges that began with a precharge)",
    "health_faults": "faults in its charges: {faults}",
    "health_no_faults": "faults in its charges: none",
}
