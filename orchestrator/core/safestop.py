"""The safe stop: when a charger must be told to stop, what proves that it did, and when it is out of control.

Theory of operation. The safe state is *verified* standby, by both witnesses (`witnesses/standby.py`). Until then the
standing command is STOP, repeated by the port every 500 ms. A charger not verified after `OBEY_STOP_S` is
uncontrollable: the command stays, the contactor opens, people are alarmed, and only a standby that lasts for `LASTS_S`
ends it. In states of rest there is no standing command as long as fresh replies show standby; as soon as one does not,
or the BMU keeps seeing current, it is STOP again.

A charger that runs again within `LASTS_S` was never verified, whatever it reported: its time counts from the first
stop.

Standby does not show whether both frames of a stop were received, and a charger that missed the second one may run on
its old values as soon as it is resumed. So a bay that qualifies for a charge stops its charger once more.
"""

from orchestrator.core.facts import Facts
from orchestrator.core.memory import Stop
from orchestrator.core.parts import changed
from orchestrator.core.states import ENERGISED, UNVERIFIED
from orchestrator.model import Cause, State

#: A stop that is not verified within this is not obeyed.
OBEY_STOP_S = 3.0
#: A charger that has not answered for this long after the start is absent.
LOST_S = 3.0
#: A standby counts as lasting after this long (FAULTS C30).
LASTS_S = 10.0


def must_stop(f: Facts, state: State) -> bool:
    """Whether the standing command is STOP in `state`, given what both witnesses show."""
    if state in UNVERIFIED:
        return True
    if state in (State.OFFLINE, State.QUALIFYING):
        return not f.stopped
    return not f.standby or f.unordered


def update(f: Facts, after: State, cause: Cause) -> Stop:
    """How the charger was stopped, and whether that is proved, when the state is about to change to `after`."""
    before, stop = f.memory.state, f.memory.stop
    if before in UNVERIFIED and after not in UNVERIFIED:
        if f.stopped:
            stop = changed(stop, verified_s=f.now_s, unverified=False)
        if stop.stopping_s is None and "found_running" in f.raised:  # that was a first stop, too
            stop = changed(stop, stopping_s=f.memory.since_s)
    elif before not in UNVERIFIED and after in UNVERIFIED:
        lasted_s = f.now_s - stop.verified_s if stop.verified_s is not None else LASTS_S
        runs_again = (f.runs or f.unordered) and lasted_s < LASTS_S and stop.stopping_s is not None
        returns, stopping_s = (stop.returns + 1, stop.stopping_s) if runs_again else (0, f.now_s)
        stop = changed(stop, returns=returns, stopping_s=stopping_s)
    elif after is State.UNCONTROLLABLE and stop.stopping_s is None:  # the start was its first stop
        stop = changed(stop, stopping_s=f.memory.since_s)
    if after in ENERGISED:
        return changed(stop, unverified=True, stopping_s=None, verified_s=None)
    return changed(stop, stop_cause=cause) if after is State.STOPPING else stop


def failed(stop: Stop, now_s: float, cause: Cause | None) -> Stop:
    """Our own code has failed, so nothing about the charger is proved. `cause`: why a stop begins now, if so."""
    if cause is None:
        return changed(stop, unverified=True)
    return changed(stop, unverified=True, stopping_s=now_s, stop_cause=cause)


def proved_to_last(f: Facts) -> bool:
    """The charger, which did not obey before, has been in standby for long enough to be believed."""
    proof = f.memory.witnessed.proof
    return f.stopped and f.charger.online and f.now_s - proof[0] >= LASTS_S


def verified(f: Facts) -> bool:
    """The stop in progress is complete."""
    return proved_to_last(f) if f.memory.state is State.UNCONTROLLABLE else f.stopped


def stands_by(f: Facts) -> bool:
    """The charger does not run and nothing is left to verify, in any state, as far as known now."""
    return verified(f) if f.memory.state in UNVERIFIED else not must_stop(f, f.memory.state)


def _runs_again(f: Facts) -> bool:
    """Whether it runs again after an earlier stop in vain.

    A single reply may be a stray measurement; a second one, or a second return, is not.
    """
    since_s, stopping_s, reading = f.memory.since_s, f.memory.stop.stopping_s, f.reading
    if since_s is None or stopping_s is None or f.now_s - stopping_s < OBEY_STOP_S:
        return False
    return f.memory.stop.returns > 1 or f.unordered or (f.runs and reading is not None and reading.t_s > since_s)


def gives_up(f: Facts) -> bool:
    """The charger has had its time.

    After the start it must first be found. One that does not answer at all is absent: that is OFFLINE, unless the
    previous run of the service left it running.
    """
    memory = f.memory
    if memory.state is State.STOPPING:
        return f.state_s >= OBEY_STOP_S or _runs_again(f)
    if memory.state is not State.STARTING:
        return False
    if f.unordered and f.state_s >= OBEY_STOP_S:
        return True
    if f.reading is None:
        return memory.stop.unverified and f.state_s >= LOST_S
    runs_s = memory.charger.runs_s
    return (runs_s is not None and f.now_s - runs_s >= OBEY_STOP_S) or f.state_s >= LOST_S + OBEY_STOP_S
