"""Why a bay is where it is, and what becomes of requests."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    "said": "{text}",
    "several": "{whats}",
    # the service
    "service_started": "the service has just started",
    "service_ends": "the service ends: {why}",
    "no_answer": "the control loop has not answered: look at the service's log",
    "not_kept": "done, but not kept: {problem}",
    "not_done": "not done: {problem}",
    "not_taken": "the disk has not taken it",
    "overtaken": "a stop came meanwhile: ask again if it is still wanted",
    # where a bay without a charge is
    "charger_offline": "the charger on {port} does not answer",
    "stopped_first": "the charger is being stopped before anything else",
    "runs_uncommanded": "the charger runs though it was not commanded to",
    "battery_absent": "no battery",
    "battery_not_heard": "{charger_v:.1f} V at the charger, but {what}",
    "bmu_just_booted": "the BMU (node 0x{node_id:02X}) has just booted",
    "bmu_does_not_answer": "the BMU (node 0x{node_id:02X}) does not answer",
    "soc_unknown": "a battery is there; its SOC is not known yet",
    "soc_below": "SOC {soc_pct:.0f} % is below {threshold_pct:g} %{at}",
    "soc_not_below": "SOC {soc_pct:.0f} % is not below {threshold_pct:g} %{at}",
    "to_go_on": "to go on",
    "start_bay": "orchestrator start {bay}",
    # a charger that was not seen to stop
    "uncontrollable": "CUT THE MAINS of this charger ({port}) now: it has not obeyed the stop for {since_s:.0f} s: {why}",
    "uncontrollable_unproved": "CUT THE MAINS of this charger ({port}) now: nothing has proved for {since_s:.0f} s that "
    "it obeyed the stop: {why}",
    "uncontrollable_contradicted": "CUT THE MAINS of this charger ({port}): it says {charger_a:.2f} A, the BMU still sees "
    "{pack_a:.1f} A; one of them is wrong. If the BMU shows it with the mains off too, restart the BMU",
    "uncontrollable_stands_by": "CUT THE MAINS of this charger ({port}) unless it stays off: it has stood by for "
    "{lasts_s:.0f} s, {limit_s:g} s are believed",
    "witnesses": "{charger}{last:after}{bmu:after}",
    "no_answer_on": "no answer on {port}",
    "last_heard": "{charger_a:.2f} A, last heard {age_s:.0f} s ago",
    "delivers": "it delivers {charger_a:.2f} A",
    "no_lasting_standby": "its status does not show a standby that lasts",
    "bmu_sees": "the BMU sees {pack_a:.1f} A",
    "bmu_not_heard": "the BMU is not heard",
    # what the table of the status adds
    "cut_mains_of": "CUT THE MAINS of {bay}'s charger ({port}): {state}: {reason}",
    "cut_mains_of_stray": "CUT THE MAINS of the charger on {port}, which was {bay}'s: it may be running, nobody has seen "
    "that it stands by: {why}",
    "look_at": "LOOK at {bay}'s charger ({port}), nobody has seen that it stands by: {state}: {reason}",
    "port_unknown": "its port is not known",
    "policy_waits": "a changed one comes into force when this bay stands by",
    "old_charger": "the charger's {charger_a:.2f} A, last heard {age:word} ago{bmu:after}",
    "old_values": "{names:word}: last heard {age:word} ago",
    # while current flows
    "precharge_impossible": "precharge without a rule for it, or without the pack's voltage",
    "precharging_pulse": "the pack is below {below_v:g} V: pulse precharge{at}",
    "precharging_continuous": "the pack is below {below_v:g} V: continuous precharge{at}",
    "pack_reached": "the pack reached {target_v:g} V{at}",
    "pulses_over": "{limit_min:g} min of pulses{at}",
    "full": "full: {what}",
    "full_soc": "SOC {soc_pct:.0f} % reached {limit_pct:g} %{at}",
    "full_charger": "the charger reports full (mode 5){at}",
    "full_taper": "{charger_a:.2f} A, tapered below {below_a:g} A for {for_s:g} s{at}",
    "charging": "step {step} ({step_a:.1f} A): {rule}{limited:after}{rises:after}{held:after}",
    "held_at_the_top": "full, and held at the top for another {left_min:.0f} min{at}",
    "not_held_yet": "the pack is full, and was not yet held at the top for {hold_min:g} min{at}",
    "not_known_full": "the charge was interrupted, and the pack is not known to be full{at}",
    "full_held": "{what}, held for {hold_min:g} min{at}",
    "full_by_all": "{whats:and}",
    "rises": "a higher step is allowed, and taken after {hold_s:g} s{at}",
    "charges_by_itself": "the charger charges by itself (automatic mode)",
    "precharge_step": "precharge is always on the lowest step",
    # before a charge
    "checking": "checking charger and battery before a charge",
    "writing_down": "writing down that a charge begins, so that a restart would know of it",
    "needs_pulses": "the pack has {pack_v:.2f} V, below {below_v:g} V{at}",
    "qualified": "qualified: {pack_v:.2f} V, SOC {soc_pct:.0f} %, {pack_c:.1f} °C",
    "waits_for_values": "waiting for fresh values: {missing:word}",
    "waits_for_contactor": "waiting for the contactor, behind which charger and battery cannot be compared",
    "waits_for_turn": "waits for its turn: {other} begins its charge",
    "waits_for_stagger": "waits for its turn: charges of this station begin {stagger_s:g} s apart{at}",
    # requests
    "operator_stop": "stopped by the operator",
    "operator_pause": "paused by the operator",
    "operator_reset": "reset by the operator",
    "not_running": "not running: {what}",
    "out_of_control": "the charger was not seen to stop: cut its mains; nothing can be started or reset here before it "
    "has stood by for {lasts_s:g} s",
    "reset_first": "not running: {faults} must be reset first",
    "nothing_to_start": "nothing to start: {state}: {what}",
    "nothing_to_reset": "nothing to reset: {state}: {what}",
    "needs_reset": "{fault} is latched and needs a reset: {what}",
    "still_there": "{fault} is still there: {what}",
    "gone_first": "{fault} must be gone for {clean_s:g} s first",
    "reset_too_often": "{fault} was reset {times} times within an hour and came again each time: remove its cause; it "
    "can be reset again in {wait_min:.0f} min",
    # how a fault goes on
    "goes_on_by_reset": "its cause is gone: orchestrator reset {bay}, then orchestrator start {bay}",
    "goes_on_after": "goes on by itself {wait_s:g} s after its cause is gone ({strike:nth} of {of} within an hour)",
    "goes_on_in": "its cause is gone, goes on by itself in {left_s} s ({strike:nth} of {of} within an hour)",
    "goes_on_in_at_the_earliest": "its cause is gone, goes on by itself in {left_s} s at the earliest ({strike:nth} of "
    "{of} within an hour)",
    # a defect of our own
    "failed": "internal: {error}",
    "failed_stopping": "stopping: internal: {error}",
    "failed_uncontrollable": "CUT THE MAINS of this charger: this software has failed to judge the bay for "
    "{tried_s:.0f} s, and cannot verify the stop that it repeats ({error})",
    "failed_request": "internal error: {error}; this is a defect of the software; the charger is being stopped",
    # what the last run has left
    "unfinished": "the last run of this service ended in mid-charge; its charger was stopped first when it began again",
    "fault_of_another_version": "{fault}",
    "ended_in_charge": "the last run ended in mid-charge: {why}",
    "stray_ran": "the station file had no bay on {port} while its charger was running",
    "past_unknown": "{bay} on {port} is not in {file}: nobody knows its past",
    "older_version_ran": "an older version of this service has run {bay} in the meantime: see what is wired where",
    "port_was_of": "{port} was {old_bay}'s when this service last ran, and is {bay}'s now: see what is wired where",
    "bmu_was_of": "the BMU on {can}, node 0x{node_id:02X}, was {old_bay}'s when this service last ran, and is {bay}'s now: "
    "see what is wired where",
    "bay_moved_port": "{bay} was on {old_port} when this service last ran, and is on {port} now: see what is wired "
    "where",
    "bay_moved_bmu": "{bay} had the BMU on {old_can}, node 0x{old_node_id:02X}, when this service last ran, and has {can}, "
    "node 0x{node_id:02X}, now: see what is wired where",
    "state_unreadable": "{file} cannot be read ({error:word}): nobody knows which faults were latched",
    "state_lost": "{file} is lost, though this service has run here before: nobody knows which faults were latched",
    "state_disk_silent": "the disk of {directory} does not answer: nobody knows which faults were latched",
}
