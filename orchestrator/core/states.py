"""What states have in common and why: one table, and a set of states for each of its kinds.

Theory of operation. Code that treats several states alike names a kind from this table instead of listing states. A new
state is one row here, and the row shows at a glance how every rule of the product treats it.
"""

from collections.abc import Mapping
from enum import Enum, auto

from orchestrator.model import State


class Kind(Enum):
    """What states can have in common."""

    ENERGISED = auto()  #: the charger is told to run: current flows under full supervision
    PRECHARGING = auto()  #: … gently, on the lowest step, to wake a deeply discharged pack
    AT_WORK = auto()  #: a charge has been started: energised, or about to be
    UNVERIFIED = auto()  #: a stop is under way and not yet proved
    OUT_OF_HAND = auto()  #: nobody has seen the charger stop yet, or it does not obey
    UNSEEN = auto()  #: the charger is heard for the first time, or again: nobody saw what it did before
    AT_REST = auto()  #: the charger was verified in standby and has not been told to run since
    RESTING = auto()  #: a bay goes from here to where the facts lead, without a stop first
    SETTLED = auto()  #: entered after a verified standby, or after a charger that was not heard: nothing is pending
    QUIET = auto()  #: every decision is the same until something happens
    STARTABLE = auto()  #: a battery that wants a charge is qualified from here
    READY = auto()  #: continues by itself, without waiting for a person
    OBEYS = auto()  #: the charger is known to obey: the contactor may be closed
    MAY_RUN = auto()  #: the charger may be delivering current: after a restart a person must look
    SESSION_ENDS = auto()  #: entering one ends the charge; a pause, a restart and a silent device do not end it
    ALIKE = auto()  #: at rest, waiting for a person or not: moving between them is no progress of a charge
    DONE = auto()  #: nothing interrupted is waiting here to continue
    BY_PERSON = auto()  #: only a person makes it go on
    PASSING = auto()  #: left again within seconds, in any surroundings


S, K = State, Kind

TABLE: Mapping[State, frozenset[Kind]] = {
    S.STARTING: frozenset({K.UNVERIFIED, K.OUT_OF_HAND, K.UNSEEN, K.PASSING}),
    S.OFFLINE: frozenset({K.UNSEEN, K.RESTING, K.SETTLED, K.QUIET}),
    S.IDLE: frozenset({
        K.AT_REST, K.RESTING, K.SETTLED, K.QUIET, K.STARTABLE, K.READY, K.OBEYS, K.SESSION_ENDS, K.ALIKE, K.DONE,
    }),
    S.HELD: frozenset({
        K.AT_REST, K.RESTING, K.SETTLED, K.QUIET, K.STARTABLE, K.OBEYS, K.SESSION_ENDS, K.ALIKE, K.DONE,
        K.BY_PERSON,
    }),
    S.QUALIFYING: frozenset({K.AT_WORK, K.AT_REST, K.RESTING, K.SETTLED, K.READY, K.OBEYS, K.PASSING}),
    S.PRECHARGE_PULSE: frozenset({K.ENERGISED, K.PRECHARGING, K.AT_WORK, K.READY, K.OBEYS, K.MAY_RUN}),
    S.PRECHARGE_CONTINUOUS: frozenset({K.ENERGISED, K.PRECHARGING, K.AT_WORK, K.READY, K.OBEYS, K.MAY_RUN}),
    S.CHARGING: frozenset({K.ENERGISED, K.AT_WORK, K.READY, K.OBEYS, K.MAY_RUN}),
    S.FULL: frozenset({
        K.AT_REST, K.RESTING, K.SETTLED, K.QUIET, K.STARTABLE, K.READY, K.OBEYS, K.SESSION_ENDS, K.DONE,
    }),
    S.SUSPENDED: frozenset({K.AT_REST, K.RESTING, K.SETTLED, K.QUIET, K.STARTABLE, K.READY, K.OBEYS}),
    S.STOPPING: frozenset({K.UNVERIFIED, K.MAY_RUN, K.PASSING}),
    S.TRIPPED: frozenset({K.AT_REST, K.SETTLED, K.QUIET, K.SESSION_ENDS, K.BY_PERSON}),
    S.UNCONTROLLABLE: frozenset({K.UNVERIFIED, K.OUT_OF_HAND, K.MAY_RUN, K.BY_PERSON}),
}  # fmt: skip


def _of(kind: Kind) -> frozenset[State]:
    return frozenset(state for state, kinds in TABLE.items() if kind in kinds)


def ordered(states: frozenset[State]) -> tuple[State, ...]:
    """In the order in which a bay usually goes through them."""
    return tuple(state for state in State if state in states)


ENERGISED, PRECHARGING, AT_WORK = _of(K.ENERGISED), _of(K.PRECHARGING), _of(K.AT_WORK)
UNVERIFIED, OUT_OF_HAND, UNSEEN = _of(K.UNVERIFIED), _of(K.OUT_OF_HAND), _of(K.UNSEEN)
AT_REST, RESTING, SETTLED, QUIET = _of(K.AT_REST), _of(K.RESTING), _of(K.SETTLED), _of(K.QUIET)
STARTABLE, READY, OBEYS, MAY_RUN = _of(K.STARTABLE), _of(K.READY), _of(K.OBEYS), _of(K.MAY_RUN)
SESSION_ENDS, ALIKE, DONE, PASSING = _of(K.SESSION_ENDS), _of(K.ALIKE), _of(K.DONE), _of(K.PASSING)
BY_PERSON = _of(K.BY_PERSON)
#: States that need standby first; everything else is considered only after that.
UNPROVED = UNVERIFIED | {State.OFFLINE}
