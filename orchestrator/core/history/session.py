"""The open charge with all its counters: makes the next `Session`."""

from orchestrator.core.facts import CHARGER_STALE_S, Facts
from orchestrator.core.finish import FALLEN_PCT, known_full
from orchestrator.core.parts import changed
from orchestrator.core.states import ENERGISED
from orchestrator.model import Cause, Session, State


def update(f: Facts, passed_s: float, counted_t_s: float | None) -> Session | None:
    """Count time and charge; `counted_t_s` is the reading up to which the charge is counted.

    A gap in the charger's readings counts only up to their age limit. Nothing is counted in standby: a suspended charge
    may last for days, and the offset of a measurement is no charge.
    """
    reading, session, state = f.reading, f.memory.session, f.memory.state
    if session is None:
        return None
    ah = wh = 0.0
    if reading is not None and counted_t_s is not None and reading.t_s != counted_t_s and not f.standby:
        hours = min(reading.t_s - counted_t_s, CHARGER_STALE_S) / 3600
        ah, wh = reading.current_a * hours, reading.current_a * reading.voltage_v * hours
    session = _full(f, session, passed_s)
    pulse_s = passed_s if state is State.PRECHARGE_PULSE else 0.0
    continuous_s = passed_s if state is State.PRECHARGE_CONTINUOUS else 0.0
    return changed(
        session,
        elapsed_s=f.now_s - session.started_s,
        energised_s=session.energised_s + (passed_s if f.energised else 0.0),
        charged_ah=session.charged_ah + ah,
        charged_wh=session.charged_wh + wh,
        soc_pct=f.soc if f.soc is not None else session.soc_pct,
        pulse_s=session.pulse_s + pulse_s,
        continuous_s=session.continuous_s + continuous_s,
        rise_s=session.rise_s + pulse_s + continuous_s,
    )


def _full(f: Facts, session: Session, passed_s: float) -> Session:
    """A pack found full stays so, even over a pause, until it is seen to have lost some of its charge."""
    if session.full and f.soc is not None and f.soc < (session.full_pct or 0.0) - FALLEN_PCT:
        return changed(session, full=None, full_pct=None, held_s=0.0)
    if f.memory.state is not State.CHARGING:
        return session
    if session.full:
        return changed(session, held_s=session.held_s + passed_s)
    full = known_full(f)
    return changed(session, full=full, full_pct=f.soc) if full else session


def begins(f: Facts, state: State, before: State) -> Session | None:
    """The open charge, or a new one, when the energised `state` begins after `before`."""
    session = f.memory.session
    if session is None and before not in ENERGISED:
        session = Session(started_s=f.now_s, soc_start_pct=f.soc, soc_pct=f.soc)
    if session is None or state is State.CHARGING or session.rise_v is not None:
        return session
    return rise_counts(f, session)


def rise_counts(f: Facts, session: Session) -> Session:
    """Count the pack's rise in precharge from now on."""
    return changed(session, rise_s=0.0, rise_v=f.pack_v)


def step_changed(session: Session | None) -> Session | None:
    """Count one more change of the current step."""
    return changed(session, step_changes=session.step_changes + 1) if session is not None else None


def ended(session: Session, result: Cause) -> Session:
    """The finished charge, with its result."""
    return changed(session, result=result)
