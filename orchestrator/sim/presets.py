"""The packs available to an emulated station."""

from collections.abc import Callable, Mapping

from orchestrator.sim.pack import Pack

#: The deepest discharge of this model: 2.54 V per cell.
BOTTOM_PCT = -100.0


def demo() -> Pack:
    """A 13S pack so small that a whole charge takes a minute: 33 V, pulse, continuous, 14 A, taper, full.

    Capacity and deep discharge are toy-sized; resistance and heat are those of an e-bike pack, so that 14 A neither
    lifts the voltage out of range nor heats the pack by more than a degree in that minute.
    """
    pack = Pack(
        cells=13,
        capacity_ah=0.15,
        deep_ah=0.0024,
        resistance_ohm=0.08,
        heat_j_per_k=900.0,
        cooling_w_per_k=1.0,
    )
    pack.set_soc(BOTTOM_PCT)
    return pack


def pack_48v() -> Pack:
    """A 13S pack of 20 Ah at 50 %: it stays in mid-charge for as long as a test needs."""
    pack = Pack()
    pack.set_soc(50.0)
    return pack


PACKS: Mapping[str, Callable[[], Pack]] = {"demo": demo, "48v": pack_48v}
