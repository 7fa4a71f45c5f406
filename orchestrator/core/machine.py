"""The state machine: every state, every trigger and every transition, in one table.

Theory of operation. `decide()` looks at the facts and picks at most one trigger; this table says where it leads. A pair
that is not in the table is refused with `RefusedError`, and the state stays as it is. The table shows three rules:

- Current flows in three states only, which are left only by `stop` or from one to the next.
- What follows a stop is chosen after the stop was verified, so no fault names a state.
- TRIPPED is left by a person's `reset`, or by `stop` if the charger runs again. A reset leads to HELD: it permits a
start but does not make one.

The `transitions` library is prescribed. It is the engine that walks the table, with a throw-away model per call: the
machine itself holds no state.
"""

from enum import StrEnum
from functools import cache

from transitions import Machine, MachineError

from orchestrator.core.states import ENERGISED, RESTING, SETTLED, STARTABLE, UNVERIFIED, ordered
from orchestrator.errors import RefusedError
from orchestrator.model import State


class Trigger(StrEnum):
    """Everything that can make a bay change its state."""

    STOP = "stop"  #: for whatever reason: no current, and verify that
    GIVE_UP = "give_up"  #: the charger did not obey a stop in time
    LOSE = "lose"  #: a device does not answer
    REST = "rest"  #: verified standby, nothing to do
    HOLD = "hold"  #: verified standby, a person must start
    SUSPEND = "suspend"  #: verified standby, continues by itself later
    FILL = "fill"  #: verified standby, the battery is full
    TRIP = "trip"  #: verified standby, a latched fault
    RESET = "reset"  #: a person has reset every latched fault
    QUALIFY = "qualify"  #: a battery is there and wants a charge
    PULSE = "pulse"  #: begin pulse precharge
    CONTINUE = "continue"  #: begin continuous precharge
    CHARGE = "charge"  #: begin to charge


S, T = State, Trigger
#: Standby was verified, or is verified now, so the next state can be chosen.
FROM_REST = (*ordered(RESTING), *ordered(UNVERIFIED))

#: (trigger, the states that accept it, the state it leads to; None: the state stays).
TABLE: tuple[tuple[Trigger, tuple[State, ...], State | None], ...] = (
    (T.STOP, ordered(UNVERIFIED), None),  # already stopping
    (T.STOP, (*ordered(SETTLED), *ordered(ENERGISED)), S.STOPPING),
    (T.GIVE_UP, (S.STARTING, S.STOPPING), S.UNCONTROLLABLE),
    (T.LOSE, FROM_REST, S.OFFLINE),
    (T.REST, FROM_REST, S.IDLE),
    (T.HOLD, FROM_REST, S.HELD),
    (T.SUSPEND, FROM_REST, S.SUSPENDED),
    (T.FILL, FROM_REST, S.FULL),
    (T.TRIP, (S.OFFLINE, *ordered(UNVERIFIED)), S.TRIPPED),  # only after a stop that was just verified
    (T.RESET, (S.TRIPPED,), S.HELD),
    (T.QUALIFY, ordered(STARTABLE), S.QUALIFYING),
    (T.PULSE, (S.QUALIFYING,), S.PRECHARGE_PULSE),
    (T.CONTINUE, (S.PRECHARGE_PULSE,), S.PRECHARGE_CONTINUOUS),
    (T.CHARGE, (S.QUALIFYING, S.PRECHARGE_CONTINUOUS), S.CHARGING),
)


class _Bay:
    """The model that `transitions` moves, made for one call."""

    __slots__ = ("state",)

    def __init__(self, state: State) -> None:
        self.state = state


MACHINE = Machine(
    model=None,
    states=State,
    initial=State.STARTING,
    transitions=[
        {"trigger": trigger.value, "source": source, "dest": dest}
        for trigger, sources, dest in TABLE
        for source in sources
    ],
    auto_transitions=False,
    queued=False,
)


@cache  # the result is as fixed as the table
def fire(state: State, trigger: Trigger) -> State:
    """The state that `trigger` leads to from `state`.

    Raises RefusedError if the table has no such pair.
    """
    bay = _Bay(state)
    try:
        MACHINE.events[trigger.value].trigger(bay)
    except MachineError:
        raise RefusedError(f"{trigger.value} is not possible in {state.value}") from None
    return bay.state
