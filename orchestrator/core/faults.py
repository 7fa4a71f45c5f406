"""The fault table: one row per fault. A new fault is one row here, one predicate in `checks/`, one test.

Faults name effects, not states; the worst effect wins. `clear` says how a fault ends once its condition is gone:

- AUTO: after `clean_s` without it.
- BACKOFF: after 10 s without it, then another 10, 60 or 300 s for the first, second or third time in an hour; the
fourth latches.
- OPERATOR: when an operator starts the bay (or resets it).
- RESET: when a person resets it; never while the condition is true.

Of several faults, the one with the worst effect is shown first; among those with the same effect, the most dangerous
one (`RANK`), however old it is.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from math import inf, isfinite

from orchestrator.core.checks import battery, charge, obedience, ourselves, reports, state_of_charge
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Memory
from orchestrator.core.safestop import OBEY_STOP_S
from orchestrator.core.states import AT_REST, AT_WORK, ENERGISED, UNSEEN, UNVERIFIED
from orchestrator.core.witnesses import measured, pack, paired, standby
from orchestrator.model import Cause, Effect, State

Check = Callable[[Facts], Cause | None]
Past = Callable[[Cause, float], Cause]
Until = Callable[[Memory], float | None]


class Clear(Enum):
    """What ends a fault after its condition is gone."""

    AUTO = auto()
    BACKOFF = auto()
    OPERATOR = auto()
    RESET = auto()


ALWAYS = frozenset(State)
QUALIFYING = frozenset({State.QUALIFYING})
#: A heartbeat, the NMT start that answers it, and the next heartbeat, at the longest period that can be asked for.
NMT_OBEY_S = 4.0
#: When steady values all change at once, one device is read a moment before the other.
FOLLOWS_S = 3.0


@dataclass(frozen=True, slots=True)
class FaultRow:
    """One fault: when it is raised, what it does, how it ends. What to do about it is in `text/`, under its id."""

    id: str
    source: str  #: its number in the fault catalogue
    effect: Effect
    clear: Clear
    check: Check
    where: frozenset[State]  #: the states in which it is looked for; a raised fault is followed everywhere
    for_s: float = 0.0  #: the condition must last this long …
    polls: int = 1  #: … and be seen in this many charger readings; both drain while it is false
    clean_s: float = 0.0  #: AUTO, RESET: how long the condition must be gone
    departs: bool = False  #: a battery removed in mid-charge looks like this; once it is gone, it was no fault
    moment: bool = False  #: it describes a moment, not a condition: in the past tense from the beginning
    figures: str = ""  #: the parameters of its evidence that are updated while it is true, and once it is gone
    lowest: bool = False  #: the worst value of its figure is the lowest one
    until: Until | None = None  #: when its condition ends by the mere passing of time; None: not known
    at_rest: str = ""  #: the id of the advice once the charger is in standby, verified, if that differs
    past: Past | None = None  #: its cause from then on, made from its evidence and how long it lasted, in s


def _doubts_end_s(memory: Memory) -> float | None:
    """When fewer than two doubts will remain; None if that is not known."""
    ends_s = []
    for name in state_of_charge.DOUBTS:
        row, fault = ROW[name], memory.faults.get(name)
        if fault is None or fault.raised_s is None:
            continue
        gone_s = fault.clean_s if row.until is None or fault.clean_s is not None else row.until(memory)
        ends_s.append(inf if gone_s is None else gone_s + row.clean_s)
    end_s = sorted(ends_s)[-2] if len(ends_s) > 1 else inf
    return end_s if isfinite(end_s) else None


E = Effect
FAULTS: tuple[FaultRow, ...] = (
    # what the charger reports
    FaultRow("reverse_polarity", "C1", E.TRIP, Clear.RESET, reports.reverse_polarity, ALWAYS, clean_s=5),
    FaultRow("polarity_contradicts", "C2", E.TRIP, Clear.RESET, reports.polarity_contradicts, ALWAYS, polls=2,
             clean_s=5),
    FaultRow("error_stop", "C3", E.TRIP, Clear.RESET, reports.error_stop, ALWAYS),
    FaultRow("system_stop", "C4", E.STOP, Clear.OPERATOR, reports.system_stop, ALWAYS),
    FaultRow("illegal_value", "C19", E.STOP, Clear.BACKOFF, reports.illegal_value, ALWAYS, polls=2),
    FaultRow("mode_taken_over", "C8", E.STOP, Clear.OPERATOR, reports.mode_taken_over, ALWAYS, polls=2),
    FaultRow("rejected_frame", "C22", E.TRIP, Clear.RESET, reports.rejected_frame, ALWAYS, moment=True),
    FaultRow("line_taken_over", "C26", E.STOP, Clear.BACKOFF, obedience.line_taken_over, AT_WORK, moment=True),
    FaultRow("line_changed", "C26", E.WARN, Clear.AUTO, obedience.line_taken_over, ALWAYS - AT_WORK, clean_s=10,
             moment=True),
    FaultRow("port_locked", "C27", E.STOP, Clear.AUTO, obedience.port_locked, ALWAYS, clean_s=2),
    FaultRow("noisy_line", "C21", E.WARN, Clear.AUTO, reports.noisy_line, ALWAYS, clean_s=10, figures="bad_pct"),
    # whether it obeys
    FaultRow("charger_silent", "C23, C25", E.STOP, Clear.BACKOFF, obedience.charger_silent, AT_WORK),
    FaultRow("found_running", "G10", E.STOP, Clear.OPERATOR, obedience.found_running, UNSEEN, moment=True),
    FaultRow("rogue_run", "C5", E.TRIP, Clear.RESET, obedience.rogue_run, AT_REST, figures="charger_a"),
    FaultRow("current_without_order", "C29", E.TRIP, Clear.RESET, standby.current_without_order, AT_REST | UNSEEN,
             clean_s=5, figures="pack_a charger_a"),
    FaultRow("will_not_stop", "C6", E.TRIP, Clear.RESET, obedience.will_not_stop, UNVERIFIED,
             for_s=OBEY_STOP_S, at_rest="stands_by_now", past=obedience.did_not_stop, figures="charger_a"),
    FaultRow("contactor_lost", "C6", E.STOP, Clear.BACKOFF, obedience.contactor_lost, ALWAYS),
    FaultRow("will_not_start", "C7", E.STOP, Clear.BACKOFF, obedience.will_not_start, ENERGISED),
    FaultRow("stopped_by_itself", "C4", E.STOP, Clear.OPERATOR, obedience.stopped_by_itself, ENERGISED,
             polls=2, departs=True, moment=True),
    FaultRow("setting_not_obeyed", "C9, C16", E.TRIP, Clear.RESET, obedience.setting_not_obeyed, ENERGISED),
    FaultRow("limit_reverted", "C28", E.TRIP, Clear.RESET, obedience.limit_reverted, ENERGISED, moment=True),
    FaultRow("above_step", "C28", E.TRIP, Clear.RESET, obedience.above_step, ENERGISED, for_s=2, polls=2,
             figures="charger_a"),
    FaultRow("over_current", "C11", E.TRIP, Clear.RESET, obedience.over_current, ALWAYS, polls=2, figures="charger_a"),
    FaultRow("early_full", "C18", E.STOP, Clear.OPERATOR, obedience.early_full, ENERGISED, polls=2, departs=True,
             figures="soc_pct"),
    FaultRow("open_circuit", "C13", E.STOP, Clear.BACKOFF, obedience.open_circuit, ENERGISED, departs=True),
    FaultRow("no_battery", "C14", E.STOP, Clear.BACKOFF, obedience.no_battery, ENERGISED, departs=True),
    FaultRow("loose_plug", "C13", E.STOP, Clear.BACKOFF, obedience.loose_plug, ALWAYS, moment=True),
    FaultRow("wakes_too_long", "C15", E.TRIP, Clear.RESET, obedience.wakes_too_long, ENERGISED),
    # charger and battery side by side
    FaultRow("over_voltage", "C10, B14", E.TRIP, Clear.RESET, measured.over_voltage, ALWAYS,
             figures="charger_v pack_v"),
    FaultRow("volts_disagree", "B15", E.TRIP, Clear.RESET, measured.volts_disagree, ENERGISED, for_s=3,
             figures="charger_v pack_v"),
    FaultRow("pairing_not_proved", "P8", E.STOP, Clear.OPERATOR, paired.pairing_not_proved, ENERGISED),
    FaultRow("not_paired", "B15", E.NO_START, Clear.AUTO, measured.volts_disagree, QUALIFYING, for_s=1, clean_s=1,
             figures="charger_v pack_v"),
    FaultRow("amps_disagree", "B16", E.TRIP, Clear.RESET, measured.amps_disagree, ENERGISED, for_s=5,
             figures="charger_a pack_a"),
    FaultRow("charger_frozen", "C20", E.STOP, Clear.BACKOFF, measured.charger_frozen, ENERGISED, for_s=FOLLOWS_S),
    FaultRow("charger_frozen_at_rest", "C31", E.NO_START, Clear.BACKOFF, measured.charger_frozen_at_rest, AT_REST,
             for_s=FOLLOWS_S),
    FaultRow("bmu_frozen", "B23", E.STOP, Clear.BACKOFF, measured.bmu_frozen, ENERGISED, for_s=FOLLOWS_S),
    FaultRow("pack_collapsed", "B24", E.TRIP, Clear.RESET, pack.collapsed, ENERGISED, figures="pack_v", lowest=True),
    FaultRow("back_feed", "C12", E.TRIP, Clear.RESET, measured.back_feed, ENERGISED, for_s=2, figures="discharge_a"),
    # the battery
    FaultRow("bmu_silent", "B1, B5, B19, B21", E.STOP, Clear.BACKOFF, battery.bmu_silent, AT_WORK, departs=True),
    FaultRow("heartbeat_lost", "B6", E.STOP, Clear.BACKOFF, battery.heartbeat_lost, AT_WORK, departs=True),
    FaultRow("stale_reading", "B2", E.STOP, Clear.BACKOFF, battery.stale_reading, ENERGISED, departs=True),
    FaultRow("sdo_refused", "B3", E.TRIP, Clear.RESET, battery.sdo_refused, ALWAYS),
    FaultRow("sdo_aborted", "B4", E.STOP, Clear.BACKOFF, battery.sdo_aborted, ALWAYS, for_s=0.5),
    FaultRow("not_operational", "B8", E.STOP, Clear.BACKOFF, battery.not_operational, ENERGISED, for_s=NMT_OBEY_S),
    FaultRow("bmu_rebooted", "B7", E.STOP, Clear.BACKOFF, battery.bmu_rebooted, ENERGISED, moment=True),
    FaultRow("status_trip", "B9", E.TRIP, Clear.RESET, battery.status_trip, ALWAYS),
    FaultRow("status_limit", "B9", E.LIMIT, Clear.AUTO, battery.status_limit, ALWAYS, clean_s=10),
    FaultRow("emergency", "B9", E.STOP, Clear.OPERATOR, battery.emergency, ALWAYS),
    FaultRow("hot_trip", "B10", E.TRIP, Clear.RESET, battery.hot_trip, ALWAYS, figures="pack_c"),
    FaultRow("over_temperature", "B10", E.PAUSE, Clear.AUTO, battery.over_temperature, ALWAYS, clean_s=10,
             figures="pack_c"),
    FaultRow("under_temperature", "B11", E.PAUSE, Clear.AUTO, battery.under_temperature, ALWAYS, clean_s=10,
             figures="pack_c", lowest=True),
    FaultRow("current_paused", "P12", E.PAUSE, Clear.AUTO, charge.no_step_allowed, ENERGISED, clean_s=10),
    FaultRow("runaway", "B12", E.TRIP, Clear.RESET, battery.runaway, ENERGISED, for_s=1, figures="rate_k_per_min"),
    FaultRow("temperature_invalid", "B13", E.TRIP, Clear.RESET, battery.temperature_invalid, ALWAYS, clean_s=5,
             figures="pack_c"),
    FaultRow("implausible", "B14, B17", E.STOP, Clear.BACKOFF, battery.implausible, ALWAYS),
    FaultRow("under_voltage", "B14", E.NO_START, Clear.AUTO, battery.under_voltage, ALWAYS, for_s=1, clean_s=5,
             figures="pack_v", lowest=True),
    FaultRow("needs_precharge", "B14", E.NO_START, Clear.AUTO, battery.needs_precharge, ALWAYS, for_s=1, clean_s=5),
    FaultRow("soh_low", "B17", E.NO_START, Clear.AUTO, battery.soh_low, ALWAYS, clean_s=5, figures="soh_pct",
             lowest=True),
    FaultRow("soc_jump", "B17", E.WARN, Clear.AUTO, state_of_charge.soc_jump, ALWAYS, clean_s=5, moment=True,
             until=state_of_charge.jump_ends_s),
    FaultRow("soc_falls", "B17", E.WARN, Clear.AUTO, state_of_charge.soc_falls, ENERGISED, clean_s=60,
             figures="soc_pct",
             lowest=True),
    FaultRow("figures_disagree", "B17", E.WARN, Clear.AUTO, state_of_charge.figures_disagree, ENERGISED,
             for_s=300, clean_s=60),
    FaultRow("soc_not_believed", "B17", E.STOP, Clear.OPERATOR, state_of_charge.soc_not_believed, ENERGISED,
             until=_doubts_end_s),
    FaultRow("battery_exchanged", "B18", E.STOP, Clear.OPERATOR, state_of_charge.battery_exchanged, ALWAYS, moment=True,
             until=state_of_charge.exchange_ends_s),
    FaultRow("wrong_policy", "P3", E.NO_START, Clear.AUTO, pack.another_pack, ALWAYS - ENERGISED, for_s=1, clean_s=5,
             figures="pack_v soc_pct"),
    FaultRow("another_pack", "B25", E.STOP, Clear.OPERATOR, pack.another_pack, ENERGISED, for_s=5,
             figures="pack_v soc_pct"),
    FaultRow("no_step_allowed", "P12", E.NO_START, Clear.AUTO, charge.no_step_allowed, QUALIFYING, for_s=1, clean_s=5),
    FaultRow("precharge_too_strong", "P12", E.NO_START, Clear.AUTO, charge.precharge_too_strong, QUALIFYING,
             for_s=1, clean_s=5, figures="pack_v"),
    # others on the bus
    FaultRow("other_master", "B27", E.WARN, Clear.AUTO, battery.other_master, ALWAYS, clean_s=10),
    FaultRow("heartbeat_set", "B28", E.WARN, Clear.AUTO, battery.heartbeat_set, ALWAYS, clean_s=10),
    # the charge
    FaultRow("precharge_no_rise", "C15", E.TRIP, Clear.RESET, charge.precharge_no_rise, ENERGISED),
    FaultRow("precharge_too_long", "C15", E.TRIP, Clear.RESET, charge.precharge_too_long, ENERGISED),
    FaultRow("time_limit", "C17", E.TRIP, Clear.RESET, charge.time_limit, ENERGISED),
    FaultRow("ah_limit", "C17", E.TRIP, Clear.RESET, charge.ah_limit, ENERGISED),
    # ourselves
    FaultRow("late", "G6", E.WARN, Clear.AUTO, ourselves.late, ALWAYS, clean_s=10, moment=True),
    FaultRow("overrun", "G6", E.STOP, Clear.BACKOFF, ourselves.overrun, AT_WORK, moment=True),
    FaultRow("suspended", "G7", E.STOP, Clear.BACKOFF, ourselves.suspended, AT_WORK, moment=True),
    FaultRow("not_persisted", "G8, P9", E.NO_START, Clear.AUTO, ourselves.not_persisted, ALWAYS, clean_s=10),
    FaultRow("supply_failed", "G11", E.WARN, Clear.AUTO, ourselves.supply_failed, ALWAYS, clean_s=10),
    # Last, because it reports rows above that could not be judged.
    FaultRow("internal", "G5, P11", E.TRIP, Clear.RESET, ourselves.internal, ALWAYS),
)  # fmt: skip


class _Rows(dict[str, FaultRow]):
    """The rows by id. One that only another version knows stays latched until a reset; nothing here looks for it."""

    def __missing__(self, name: str) -> FaultRow:
        return FaultRow(name, "", Effect.TRIP, Clear.RESET, lambda _: None, frozenset(), moment=True)


class _Ranks(dict[str, int]):
    """The ranks by id. Unknown dangers come after the known ones."""

    def __missing__(self, name: str) -> int:
        return len(self)


ROW = _Rows({row.id: row for row in FAULTS})

#: Shown before all other faults with the same effect, the most dangerous first: current that nobody controls, then what
#: may burn, then what destroys. All others follow in table order.
DANGERS = (
    "will_not_stop", "current_without_order", "rogue_run", "port_locked", "found_running",
    "hot_trip", "runaway", "pack_collapsed", "over_voltage", "over_current", "above_step", "status_trip",
    "temperature_invalid", "reverse_polarity", "polarity_contradicts", "volts_disagree", "amps_disagree", "back_feed",
    "another_pack", "pairing_not_proved", "bmu_silent", "charger_silent", "over_temperature", "under_temperature",
)  # fmt: skip
RANK = _Ranks({name: rank for rank, name in enumerate(dict.fromkeys((*DANGERS, *ROW)))})
