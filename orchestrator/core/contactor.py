"""The contactor between charger and battery: when it is closed.

Theory of operation. It is the second way to end a current, for a charger that no longer obeys. So it is closed only
while the charger is known to obey: it was verified in standby, or charges under supervision. It opens without current
wherever possible, since a contactor that breaks a load wears out, and may weld. In STOPPING it stays as it is until
standby is verified or the stop has failed (`safestop.OBEY_STOP_S`); then it breaks whatever flows.

It is closed at rest, too, and not only to charge. Behind an open contactor the charger sees no battery, so a battery
that was removed could not be told from one whose BMU is silent, nor could charger and BMU be checked to be on the same
one. OFFLINE may mean the charger or the BMU: there it is closed as long as the charger itself reports standby. TRIPPED
stays isolated until a person has looked. The charger must keep its mains: a dead one can prove nothing.
"""

from orchestrator.core.states import OBEYS
from orchestrator.model import State


def closes(state: State, *, closed: bool, standby: bool) -> bool:
    """Whether the contactor is to be closed in `state`.

    `closed`: it was until now. `standby`: the charger freshly reports that it is stopped and delivers nothing.
    """
    if state is State.STOPPING:
        return closed
    if state is State.OFFLINE:
        return standby
    return state in OBEYS
