"""What is said of the charges on record."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    # why a charge ended, where the record found it open
    "service_died": "the service died; last sign of life: {last_at}",
    "end_unseen": "nobody saw the end of this charge",
    # the charges on record
    "charge_open": "not ended",
    "charges_none": "no charge on record",
    "charges_more": "the newest {shown} of {charges}; --limit 0 lists all",
    "charges_unreadable": "{folder} cannot be read: {error}",
    "charge_unknown": "no charge on record has an id that ends with {id}",
    "charge_of": "charge {id}: {bay}, {station}",
    "battery_assumed": "battery {battery}, assumed from its node id",
    "battery_typed": "battery {battery}, typed by an operator",
    "battery_serial_number": "battery {battery}, its serial number",
    "charge_time": "{begin_at} to {end_at}, {lasted}",
    "charge_ended": "ended: {why}",
    "charge_took": "{ah:.2f} Ah, {wh:.1f} Wh by the charger; {bmu_ah:.2f} Ah, {bmu_wh:.1f} Wh by the BMU",
    "charge_policy": "policy {policy}, sha256 {sha256}; version {software}",
    "charge_by": "{by}",
    "charge_stop": "stop verified after {took_ms:.0f} ms",
    "charge_rules": "What limited the current:",
    "charge_rule": "{lasted}, {ah:.2f} Ah: {rule} ({at_line})",
    "charge_no_rule": "{lasted}, {ah:.2f} Ah: nothing but the charger",
    "charge_pauses": "Pauses:",
    "charge_faults": "Faults:",
    # a month
    "report_title": "Charges in {month}",
    "report_of": "Charges that began in {month} (local time: {zones:word}), {stations:word}",
    "report_head": "BAY|CHARGES|FULL|AH|KWH|MEAN TIME TO FULL",
    "report_total": "all",
    "report_ends": "How they ended:",
    "report_ends_head": "CHARGES|CAUSE|LAST AT|BEGAN|WHY IT ENDED",
    "report_look": "Batteries that need a look:",
    "report_none": "no charge on record began in {month}",
    "look_faults": "faults stopped its charges, {times} in all: {faults:word}",
    "look_soh": "its BMU reports SOH {soh_pct:.0f} %, below {least_pct:.0f} %",
    "look_amounts": "{ah:.1f} Ah by the charger, {bmu_ah:.1f} Ah by its BMU: check which of them measures wrong",
    "page_not_written": "{file} cannot be written: {error}",
    # the index
    "index_damaged": "the index of the records was damaged ({error}): it is kept as {file}, and a new one was built",
    "index_not_written": "no index could be written in {folder} ({error}): each record was read instead, which takes "
    "longer the more there are",
    "index_busy": "another command is building the index: wait until it has finished, then try again",
    "index_rebuilt": "index built anew: {charges} charges",
}
