"""What must be followed from step to step: the session's Ah, how long something lasts, what was shown before."""

from dataclasses import replace

from orchestrator.core.checks.battery import WARMING_S
from orchestrator.core.checks.obedience import NO_CURRENT_A, REVERTS_S
from orchestrator.core.checks.state_of_charge import (
    SOC_DRIFT_PCT_PER_S,
    SOC_OTHER_PCT,
    SOC_RATE_PCT_PER_S,
    SOC_STEP_PCT,
)
from orchestrator.core.drain import drained
from orchestrator.core.facts import CHARGER_STALE_S, SLOW_STALE_S, Facts
from orchestrator.core.finish import FALLEN_PCT, known_full, tapers
from orchestrator.core.memory import Still
from orchestrator.core.rows import follow_rows
from orchestrator.core.states import ENERGISED
from orchestrator.core.witnesses import followed
from orchestrator.core.witnesses.measured import STILL_ABOVE_A
from orchestrator.core.witnesses.standby import sees_current
from orchestrator.model import Action, Cause, ChargeMode, ChargerReading, Operation, Session, State

#: How far apart the kept temperatures are.
WARMTH_EVERY_S = 10.0
#: A battery that leaves in mid-charge and is back within this was not taken away: its plug is loose.
LOOSE_PLUG_S = 60.0
#: … unless its volts are so much other ones: several times what a pack loses when its charge is cut off.
OTHER_V_SHARE = 0.05

Warmth = tuple[tuple[float, float], ...]  #: (t_s, °C), oldest first


def follow(f: Facts, last_s: float | None) -> None:
    """Bring the memory up to this step; `last_s` is the time of the one before."""
    memory, reading = f.memory, f.reading
    passed_s = f.now_s - last_s if last_s is not None else 0.0
    running = reading is not None and reading.operation is Operation.RUNNING
    memory.runs_s = _since(f.runs, memory.runs_s, f.now_s)
    memory.taper_s = _since(memory.state is State.CHARGING and tapers(f), memory.taper_s, f.now_s)
    memory.witnessed = followed.follow(f, passed_s)
    follow_rows(f)
    memory.ran = memory.ran or (f.energised and (running or _began(f)))
    if reading is not None:
        _follow_modes(f, reading, passed_s)
        _follow_settings(f, reading)
    _follow_still(f)
    _follow_departure(f)
    _follow_charge(f)
    _follow_warmth(f)
    _follow_battery(f)
    _follow_session(f, passed_s)


def _began(f: Facts) -> bool:
    """The charge has begun, though no status reply has shown it: a run that is ordered again would undo a stop.

    Either the BMU has seen its current; or the charger, which had left standby and shown the mode that it was told, is
    in standby again.
    """
    memory, reading = f.memory, f.reading
    ordered = memory.order is not None and memory.order.action is Action.RUN
    if ordered and sees_current(f) and (f.pack_a or 0.0) - memory.witnessed.before_a >= followed.FIRST_A:
        return True
    if reading is None or not f.rules.manual:
        return False
    memory.shown = memory.shown or reading.charge_mode in (ChargeMode.CHARGE, ChargeMode.PRECHARGE)
    stood = reading.operation is Operation.STOPPED and reading.charge_mode is ChargeMode.FULL
    return memory.shown and stood


def _since(holds: bool, since_s: float | None, now_s: float) -> float | None:  # noqa: FBT001 - the condition itself
    """Since when something holds without a break."""
    if not holds:
        return None
    return now_s if since_s is None else since_s


def _follow_modes(f: Facts, reading: ChargerReading, passed_s: float) -> None:
    """For how long a running charger has done what leads nowhere."""
    memory, mode = f.memory, reading.charge_mode
    running = reading.operation is Operation.RUNNING
    waking = mode in (ChargeMode.BATTERY_RECOVERY, ChargeMode.PRECHARGE)
    idle = mode is ChargeMode.CHARGE and reading.current_a < NO_CURRENT_A
    memory.search_s = drained(memory.search_s, passed_s, holds=running and mode is ChargeMode.BATTERY_SEARCH)
    memory.wake_s = drained(memory.wake_s, passed_s, holds=running and waking)
    memory.idle_s = drained(memory.idle_s, passed_s, holds=running and idle)


