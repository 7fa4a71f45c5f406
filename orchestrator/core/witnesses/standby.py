"""Standby by both witnesses: no charger is in standby while the BMU sees current flow into its pack.

The proof is two status replies that show standby, each asked for after the whole stop was handed to the port, with
nothing else between them; and, if the BMU can be heard, one of its values from after the stop.
"""

from typing import TYPE_CHECKING

from orchestrator.model import Cause

if TYPE_CHECKING:
    from orchestrator.core.facts import Facts

#: More current than this into the pack is no offset of a measurement (FAULTS C29).
CHARGING_A = 1.0
#: A BMU may report an earlier current for this long, because it averages. Anything longer counts as at most the second
#: figure, so that it is forgotten within half a minute.
UNORDERED_S, UNORDERED_MOST_S = 2.0, 6.0

#: The fault of a BMU that was found frozen.
FROZEN = "bmu_frozen"


def sees_current(f: "Facts") -> bool:
    """The BMU freshly reports that current flows into its pack. One known to be frozen is no witness."""
    return f.pack_a is not None and f.pack_a > CHARGING_A and FROZEN not in f.raised


def proved(f: "Facts") -> bool:
    """The only proof of standby that is accepted."""
    known = f.memory.witnessed
    if len(known.proof) < 2 or known.stop_s is None or not f.standby:
        return False
    measured = f.snapshot.battery.current_a
    return f.pack_a is None or measured is None or (measured.t_s >= known.stop_s and not sees_current(f))


def current_without_order(f: "Facts") -> Cause | None:
    """FAULTS C29."""
    if not f.unordered or f.pack_a is None:
        return None
    if f.reading is None:
        return Cause.of("current_unheard", pack_a=f.pack_a)
    return Cause.of("current_without_order", pack_a=f.pack_a, charger_a=f.reading.current_a)
