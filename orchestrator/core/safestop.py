"""The safe stop: when a charger must be told to stop, what proves that it did, and when it is out of control.

Theory of operation. The safe state is *verified* standby, by both witnesses (`witnesses/standby.py`). Until then the
standing order is STOP, which the port repeats every 500 ms. A charger that has not been verified after `OBEY_STOP_S` is
uncontrollable: the order stays, the contactor opens, people are alarmed, and only a standby that lasts for `LASTS_S`
ends it. In states of rest the standing order is nothing, as long as fresh replies go on to show standby; the moment one
does not, or the BMU sees current, it is STOP again.

One that runs again within `LASTS_S` was never verified, whatever it said: its time counts on from the first stop.

Standby does not show whether both frames of a stop were heard, and a charger that missed the second one may run on its
old values as soon as it is resumed. So a bay that qualifies for a charge stops its charger once more.
"""

from orchestrator.core.facts import Facts
from orchestrator.core.states import UNVERIFIED
from orchestrator.model import State

#: A stop that is not verified within this is not obeyed (DESIGN §6).
OBEY_STOP_S = 3.0
#: A charger that has not answered for this long at the start is not there.
LOST_S = 3.0
#: A standby that has lasted for this long is one (FAULTS C30).
LASTS_S = 10.0


def must_stop(f: Facts, state: State) -> bool:
    """Whether the standing order is STOP in `state`, given what both witnesses show."""
    if state in UNVERIFIED:
        return True
    if state in (State.OFFLINE, State.QUALIFYING):
        return not f.stopped
    return not f.standby or f.unordered


def follow_stop(f: Facts, before: State) -> None:
    """Keep `stopping_s`, `verified_s` and `unverified` of the memory, when the state has just changed."""
    memory = f.memory
    if before in UNVERIFIED and memory.state not in UNVERIFIED:
        if f.stopped:
            memory.verified_s, memory.unverified = f.now_s, False
        if memory.stopping_s is None and "found_running" in f.raised:  # that was a first stop, too
            memory.stopping_s = memory.since_s
    elif before not in UNVERIFIED and memory.state in UNVERIFIED:
        lasted_s = f.now_s - memory.verified_s if memory.verified_s is not None else LASTS_S
        runs_again = (f.runs or f.unordered) and lasted_s < LASTS_S and memory.stopping_s is not None
        memory.returns = memory.returns + 1 if runs_again else 0
        if not runs_again:
            memory.stopping_s = f.now_s


def proved_to_last(f: Facts) -> bool:
    """The charger, which did not obey before, has stood by for long enough to be believed."""
    proof = f.memory.witnessed.proof
    return f.stopped and f.charger.online and f.now_s - proof[0] >= LASTS_S


def verified(f: Facts) -> bool:
    """The stop that is being tried is done."""
    return proved_to_last(f) if f.memory.state is State.UNCONTROLLABLE else f.stopped


def stands_by(f: Facts) -> bool:
    """By what is known now, in whatever state: the charger does not run, and nothing is left to be verified."""
    return verified(f) if f.memory.state in UNVERIFIED else not must_stop(f, f.memory.state)


def _runs_again(f: Facts) -> bool:
    """It was stopped before, in vain. One reply alone may be a stray measurement: a second one, or a second return, is
    none."""
    since_s, stopping_s, reading = f.memory.since_s, f.memory.stopping_s, f.reading
    if since_s is None or stopping_s is None or f.now_s - stopping_s < OBEY_STOP_S:
        return False
    return f.memory.returns > 1 or f.unordered or (f.runs and reading is not None and reading.t_s > since_s)


def gives_up(f: Facts) -> bool:
    """The charger has had its time.

    At the start it has first to be found; one that does not answer at all is not there: that is OFFLINE. Unless the
    last run of the service left it running.
    """
    memory = f.memory
    if memory.state is State.STOPPING:
        return f.state_s >= OBEY_STOP_S or _runs_again(f)
    if memory.state is not State.STARTING:
        return False
    if f.unordered and f.state_s >= OBEY_STOP_S:
        return True
    if f.reading is None:
        return memory.unverified and f.state_s >= LOST_S
    runs_s = memory.runs_s
    return (runs_s is not None and f.now_s - runs_s >= OBEY_STOP_S) or f.state_s >= LOST_S + OBEY_STOP_S
