"""Whether charger and BMU of a bay are on one battery: the first amperes must show on the bay's own BMU."""

from orchestrator.core.facts import Facts
from orchestrator.model import Cause

#: Charger and BMU are read at different moments; both take far less than this to show a current that has begun.
PAIR_S = 3.0


def pairing_not_proved(f: Facts) -> Cause | None:
    """FAULTS P8."""
    known = f.memory.witnessed
    if not f.energised or known.proved or known.alone_s < PAIR_S or f.amps is None:
        return None
    bay, seen_a = f.rules.bay, (f.pack_a or 0.0) - known.before_a
    if f.snapshot.moves:
        return Cause.of("moves_other", bay=bay.name, other=f.snapshot.moves, charger_a=f.amps, seen_a=seen_a)
    node_id = bay.battery.node_id
    return Cause.of("pairing_not_proved", bay=bay.name, charger_a=f.amps, node_id=node_id, seen_a=seen_a)
