"""The fault table: one row a fault. A new fault is one row here, one predicate in `checks/`, one test.

Faults name effects, not states; the worst effect wins. `clear` says how a fault ends once its condition is gone:

- AUTO: after `clean_s` without it.
- BACKOFF: after 10 s without it, and 10, 60, 300 s for the first, second, third time in an hour; the fourth latches.
- OPERATOR: when an operator starts the bay (or resets it).
- RESET: when a person resets it; never while the condition is there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from orchestrator.core.checks import battery, charge, obedience, ourselves, reports, state_of_charge
from orchestrator.core.facts import Facts
from orchestrator.core.safestop import OBEY_STOP_S
from orchestrator.core.witnesses import measured, pack, paired, standby
from orchestrator.model import ENERGISED, Cause, Effect, State

Check = Callable[[Facts], Cause | None]
Past = Callable[[Cause, float], Cause]


class Clear(Enum):
    """What ends a fault after its condition is gone."""

    AUTO = auto()
    BACKOFF = auto()
    OPERATOR = auto()
    RESET = auto()


ALWAYS = frozenset(State)
#: The charger was verified to stand by and was not told to run.
AT_REST = frozenset({State.IDLE, State.HELD, State.QUALIFYING, State.FULL, State.SUSPENDED, State.TRIPPED})
AT_WORK = ENERGISED | {State.QUALIFYING}
#: The charger is heard for the first time, or again.
UNSEEN = frozenset({State.STARTING, State.OFFLINE})
QUALIFYING = frozenset({State.QUALIFYING})
UNSTOPPED = frozenset({State.STARTING, State.STOPPING, State.UNCONTROLLABLE})
#: A heartbeat, the NMT start that answers it, and the next heartbeat, at the longest period that can be asked for.
NMT_OBEY_S = 4.0
#: Steady values that all change at once are read from the one a moment before the other.
FOLLOWS_S = 3.0


@dataclass(frozen=True, slots=True)
class Row:
    """One fault: when it is raised, what it does, how it ends, what the operator is told to do."""

    id: str
    source: str  #: its number in the fault catalogue
    effect: Effect
    clear: Clear
    check: Check
    where: frozenset[State]  #: the states it is looked for in; a fault that is raised is followed everywhere
    advice: str  #: what to do
    for_s: float = 0.0  #: the condition must last this long …
    polls: int = 1  #: … and be seen in this many charger readings; both drain while it is away
    clean_s: float = 0.0  #: AUTO, RESET: how long the condition must be gone
    departs: bool = False  #: a battery that leaves in mid-charge looks like this; once it has left, it was no fault
    moment: bool = False  #: it tells of a moment, not of what is: said with how long ago
    at_rest: str = ""  #: the id of what to do once the charger stands by, verified, where that is something else
    past: Past | None = None  #: what is said of it from then on, made of its evidence and of how long it lasted, in s


E = Effect
FAULTS: tuple[Row, ...] = (
    # what the charger reports
    Row("reverse_polarity", "C1", E.TRIP, Clear.RESET, reports.reverse_polarity, ALWAYS,
        "correct the battery's polarity, then reset", clean_s=5),
    Row("polarity_contradicts", "C2", E.TRIP, Clear.RESET, reports.polarity_contradicts, ALWAYS,
        "measure the battery's polarity; if that is right, the charger is defective; then reset", polls=2, clean_s=5),
    Row("error_stop", "C3", E.TRIP, Clear.RESET, reports.error_stop, ALWAYS,
        "look at the charger's own display and manual, then reset"),
    Row("system_stop", "C4", E.STOP, Clear.OPERATOR, reports.system_stop, ALWAYS,
        "find out who stopped the charger, then start"),
    Row("illegal_value", "C19", E.STOP, Clear.BACKOFF, reports.illegal_value, ALWAYS,
        "a value outside its documented list: check the line and the charger's version", polls=2),
    Row("mode_taken_over", "C8", E.STOP, Clear.OPERATOR, reports.mode_taken_over, ALWAYS,
        "set the rotary switch or the station file, then start", polls=2),
    Row("rejected_frame", "C22", E.TRIP, Clear.RESET, reports.rejected_frame, ALWAYS,
        "this charger does not know our commands: check its model and version, then reset"),
    Row("line_taken_over", "C26", E.STOP, Clear.BACKOFF, obedience.line_taken_over, AT_WORK,
        "find the program that uses this port (fuser -v, ModemManager, a getty, a terminal program) and keep it away"),
    Row("line_changed", "C26", E.WARN, Clear.AUTO, obedience.line_taken_over, ALWAYS - AT_WORK,
        "find the program that uses this port (fuser -v, ModemManager, a getty, a terminal program) and keep it away",
        clean_s=10),
    Row("port_locked", "C27", E.STOP, Clear.AUTO, obedience.port_locked, ALWAYS,
        "end that program (fuser -v shows it) and keep it away from this port", clean_s=2),
    Row("noisy_line", "C21", E.WARN, Clear.AUTO, reports.noisy_line, ALWAYS,
        "check the cable, its shield and its ground", clean_s=10),
    # whether it obeys
    Row("charger_silent", "C23, C25", E.STOP, Clear.BACKOFF, obedience.charger_silent, AT_WORK,
        "check the charger's power and its cable"),
    Row("found_running", "G10", E.STOP, Clear.OPERATOR, obedience.found_running, UNSEEN,
        "it was stopped; find out why it ran, then start"),
    Row("rogue_run", "C5", E.TRIP, Clear.RESET, obedience.rogue_run, AT_REST,
        "somebody else commands this charger, or it is defective: find out, then reset"),
    Row("current_without_order", "C29", E.TRIP, Clear.RESET, standby.current_without_order, AT_REST | UNSEEN,
        "cut the charger's mains if the current goes on; if the BMU shows it with the mains off too, restart the BMU, "
        "else check the bay's serial cable and what else charges this pack, then reset", clean_s=5),
    Row("will_not_stop", "C6", E.TRIP, Clear.RESET, obedience.will_not_stop, UNSTOPPED,
        "cut the charger's mains now; reset after it was repaired", for_s=OBEY_STOP_S,
        at_rest="stands_by_now", past=obedience.did_not_stop),
    Row("contactor_lost", "C6", E.STOP, Clear.BACKOFF, obedience.contactor_lost, ALWAYS,
        "check the GPIO chip and the line that the station file names (gpioinfo shows who uses it)"),
    Row("will_not_start", "C7", E.STOP, Clear.BACKOFF, obedience.will_not_start, ENERGISED,
        "check the charger's rotary switch and its mains"),
    Row("stopped_by_itself", "C4", E.STOP, Clear.OPERATOR, obedience.stopped_by_itself, ENERGISED,
        "find out who stopped it, then start", polls=2, departs=True),
    Row("setting_not_obeyed", "C9, C16", E.TRIP, Clear.RESET, obedience.setting_not_obeyed, ENERGISED,
        "check the charger, then reset"),
    Row("limit_reverted", "C28", E.TRIP, Clear.RESET, obedience.limit_reverted, ENERGISED,
        "this charger does not keep what it confirms: check it, then reset"),
    Row("above_step", "C28", E.TRIP, Clear.RESET, obedience.above_step, ENERGISED,
        "check the station file's steps_a against the charger, and the charger, then reset", for_s=2, polls=2),
    Row("over_current", "C11", E.TRIP, Clear.RESET, obedience.over_current, ALWAYS,
        "check the station file's steps_a against the charger, then reset", polls=2),
    Row("early_full", "C18", E.STOP, Clear.OPERATOR, obedience.early_full, ENERGISED,
        "check the BMU's SOC against the pack's voltage, then start", polls=2, departs=True),
    Row("open_circuit", "C13", E.STOP, Clear.BACKOFF, obedience.open_circuit, ENERGISED,
        "check the contacts between charger and battery", departs=True),
    Row("no_battery", "C14", E.STOP, Clear.BACKOFF, obedience.no_battery, ENERGISED,
        "check the contacts between charger and battery", departs=True),
    Row("loose_plug", "C13", E.STOP, Clear.BACKOFF, obedience.loose_plug, ALWAYS,
        "check the battery's plug and its contacts"),
    Row("wakes_too_long", "C15", E.TRIP, Clear.RESET, obedience.wakes_too_long, ENERGISED,
        "the pack may be defective: inspect it, then reset"),
    # charger and battery side by side
    Row("over_voltage", "C10, B14", E.TRIP, Clear.RESET, measured.over_voltage, ALWAYS,
        "inspect pack and charger, check the voltages of policy and station, then reset"),
    Row("volts_disagree", "B15", E.TRIP, Clear.RESET, measured.volts_disagree, ENERGISED,
        "check that this BMU belongs to this charger's battery, then reset", for_s=3),
    Row("pairing_not_proved", "P8", E.STOP, Clear.OPERATOR, paired.pairing_not_proved, ENERGISED,
        "check the serial cables and the node ids of the bays, then start"),
    Row("not_paired", "B15", E.NO_START, Clear.AUTO, measured.volts_disagree, QUALIFYING,
        "check that this BMU belongs to this charger's battery", for_s=1, clean_s=1),
    Row("amps_disagree", "B16", E.TRIP, Clear.RESET, measured.amps_disagree, ENERGISED,
        "check for loads on the battery and for a wrong node id, then reset", for_s=5),
    Row("charger_frozen", "C20", E.STOP, Clear.BACKOFF, measured.charger_frozen, ENERGISED,
        "switch the charger off and on again; if it comes back, replace it", for_s=FOLLOWS_S),
    Row("charger_frozen_at_rest", "C31", E.NO_START, Clear.BACKOFF, measured.charger_frozen_at_rest, AT_REST,
        "switch the charger off and on again; if it comes back, replace it", for_s=FOLLOWS_S),
    Row("bmu_frozen", "B23", E.STOP, Clear.BACKOFF, measured.bmu_frozen, ENERGISED,
        "restart the BMU; if it comes back, have it replaced", for_s=FOLLOWS_S),
    Row("pack_collapsed", "B24", E.TRIP, Clear.RESET, pack.collapsed, ENERGISED,
        "keep people away; inspect the pack and its contacts, then reset"),
    Row("back_feed", "C12", E.TRIP, Clear.RESET, measured.back_feed, ENERGISED,
        "check charger and wiring, then reset", for_s=2),
    # the battery
    Row("bmu_silent", "B1, B5, B19, B21", E.STOP, Clear.BACKOFF, battery.bmu_silent, AT_WORK,
        "check the CAN cable, its termination and the BMU's power", departs=True),
    Row("heartbeat_lost", "B6", E.STOP, Clear.BACKOFF, battery.heartbeat_lost, AT_WORK,
        "check the CAN cable and the BMU's power", departs=True),
    Row("stale_reading", "B2", E.STOP, Clear.BACKOFF, battery.stale_reading, ENERGISED,
        "check the CAN bus for load and errors", departs=True),
    Row("sdo_refused", "B3", E.TRIP, Clear.RESET, battery.sdo_refused, ALWAYS,
        "check the object map against this BMU, then reset"),
    Row("sdo_aborted", "B4", E.STOP, Clear.BACKOFF, battery.sdo_aborted, ALWAYS,
        "the BMU cannot answer now; if it stays so, restart it", for_s=0.5),
    Row("not_operational", "B8", E.STOP, Clear.BACKOFF, battery.not_operational, ENERGISED,
        "find out who else sends NMT commands on this bus", for_s=NMT_OBEY_S),
    Row("bmu_rebooted", "B7", E.STOP, Clear.BACKOFF, battery.bmu_rebooted, ENERGISED,
        "if it happens again, check the BMU's supply"),
    Row("status_trip", "B9", E.TRIP, Clear.RESET, battery.status_trip, ALWAYS,
        "inspect the pack, then reset"),
    Row("status_limit", "B9", E.LIMIT, Clear.AUTO, battery.status_limit, ALWAYS,
        "charging goes on, on the lowest step", clean_s=10),
    Row("emergency", "B9", E.STOP, Clear.OPERATOR, battery.emergency, ALWAYS,
        "look the error up in the BMU's manual; once the BMU has taken it back (restart it if it does not), start"),
    Row("hot_trip", "B10", E.TRIP, Clear.RESET, battery.hot_trip, ALWAYS,
        "keep people away until it has cooled down; inspect the pack, then reset"),
    Row("over_temperature", "B10", E.PAUSE, Clear.AUTO, battery.over_temperature, ALWAYS,
        "goes on when it has cooled down", clean_s=10),
    Row("under_temperature", "B11", E.PAUSE, Clear.AUTO, battery.under_temperature, ALWAYS,
        "goes on when it has warmed up", clean_s=10),
    Row("runaway", "B12", E.TRIP, Clear.RESET, battery.runaway, ENERGISED,
        "keep people away; inspect the pack, then reset", for_s=1),
    Row("temperature_invalid", "B13", E.TRIP, Clear.RESET, battery.temperature_invalid, ALWAYS,
        "no temperature, no charge: check the sensor and the object map, then reset", clean_s=5),
    Row("implausible", "B14, B17", E.STOP, Clear.BACKOFF, battery.implausible, ALWAYS,
        "check the object map against this BMU"),
    Row("under_voltage", "B14", E.NO_START, Clear.AUTO, battery.under_voltage, ALWAYS,
        "too deeply discharged to be woken here: have the pack inspected", for_s=1, clean_s=5),
    Row("needs_precharge", "B14", E.NO_START, Clear.AUTO, battery.needs_precharge, ALWAYS,
        "use a policy with a precharge section", for_s=1, clean_s=5),
    Row("soh_low", "B17", E.NO_START, Clear.AUTO, battery.soh_low, ALWAYS,
        "the pack is worn out: replace it", clean_s=5),
    Row("soc_jump", "B17", E.WARN, Clear.AUTO, state_of_charge.soc_jump, ALWAYS,
        "the BMU may have corrected itself; if it happens often, have it calibrated", clean_s=5, moment=True),
    Row("soc_falls", "B17", E.WARN, Clear.AUTO, state_of_charge.soc_falls, ENERGISED,
        "look for a load on the battery, and have the BMU calibrated", clean_s=60),
    Row("figures_disagree", "B17", E.WARN, Clear.AUTO, state_of_charge.figures_disagree, ENERGISED,
        "check the object map against this BMU, and have the BMU calibrated", for_s=300, clean_s=60),
    Row("soc_not_believed", "B17", E.STOP, Clear.OPERATOR, state_of_charge.soc_not_believed, ENERGISED,
        "have the BMU calibrated, then start"),
    Row("battery_exchanged", "B18", E.STOP, Clear.OPERATOR, state_of_charge.battery_exchanged, ALWAYS,
        "look which battery is in the bay, then start"),
    Row("wrong_policy", "P3", E.NO_START, Clear.AUTO, pack.another_pack, ALWAYS - ENERGISED,
        "give the bay the policy of this battery, or have its BMU calibrated", for_s=1, clean_s=5),
    Row("another_pack", "B25", E.STOP, Clear.OPERATOR, pack.another_pack, ENERGISED,
        "look which battery is in the bay, and have its BMU calibrated, then start", for_s=5),
    # who else is on the bus
    Row("other_master", "B27", E.WARN, Clear.AUTO, battery.other_master, ALWAYS,
        "find that tool, and keep it off this bus while batteries charge", clean_s=10),
    Row("heartbeat_set", "B28", E.WARN, Clear.AUTO, battery.heartbeat_set, ALWAYS,
        "keep other tools from changing this BMU's settings", clean_s=10),
    # the charge
    Row("precharge_no_rise", "C15", E.TRIP, Clear.RESET, charge.precharge_no_rise, ENERGISED,
        "the pack may be defective: inspect it, then reset"),
    Row("precharge_too_long", "C15", E.TRIP, Clear.RESET, charge.precharge_too_long, ENERGISED,
        "the pack may be defective: inspect it, then reset"),
    Row("time_limit", "C17", E.TRIP, Clear.RESET, charge.time_limit, ENERGISED,
        "inspect pack and policy, then reset"),
    Row("ah_limit", "C17", E.TRIP, Clear.RESET, charge.ah_limit, ENERGISED,
        "the pack took more than it holds: inspect it, check the policy's max_ah, then reset"),
    # ourselves
    Row("late", "G6", E.WARN, Clear.AUTO, ourselves.late, ALWAYS,
        "find out what keeps this machine busy", clean_s=10),
    Row("overrun", "G6", E.STOP, Clear.BACKOFF, ourselves.overrun, AT_WORK,
        "find out what keeps this machine busy"),
    Row("suspended", "G7", E.STOP, Clear.BACKOFF, ourselves.suspended, AT_WORK,
        "a gateway must not be suspended: switch that off in its operating system"),
    Row("unkept", "G8, P9", E.NO_START, Clear.AUTO, ourselves.unkept, ALWAYS,
        "make space, or mend the disk of the journal's directory", clean_s=10),
    # Last, since it tells of rows above that could not be judged.
    Row("internal", "G5, P11", E.TRIP, Clear.RESET, ourselves.internal, ALWAYS,
        "this is a defect of the software: report it with the journal, then reset"),
)  # fmt: skip

ROW = {row.id: row for row in FAULTS}
