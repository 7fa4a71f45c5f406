"""The contactor between charger and battery: when it is closed.

Theory of operation. It is the second way to end a current, for a charger that cannot be told any more. So it is closed
only while the charger is known to do as it is told: it was verified to stand by, or charges and is supervised. It opens
without current wherever that is possible, since a contactor that breaks a load wears out, and may weld: in STOPPING it
stays as it is, until standby is verified or the stop has failed (`safestop.OBEY_STOP_S`); then it breaks what flows.

It is closed at rest, too, and not only to charge: behind an open contactor the charger sees no battery, so that nobody
could tell one that has left from one whose BMU is silent, or whether charger and BMU are on the same one. OFFLINE may
mean the charger or the BMU: it is closed there as long as the charger itself says that it stands by. What is TRIPPED
stays isolated until a person has looked. The charger must keep its mains: one that is dead can prove nothing.
"""

from orchestrator.core.states import OBEYS
from orchestrator.model import State


def closes(state: State, *, closed: bool, standby: bool) -> bool:
    """Whether the contactor is to be closed in `state`.

    `closed`: it was until now. `standby`: the charger says, freshly, that it is stopped and delivers nothing.
    """
    if state is State.STOPPING:
        return closed
    if state is State.OFFLINE:
        return standby
    return state in OBEYS
