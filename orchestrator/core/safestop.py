"""The safe stop: when a charger must be told to stop, and what proves that it did.

Theory of operation. The safe state is *verified* standby: a status reply, requested after the whole stop was handed to
the port, that shows operation 0 and a current of about 0. Until then the standing order is STOP, which the port repeats
every 500 ms. A charger that has not been verified after `OBEY_STOP_S` is uncontrollable: the order stays, the
contactor opens, and only a verified standby ends it. In states of rest the standing order is nothing, as long as fresh
replies go on to show standby; the moment one does not, it is STOP again.

Standby does not show whether both frames of a stop were heard, and a charger that missed the second one may run on its
old values as soon as it is resumed. So a bay that qualifies for a charge stops its charger once more.
"""

from orchestrator.core.facts import Facts
from orchestrator.model import State

#: A stop that is not verified within this is not obeyed (DESIGN §6).
OBEY_STOP_S = 3.0
#: A charger that has not answered for this long at the start is not there.
LOST_S = 3.0


def must_stop(f: Facts, state: State) -> bool:
    """Whether the standing order is STOP in `state`, given what the charger shows."""
    if state in (State.STARTING, State.STOPPING, State.UNCONTROLLABLE):
        return True
    if state in (State.OFFLINE, State.QUALIFYING):
        return not f.stopped
    return not f.standby


def gives_up(f: Facts) -> bool:
    """The charger has had its time.

    At the start it has first to be found; one that does not answer at all is not there: that is OFFLINE.
    """
    if f.memory.state is State.STOPPING:
        return f.state_s >= OBEY_STOP_S
    if f.memory.state is not State.STARTING or f.reading is None:
        return False
    runs_s = f.memory.runs_s
    return (runs_s is not None and f.now_s - runs_s >= OBEY_STOP_S) or f.state_s >= LOST_S + OBEY_STOP_S