def _follow_settings(f: Facts, reading: ChargerReading) -> None:
    """The step that the charger shows, and how often it went back from one that it had confirmed."""
    memory, step = f.memory, f.memory.step
    if reading.current_limit != memory.limit:
        memory.limit_before, memory.limit, memory.limit_s = memory.limit, reading.current_limit, f.now_s
    told = f.energised and f.rules.manual and step is not None
    shows = told and step is not None and reading.current_limit == step.index
    if told and memory.confirmed and not shows and reading.operation is Operation.RUNNING:
        memory.reverts = (*(t_s for t_s in memory.reverts if f.now_s - t_s < REVERTS_S), f.now_s)
    memory.confirmed = shows


def _follow_still(f: Facts) -> None:
    """Since when the charger's volts and amps are the same to the last digit."""
    reading, pack_v, pack_a, still = f.reading, f.pack_v, f.pack_a, f.memory.still
    if reading is None or pack_v is None or pack_a is None or (f.energised and reading.current_a <= STILL_ABOVE_A):
        f.memory.still = None
    elif still is None or (still.volts, still.amps) != (reading.voltage_v, reading.current_a):
        f.memory.still = Still(f.now_s, reading.voltage_v, reading.current_a, pack_v, pack_a)


def _follow_departure(f: Facts) -> None:
    """A battery that leaves in mid-charge and is back at once: its plug is loose."""
    memory = f.memory
    memory.returned_s = None
    if f.departed:
        if memory.session is not None and memory.left_s is None:
            volts = f.snapshot.battery.voltage_v
            memory.left_s = f.now_s
            memory.left_as = (memory.session.soc_pct, volts.value if volts is not None else None)
    elif memory.left_s is not None and f.battery.online and f.soc is not None and f.pack_v is not None:
        gap_s = f.now_s - memory.left_s
        memory.returned_s = f.now_s if gap_s < LOOSE_PLUG_S and not _is_another(f) else None
        memory.left_s = None


def _is_another(f: Facts) -> bool:
    """What has come is not the battery that left, by its SOC or its volts; those of a loose plug go on."""
    left_pct, left_v = f.memory.left_as
    by_soc = left_pct is not None and f.soc is not None and abs(f.soc - left_pct) > SOC_OTHER_PCT
    by_volts = left_v is not None and f.pack_v is not None and abs(f.pack_v - left_v) > OTHER_V_SHARE * left_v
    return by_soc or by_volts


def _follow_charge(f: Facts) -> None:
    """Steps of the SOC, and its highest value while current flows.

    A battery that was seen to leave, or whose BMU boots, is forgotten: what comes is qualified as another one.
    """
    memory, newest = f.memory, f.snapshot.battery.soc_pct
    memory.peak = _peak(f)
    if f.departed or memory.boots != f.battery.boots:
        memory.charge = (f.now_s, None)
    before_s, before_pct = memory.charge
    if newest is None or f.soc is None or newest.t_s <= before_s:
        return
    memory.charge = (newest.t_s, f.soc)
    if before_pct is None:
        return
    gap_s, step_pct = newest.t_s - before_s, abs(f.soc - before_pct)
    step = Cause.of("soc_step", before_pct=before_pct, soc_pct=f.soc, passed_s=gap_s)
    if gap_s <= SLOW_STALE_S and step_pct > SOC_STEP_PCT + SOC_RATE_PCT_PER_S * gap_s:
        memory.charge_step = (f.now_s, step)
    elif gap_s > SLOW_STALE_S and step_pct > SOC_OTHER_PCT + SOC_DRIFT_PCT_PER_S * gap_s:
        memory.exchange = (f.now_s, step)


def _peak(f: Facts) -> tuple[float, float] | None:
    if f.soc is None or f.pack_a is None or f.pack_a <= STILL_ABOVE_A or not f.energised:
        return None
    peak = f.memory.peak
    return peak if peak is not None and f.soc < peak[1] else (f.now_s, f.soc)


def _follow_warmth(f: Facts) -> None:
    """Keep the last minutes' temperatures, thinned out, for the rate of warming and for jumps.

    After a silence it may be another battery, so nothing from before it is compared with.
    """
    memory, newest = f.memory, f.snapshot.battery.temperature_c
    if newest is None or f.temperature_c is None:
        memory.sample, memory.sample_before, memory.warmth = None, None, ()
        return
    sample = (newest.t_s, newest.value)
    if sample == memory.sample:
        return
    memory.sample_before, memory.sample = memory.sample, sample
    memory.warmth = thinned(memory.warmth, sample)


