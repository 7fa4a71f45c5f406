"""What tells two memories apart for whoever explores: what decides where a bay can go from there, and nothing else.

Times, values and texts are left out. So is what decides nothing in the state that the bay is in, or behind something
that decides before it: a pause behind a hold (one start ends both), a hold behind a latched fault (its reset makes one
anew), which of the faults it is that keep a bay at rest until they clear by themselves. `tests/proof/test_gist.py`
takes memories as they come, changes what is left out, and looks that each input leads to the same.
"""

from collections.abc import Callable, Mapping

from orchestrator.core.faults import ROW, Clear
from orchestrator.core.latches import release
from orchestrator.core.memory import Memory
from orchestrator.core.states import ENERGISED, UNPROVED
from orchestrator.core.witnesses.standby import UNORDERED_S
from orchestrator.model import Effect, State

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
    more = TELLS.get(memory.state, _at_rest)
    return *outline(memory), memory.session is not None, memory.battery.full_pct is not None, *more(memory)


def details(memory: Memory) -> Gist:
    """The gist, and every fault that is there or lately was: from equal ones the same takes nearly the same time."""
    faults = frozenset(
        (name, fault.present, fault.raised_s is not None, fault.latched, len(fault.strikes))
        for name, fault in memory.faults.items()
    )
    return *gist(memory), faults


def _at_rest(memory: Memory) -> Gist:
    """The current that nobody ordered: whether it is there, and whether it has been for long enough to count."""
    witnessed = memory.witnessed
    return memory.stop.unverified, witnessed.sees, witnessed.unordered_s >= UNORDERED_S


def _offline(memory: Memory) -> Gist:
    return *_at_rest(memory), _proof_began(memory)


def _qualifying(memory: Memory) -> Gist:
    return *_offline(memory), memory.stage.qualified_s is not None, memory.stage.intends


def _starting(memory: Memory) -> Gist:
    return memory.stop.unverified, _proof_began(memory)


def _stopping(memory: Memory) -> Gist:
    """Whether it ran is known from the state itself, and forgotten with it."""
    return (_proof_began(memory),)


def _proof_began(memory: Memory) -> bool:
    """By a reply to a stop of this very state; what followed one before it proves nothing any more."""
    proof, stop_s, since_s = memory.witnessed.proof, memory.witnessed.stop_s, memory.since_s
    return bool(proof) and stop_s is not None and since_s is not None and stop_s >= since_s


def _tripped(memory: Memory) -> Gist:
    """Whether a reset would be granted now."""
    _, reasons = release(memory.faults, memory.last_s or 0.0, by_reset=True)
    return memory.stop.unverified, not reasons


def _energised(memory: Memory) -> Gist:
    ran, order = memory.stage.ran, memory.sequence.order
    resumed = memory.sequence.resumed or (ran and memory.state is State.CHARGING)  # the last stage needs it no more
    return resumed, ran, order and order.action, memory.witnessed.proved


#: What else decides, by state; elsewhere the bay is at rest.
TELLS: Mapping[State, Callable[[Memory], Gist]] = {
    State.STARTING: _starting,
    State.OFFLINE: _offline,
    State.QUALIFYING: _qualifying,
    **dict.fromkeys(ENERGISED, _energised),
    State.STOPPING: _stopping,
    State.UNCONTROLLABLE: _stopping,
    State.TRIPPED: _tripped,
}
