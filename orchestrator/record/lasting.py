"""How long something lasted, and what a charge came to, for people."""

from collections.abc import Mapping

from orchestrator.model import Cause

#: From here on a time is told in the larger unit.
MINUTE_S, HOUR_S, DAY_S = 60.0, 3600.0, 86_400.0


def lasting(seconds: float) -> Cause:
    """A time in the units that a person would use."""
    if seconds < 2 * MINUTE_S:
        return Cause.of("age_s", age=max(seconds, 0.0))
    if seconds < HOUR_S:
        return Cause.of("age_min", age=seconds / MINUTE_S)
    if seconds < 2 * DAY_S:
        minutes = int(seconds // MINUTE_S)
        return Cause.of("lasts_h", hours=minutes // 60, minutes=minutes % 60)
    return Cause.of("lasts_d", days=int(seconds // DAY_S), hours=int(seconds % DAY_S // HOUR_S))


def session_figures(session: Mapping[str, object]) -> Cause:
    """The figures of a session as status and journal have them; what is missing is a dash."""
    begin, end, elapsed_s = (session.get(name) for name in ("soc_start_pct", "soc_pct", "elapsed_s"))
    soc = Cause.of("session_soc", begin=begin, end=end) if begin is not None and end is not None else None
    lasted = lasting(elapsed_s) if isinstance(elapsed_s, int | float) else None
    ah, wh = session.get("charged_ah"), session.get("charged_wh")
    return Cause.of("session_so_far", ah=ah, wh=wh, lasted=lasted, soc=soc)
