"""What the charger has shown until now: makes the next `ChargerHistory`."""

from orchestrator.core.checks.obedience import NO_CURRENT_A, REVERTS_S
from orchestrator.core.drain import drained
from orchestrator.core.facts import Facts
from orchestrator.core.history.since import since
from orchestrator.core.memory import ChargerHistory, Still
from orchestrator.core.parts import changed
from orchestrator.core.witnesses.measured import STILL_ABOVE_A
from orchestrator.model import ChargeMode, ChargerReading, Operation

#: What a running charger does by its own choice before it charges.
WAKING = (ChargeMode.BATTERY_RECOVERY, ChargeMode.PRECHARGE)


def update(f: Facts, passed_s: float) -> ChargerHistory:
    """The history after these facts."""
    known, reading = f.memory.charger, f.reading
    runs_s, still = since(f.runs, known.runs_s, f.now_s), _still(f)
    if reading is None:
        if runs_s == known.runs_s and still is known.still:
            return known
        return changed(known, runs_s=runs_s, still=still)
    running, mode = reading.operation is Operation.RUNNING, reading.charge_mode
    idle = mode is ChargeMode.CHARGE and reading.current_a < NO_CURRENT_A
    search_s = drained(known.search_s, passed_s, holds=running and mode is ChargeMode.BATTERY_SEARCH)
    wake_s = drained(known.wake_s, passed_s, holds=running and mode in WAKING)
    idle_s = drained(known.idle_s, passed_s, holds=running and idle)
    counted_t_s = reading.t_s if f.memory.session is not None else known.counted_t_s
    was = (known.runs_s, known.still, known.search_s, known.wake_s, known.idle_s, known.counted_t_s)
    if (runs_s, still, search_s, wake_s, idle_s, counted_t_s) != was:
        known = changed(
            known, runs_s=runs_s, still=still, search_s=search_s, wake_s=wake_s, idle_s=idle_s, counted_t_s=counted_t_s
        )
    return _settings(f, known, reading)


def _settings(f: Facts, known: ChargerHistory, reading: ChargerReading) -> ChargerHistory:
    """The step that the charger shows, and how often it reverted from one that it had confirmed."""
    step = f.memory.stage.step
    if reading.current_step != known.limit:
        known = changed(known, limit_before=known.limit, limit=reading.current_step, limit_s=f.now_s)
    told = f.energised and f.rules.manual and step is not None
    shows = told and step is not None and reading.current_step == step.index
    if told and known.confirmed and not shows and reading.operation is Operation.RUNNING:
        recent = (t_s for t_s in known.reverts if f.now_s - t_s < REVERTS_S)
        known = changed(known, reverts=(*recent, f.now_s))
    return known if shows is known.confirmed else changed(known, confirmed=shows)


def _still(f: Facts) -> Still | None:
    """Since when the charger's volts and amps have been the same to the last digit."""
    reading, pack_v, pack_a, still = f.reading, f.pack_v, f.pack_a, f.memory.charger.still
    if reading is None or pack_v is None or pack_a is None or (f.energised and reading.current_a <= STILL_ABOVE_A):
        return None
    if still is None or still.volts != reading.voltage_v or still.amps != reading.current_a:
        return Still(f.now_s, reading.voltage_v, reading.current_a, pack_v, pack_a)
    return still


def told_anew(known: ChargerHistory) -> ChargerHistory:
    """The history when the charger is told another step than the one it has confirmed."""
    return changed(known, confirmed=False) if known.confirmed else known


def begins(f: Facts, known: ChargerHistory) -> ChargerHistory:
    """The history when current is to flow after a rest: the charger searches for the battery again."""
    known = changed(known, search_s=0.0, idle_s=0.0)
    if f.memory.session is not None:
        return known
    return changed(known, wake_s=0.0, counted_t_s=f.reading.t_s if f.reading else None)
