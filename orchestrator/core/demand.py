"""What a bay asks of its supply, and what its charger is seen to be at: what `allocate()` needs to know of it."""

from orchestrator.config.amperes import highest_step
from orchestrator.core import limits
from orchestrator.core.facts import Facts
from orchestrator.core.safestop import stands_by
from orchestrator.core.states import AT_WORK, OUT_OF_HAND, PRECHARGING
from orchestrator.core.supply import Want
from orchestrator.model import Decision

WAITS = "waits_for_supply"
NOTHING = Want()


def want(f: Facts, decision: Decision) -> Want:
    """What the bay would use now, if its supply granted it. `f` are the facts after the decision."""
    if decision.state not in AT_WORK and decision.cause.id != WAITS:
        return NOTHING
    if decision.state in PRECHARGING or not f.rules.manual:
        return Want(1, keeps=decision.state in PRECHARGING)
    worst = decision.faults[0] if decision.faults else None
    step = highest_step(limits.lowest(f, worst).allowed_a, f.rules.worst_a)
    taper = f.rules.taper
    tail = taper is not None and f.pack_v is not None and f.pack_v >= taper.above_v
    return Want(1 if step is None else step + 1, keeps=tail and f.energised)


def level(f: Facts) -> int | None:
    """The level that the charger is verified to be at, or below; None if it is not in hand.

    Its step and both measured currents count, the highest of them; standby only as far as it is proved.
    """
    reading = f.reading
    if reading is None or not f.charger.online or f.memory.state in OUT_OF_HAND:
        return None
    if not f.energised and stands_by(f):
        return 0
    if not f.rules.manual:
        return 1
    amps = max(reading.current_a, f.pack_a or 0.0)
    most_a = [f.rules.measured_most_a(worst_a) for worst_a in f.rules.worst_a]
    flows = next((step for step, bound_a in enumerate(most_a) if amps <= bound_a), len(most_a) - 1)
    shown = reading.current_step if reading.current_step is not None else len(most_a) - 1
    return max(shown, flows) + 1
