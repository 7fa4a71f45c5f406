"""The evidence of each fault, with value, limit and place."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    # what the charger reports
    "reverse_polarity": "the charger {reports|reported} connection 0: the battery {is|was} connected the wrong way round",
    "reverse_polarity_mode": "the charger {reports|reported} mode 6: the battery {is|was} connected the wrong way round",
    "polarity_contradicts": "the charger {contradicts|contradicted} itself: mode 6 (battery reversed) with connection 1 (normal)",
    "error_stop": "the charger {reports|reported} mode 8: stopped by an error of its own",
    "system_stop": "the charger {reports|reported} mode 7: it stopped itself without being asked",
    "illegal_value": "the charger {reports|reported} {values:word}",
    "mode_taken_over": "the charger {is|was} in {shown:word} mode, the station file says {configured:word}",
    "rejected_frame": "the charger answered with an error frame (0x1F): wrong {wrong:and} in what it received",
    "line_taken_over": "another program {has set|set} {port} to {settings}; it has been set up again",
    "port_locked": "another program {holds|held} {port}: {program}; the charger {is|was} stopped in spite of it",
    "noisy_line": "{bad_pct:.0f} % of {the last|a} minute's exchanges with the charger {go|went} wrong, more than "
    "{limit_pct:g} %",
    # whether it obeys
    "charger_silent": "the charger on {port} {has|had} not answered {misses} polls",
    "charger_stale": "the charger on {port} {has|had} sent no status for {limit_s:g} s",
    "found_running": "the charger was found running though it was not commanded to",
    "rogue_run": "the charger {runs|ran} though it was not commanded to: {charger_a:.2f} A",
    "current_unheard": "the BMU {sees|saw} {pack_a:.2f} A flow into the pack, nothing was commanded, and the charger {is|was} not "
    "heard",
    "current_without_order": "the BMU {sees|saw} {pack_a:.2f} A flow into the pack while the charger {says|said} {charger_a:.2f} A "
    "and nothing was commanded. Either the charger's word {is|was} wrong, its cable belongs to another bay, something "
    "else {charges|charged} this pack, or the BMU's current {is|was} wrong",
    "will_not_stop": "the charger {does|did} not obey the stop, which {is|was} repeated: it still {delivers|delivered} {charger_a:.2f} A",
    "stop_contradicted": "the stop, which {is|was} repeated, {is|was} not seen by both: the BMU still {sees|saw} "
    "{pack_a:.2f} A, the charger {says|said} {charger_a:.2f} A; one of them {is|was} wrong",
    "did_not_stop": "it did not obey the stop for {lasted_s:.0f} s",
    "stop_was_contradicted": "the BMU saw current for {lasted_s:.0f} s while the charger said none: one of them "
    "was wrong",
    "will_not_start": "the charger was told '{command:word}' for {waited_s:.1f} s and its status {does|did} not show it{held:after}",
    "stopped_by_itself": "the charger stopped though it was told to run",
    "stopped_not_full": "the charger stopped though it was told to run, and its mode 5 {is|was} not taken for full: the "
    "current had not tapered off and the pack {has|had} not reached its end voltage",
    "stopped_not_asked": "the charger stopped though it was told to run, and the policy does not take its mode 5 for full{at}",
    "setting_not_obeyed": "the charger was told '{command:word} {value}' for {waited_s:.1f} s and its status {does|did} not "
    "show it{held:after}",
    "held_back": "the interlock {holds|held} it back: {refused}",
    "limit_reverted": "the charger confirmed the step that it was told and went back by itself {times} times within a "
    "minute",
    "above_step": "{charger_a:.2f} A {flow|flowed}, more than {limit_a:.2f} A, where {step_a:g} A were commanded",
    "over_current": "{charger_a:.2f} A, more than {allowed_a:.2f} A for a limit of {limit_a:g} A",
    "early_full": "the charger {reports|reported} full (mode 5), the BMU only {soc_pct:.0f} %",
    "open_circuit": "the charger {runs but has|ran but had} delivered nothing for {idle_s:.0f} s at SOC {soc_pct:.0f} %",
    "no_battery": "the charger {has|had} been looking for a battery for {lasted_min:.0f} min",
    "wakes_too_long": "the charger {has|had} been in recovery or precharge for {lasted_min:.0f} min",
    "loose_plug": "the battery left in mid-charge and was back at once",
    # charger and battery side by side
    "over_voltage_charger": "{charger_v:.2f} V at the charger, the limit is {limit_v:g} V",
    "over_voltage_pack": "{pack_v:.2f} V at the pack, the limit is {limit_v:g} V",
    "volts_disagree": "the charger {reads|read} {charger_v:.2f} V, the BMU {pack_v:.2f} V: not the same battery, or a bad "
    "connection{wrong:after}",
    "amps_disagree": "the charger {reads|read} {charger_a:.2f} A, the BMU {pack_a:.2f} A{wrong:after}",
    "bmu_likelier_wrong": "the BMU {is|was} likelier wrong, by {by}",
    "charger_likelier_wrong": "the charger {is|was} likelier wrong, by {by}",
    "by_soc": "the pack's SOC",
    "by_step": "the step that was set ({step_a:g} A)",
    "moves_other": "the charger of {bay} {moves|moved} the BMU of {other}: it {has begun|began} with {charger_a:.2f} A, "
    "and the BMU of {bay} {sees|saw} {seen_a:.2f} A of it. Their cables or node ids are swapped",
    "pairing_not_proved": "the charger of {bay} {has begun|began} with {charger_a:.2f} A, and its BMU (node "
    "0x{node_id:02X}) {sees|saw} {seen_a:.2f} A of it: they {are|were} not on one battery",
    "charger_frozen": "the charger {has|had} said {charger_v:.2f} V and {charger_a:.2f} A for {lasted_s:.0f} s, while the "
    "BMU's values moved by {moved_v:.2f} V and {moved_a:.2f} A: its measurement {is|was} frozen",
    "charger_frozen_at_rest": "the charger {has|had} said {charger_v:.2f} V for {lasted_s:.0f} s at rest, while the BMU's "
    "voltage moved by {moved_v:.2f} V: its measurement {is|was} frozen",
    "bmu_still_frozen": "the BMU {has|had} said the same in every word for {lasted_s:.0f} s: its values {are|were} frozen",
    "bmu_frozen": "the BMU {has|had} said the same in every word for {lasted_s:.0f} s, while the charger's voltage moved by "
    "{moved_v:.2f} V and {moved_ah:.2f} Ah went in: its values {are|were} frozen",
    "pack_sunk": "the pack {has sunk|sank} to {pack_v:.2f} V while it {is|was} charged, below {floor_v:g} V{at}",
    "pack_stays_low": "the pack {has|had} {pack_v:.2f} V, below {floor_v:g} V{at}, after its voltage fell while it was charged",
    "pack_fell": "the pack fell from {before_v:.2f} to {pack_v:.2f} V within {passed_s:.0f} s while {pack_a:.2f} A "
    "flowed: a cell or a contact {has given|gave} way",
    "back_feed": "the BMU {reports|reported} a discharge of {discharge_a:.2f} A while the charger {runs|ran}",
    # the battery
    "bmu_silent": "the BMU (node 0x{node_id:02X}) {has stopped|stopped} answering",
    "heartbeat_lost": "no heartbeat of the BMU for {age_s:.1f} s",
    "stale_reading": "no fresh {missing:word} from the BMU",
    "not_operational": "the BMU's NMT state {is|was} {nmt_state:word}, not operational: it {sends|sent} no TPDOs, and {does|did} not obey "
    "an NMT start",
    "bmu_rebooted": "the BMU booted while charging: it must be qualified anew",
    "status_trip": "the BMU {reports|reported} {bits:word} (status word 0x{status:04X})",
    "status_limit": "the BMU {reports|reported} {bits:word} (status word 0x{status:04X})",
    "hot_trip": "the pack {has|had} {pack_c:.1f} °C, at or above {limit_c:g} °C{at}",
    "over_temperature": "the pack {has|had} {pack_c:.1f} °C, the limit is {limit_c:g} °C{at}; it charges again below "
    "{again_c:g} °C",
    "under_temperature": "the pack {has|had} {pack_c:.1f} °C, the limit is {limit_c:g} °C{at}; it charges again at "
    "{again_c:g} °C",
    "runaway": "the pack {warms|warmed} by {rate_k_per_min:.2f} K/min, more than {limit_k_per_min:g} K/min",
    "temperature_jump": "the pack's temperature went from {before_c:.1f} to {pack_c:.1f} °C in {passed_s:.2f} s",
    "under_voltage": "the pack {has|had} {pack_v:.2f} V, below {limit_v:g} V{at}",
    "needs_precharge": "the BMU {reports|reported} low voltage and the policy {has|had} no precharge",
    "soh_low": "SOH {soh_pct:.0f} %, below {limit_pct:g} %{at}",
    "soc_step": "the SOC went from {before_pct:.0f} to {soc_pct:.0f} % in {passed_s:.0f} s",
    "soc_falls": "the SOC {has fallen|fell} from {peak_pct:.0f} to {soc_pct:.0f} % in {passed_min:.0f} min under charge",
    "energy_disagrees": "the BMU {has|had} {remaining_ah:.2f} Ah and {available_wh:.1f} Wh available: that is "
    "{implied_v:.1f} V, the pack {has|had} {pack_v:.2f} V",
    "time_to_full_disagrees": "the BMU {says|said} full in {full_min:.0f} min: that is {takes_ah:.1f} Ah, by "
    "{remaining_ah:.2f} Ah at {soc_pct:.0f} % it is {missing_ah:.1f} Ah",
    "soc_not_believed": "{whats}",
    "other_serial": "the BMU's serial number is {serial}, and was {before}: this is another battery",
    "battery_exchanged": "{what}, in which the BMU was not heard: this may be another battery",
    "pack_too_low": "the pack {has|had} {pack_v:.2f} V at SOC {soc_pct:.0f} %: with {cells} {kind} cells{at} that {is|was} "
    "{cell_v:.2f} V a cell, where at least {bound_v:.2f} V belong to this SOC. It is another kind of pack, or its SOC "
    "{is|was} wrong",
    "pack_too_high": "the pack {has|had} {pack_v:.2f} V at SOC {soc_pct:.0f} %: with {cells} {kind} cells{at} that {is|was} "
    "{cell_v:.2f} V a cell, where at most {bound_v:.2f} V belong to this SOC. It is another kind of pack, or its SOC "
    "{is|was} wrong",
    "below_lowest_step": "{rule}; the lowest step of this charger is {lowest_a:g} A",
    "precharge_too_strong": "the pack {has|had} {pack_v:.2f} V and {needs|needed} precharge with at most {max_a:g} A{at}; the lowest step "
    "of this charger is {lowest_a:g} A",
    # others on the bus
    # the charge
    "precharge_no_rise": "the pack rose by {rise_v:.2f} V in {lasted_min:.1f} min, {expected_v:g} V were expected{at}",
    "precharge_too_long": "continuous precharge {has|had} taken {lasted_min:.1f} min and the pack {is|was} below {below_v:g} V{at}",
    "time_limit": "charging {has|had} taken {lasted_h:.2f} h{at}",
    "ah_limit": "{charged_ah:.2f} Ah were charged since SOC {begun_pct:.0f} %: a whole charge may take {whole_ah:g} Ah"
    "{at}, so from there {limit_ah:.2f} Ah",
    # ourselves
    "late": "this bay was looked at {late_s:.2f} s late",
    "overrun": "nobody looked at this bay for {late_s:.1f} s: the machine stood still",
    "suspended": "the machine was suspended for {slept_s:.0f} s: nothing that is known of this bay {holds|held} any more",
    "supply_failed": "the supplies cannot be divided, so nothing more is granted: {error}",
    "internal": "{whats}",
    "internal_error": "{error}",
    "not_judged": "{fault} {cannot|could not} be judged: {error}",
}