def thinned(warmth: Warmth, sample: tuple[float, float]) -> Warmth:
    """The kept temperatures with this one, if it is due, and without those that are too old."""
    if warmth and sample[0] - warmth[-1][0] < WARMTH_EVERY_S:
        return warmth
    return (*(kept for kept in warmth if sample[0] - kept[0] <= WARMING_S + WARMTH_EVERY_S), sample)


def _follow_battery(f: Facts) -> None:
    """A battery that left, or whose BMU booted, comes back as one that is not known."""
    memory = f.memory
    if f.energised:
        return
    if memory.full_s is None and f.soc is not None:
        memory.full_s = f.now_s
    if memory.boots != f.battery.boots or not f.battery.online:
        memory.full_pct = None
    if memory.state is not State.STOPPING:
        memory.boots = f.battery.boots


def _follow_session(f: Facts, passed_s: float) -> None:
    """Count time and charge. A gap in the charger's readings counts as nothing beyond their age limit.

    In standby nothing is counted: a suspended charge may last for days, and the offset of a measurement is no charge.
    """
    memory, reading, session = f.memory, f.reading, f.memory.session
    if session is None:
        return
    ah = wh = 0.0
    if reading is not None and reading.t_s != memory.counted_t_s:
        if memory.counted_t_s is not None and not f.standby:
            hours = min(reading.t_s - memory.counted_t_s, CHARGER_STALE_S) / 3600
            ah, wh = reading.current_a * hours, reading.current_a * reading.voltage_v * hours
        memory.counted_t_s = reading.t_s
    session = _followed_full(f, session, passed_s)
    pulse, continuous = (memory.state is stage for stage in (State.PRECHARGE_PULSE, State.PRECHARGE_CONTINUOUS))
    memory.session = replace(
        session,
        elapsed_s=f.now_s - session.started_s,
        energised_s=session.energised_s + (passed_s if f.energised else 0.0),
        charged_ah=session.charged_ah + ah,
        charged_wh=session.charged_wh + wh,
        soc_pct=f.soc if f.soc is not None else session.soc_pct,
        pulse_s=session.pulse_s + (passed_s if pulse else 0.0),
        continuous_s=session.continuous_s + (passed_s if continuous else 0.0),
        rise_s=session.rise_s + (passed_s if pulse or continuous else 0.0),
    )


def _followed_full(f: Facts, session: Session, passed_s: float) -> Session:
    """Once found full a pack stays so, over a pause too, until it is seen to have lost some of it."""
    if session.full and f.soc is not None and f.soc < (session.full_pct or 0.0) - FALLEN_PCT:
        return replace(session, full=None, full_pct=None, held_s=0.0)
    if f.memory.state is not State.CHARGING:
        return session
    if session.full:
        return replace(session, held_s=session.held_s + passed_s)
    full = known_full(f)
    return replace(session, full=full, full_pct=f.soc) if full else session


def follow_state(f: Facts, before: State) -> None:
    """Set up what the new state counts from; called when the state has just changed from `before`."""
    memory = f.memory
    memory.since_s = f.now_s
    memory.ran, memory.reached_s, memory.taper_s, memory.qualified_s = False, None, None, None
    memory.shown = False
    memory.step, memory.raise_s = None, None
    memory.ready, memory.intends, memory.confirmed = False, False, False
    if memory.state not in ENERGISED:
        memory.order = None
        return
    memory.unverified, memory.stopping_s, memory.verified_s = True, None, None
    if before not in ENERGISED:
        memory.resumed, memory.resume_s, memory.order, memory.full_pct = False, f.now_s, None, None
        memory.search_s = memory.idle_s = 0.0  # after a pause the charger looks for the battery anew
        if memory.session is None:
            memory.wake_s = 0.0
            memory.session = Session(started_s=f.now_s, soc_start_pct=f.soc, soc_pct=f.soc)
            memory.counted_t_s = f.reading.t_s if f.reading else None
    if memory.state is not State.CHARGING and memory.session is not None and memory.session.rise_v is None:
        memory.session = replace(memory.session, rise_s=0.0, rise_v=f.pack_v)
