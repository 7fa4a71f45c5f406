"""How urgently people must look at a bay: what may be out of control, and what waits for them."""

from orchestrator.core.faults import ROW, Clear
from orchestrator.core.memory import Memory
from orchestrator.core.operator import is_own
from orchestrator.core.states import UNSEEN
from orchestrator.model import ActiveFault, Alarm, State

Faults = tuple[ActiveFault, ...]


def alarm(memory: Memory, faults: Faults) -> Alarm:
    """The level after a decision. A person who stopped or reset a bay knows that it waits: that is no alarm."""
    if _may_run(memory, faults):
        return Alarm.DANGER
    return Alarm.ATTENTION if _waits(memory, faults) else Alarm.NONE


def _may_run(memory: Memory, faults: Faults) -> bool:
    """A charger does not obey, or it is unknown whether one that ran has stopped, or who else commands it."""
    unknown = memory.stop.unverified and memory.state in UNSEEN
    locked = any(fault.id == "port_locked" for fault in faults)
    return memory.state is State.UNCONTROLLABLE or unknown or locked


def _waits(memory: Memory, faults: Faults) -> bool:
    """It is in standby until a person has dealt with a fault, or with anything else that no operator asked for."""
    if memory.state is not State.HELD:
        return memory.state is State.TRIPPED
    by_fault = any(ROW[fault.id].clear is Clear.OPERATOR for fault in faults)
    return by_fault or (memory.operator.hold is not None and not is_own(memory.operator.hold))
