"""Whether charger and BMU of a bay are on one battery: the first amperes must show on the bay's own BMU."""

from orchestrator.core.facts import Facts

#: Charger and BMU are read at different moments; this is far longer than both take to show a current that has begun.
PAIR_S = 3.0


def pairing_not_proved(f: Facts) -> str | None:
    """FAULTS P8."""
    known = f.memory.witnessed
    if not f.energised or known.proved or known.alone_s < PAIR_S or f.amps is None:
        return None
    name, seen_a = f.rules.bay.name, (f.pack_a or 0.0) - known.before_a
    if f.snapshot.moves:
        return (
            f"the charger of {name} moves the BMU of {f.snapshot.moves}: it has begun with {f.amps:.2f} A, and the BMU "
            f"of {name} sees {seen_a:.2f} A of it. Their cables or node ids are swapped"
        )
    return (
        f"the charger of {name} has begun with {f.amps:.2f} A, and its BMU (node "
        f"0x{f.rules.bay.battery.node_id:02X}) sees {seen_a:.2f} A of it: they are not on one battery"
    )
