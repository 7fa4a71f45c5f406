"""What tells two memories apart for whoever explores: what decides where a bay can go from there, and nothing else.

Times, values and texts are left out. So is what decides nothing in the state that the bay is in, or behind something
that decides before it: a pause behind a hold (one start ends both), a hold behind a latched fault (its reset makes one
anew), which of the faults it is that keep a bay at rest until they clear by themselves. `tests/proof/test_gist.py`
takes memories as they come, changes what is left out, and looks that each input leads to the same.
"""

from collections.abc import Callable, Mapping
from operator import attrgetter

from orchestrator.core.faults import ROW, Clear
from orchestrator.core.latches import release
from orchestrator.core.memory import Memory, telling
from orchestrator.core.states import ENERGISED, RESTING, UNPROVED, UNVERIFIED
from orchestrator.core.witnesses.standby import UNORDERED_S
from orchestrator.model import Command, Effect, State

Gist = tuple[object, ...]


def outline(memory: Memory) -> Gist:
    """The coarsest cut: where a bay is, and what keeps it from charging, or bounds its charge."""
    faults = [(name, fault) for name, fault in memory.faults.items() if fault.raised_s is not None]
    if any(fault.latched for _, fault in faults):
        return memory.state, "reset"
    if memory.state is State.CHARGING:  # what ends a charge is no part of one, but what bounds it or warns is
        return memory.state, max((ROW[name].effect for name, _ in faults), default=None)
    if memory.state in ENERGISED:  # a precharge is on the lowest step anyhow
        return (memory.state,)
    waits = any(ROW[name].clear is Clear.OPERATOR for name, _ in faults)
    asked = "start" if memory.operator.hold else (memory.operator.paused, waits)
    if memory.state in UNPROVED:
        return memory.state, asked
    bars = any(ROW[name].effect >= Effect.NO_START and ROW[name].clear is not Clear.OPERATOR for name, _ in faults)
    return memory.state, asked, bars


def gist(memory: Memory) -> Gist:
    """Equal for two memories from which a bay can come to the same, as far as it is explored here."""
    state = memory.state
    told = [_told(value) for value in TELLS[state](memory)]
    return *outline(memory), memory.session is not None, *told, *[derived(memory) for derived in DERIVED.get(state, ())]


def _told(value: object) -> object:
    """What of a value decides: which command it is, what is true or not; of all others that they are there."""
    if isinstance(value, Command):
        return value.action
    return value if isinstance(value, bool) else value is not None


def details(memory: Memory) -> Gist:
    """The gist, and every fault that is there or lately was: from equal ones the same takes nearly the same time."""
    faults = frozenset(
        (name, fault.present, fault.raised_s is not None, fault.latched, len(fault.strikes))
        for name, fault in memory.faults.items()
    )
    return *gist(memory), faults


def _unordered(memory: Memory) -> bool:
    """The current that nobody ordered has been there for long enough to count."""
    return memory.witnessed.unordered_s >= UNORDERED_S


def _proof_began(memory: Memory) -> bool:
    """By a reply to a stop of this very state; what followed one before it proves nothing any more."""
    proof, stop_s, since_s = memory.witnessed.proof, memory.witnessed.stop_s, memory.since_s
    return bool(proof) and stop_s is not None and since_s is not None and stop_s >= since_s


def _may_be_reset(memory: Memory) -> bool:
    """A reset would be granted now."""
    _, reasons = release(memory.faults, memory.last_s or 0.0, by_reset=True)
    return not reasons


def _resumed(memory: Memory) -> bool:
    """The last stage needs it no more, once it runs."""
    return memory.sequence.resumed or (memory.stage.ran and memory.state is State.CHARGING)


#: The fields that tell, by state (`core/memory.py`) …
TELLS = {state: attrgetter("state", *telling(state)) for state in State}
#: … and what is worked out of several. In a stop under way, whether it ran is known from the state itself.
DERIVED: Mapping[State, tuple[Callable[[Memory], bool], ...]] = {
    **dict.fromkeys(RESTING, (_unordered,)),
    State.OFFLINE: (_unordered, _proof_began),
    State.QUALIFYING: (_unordered, _proof_began),
    **dict.fromkeys(ENERGISED, (_resumed,)),
    **dict.fromkeys(UNVERIFIED, (_proof_began,)),
    State.TRIPPED: (_may_be_reset,),
}
