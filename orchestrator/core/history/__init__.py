"""State carried between decisions, each part of the memory by its own module."""

from orchestrator.core import rows, safestop, sequence
from orchestrator.core.facts import Facts
from orchestrator.core.history import battery, charger, session, stage
from orchestrator.core.memory import Memory
from orchestrator.core.parts import changed
from orchestrator.core.states import ENERGISED
from orchestrator.core.witnesses import followed
from orchestrator.model import Cause, State


def update_history(f: Facts, passed_s: float) -> Facts:
    """The facts with an updated memory; `passed_s` is the time since the previous decision."""
    before = f.memory
    after = f.with_memory(
        changed(
            before,
            charger=charger.update(f, passed_s),
            stage=stage.update(f),
            witnessed=followed.update(f, passed_s),
            tables=rows.update(f),
            battery=battery.update(f),
        )
    )
    open_charge = session.update(after, passed_s, before.charger.counted_t_s)
    if open_charge is None:
        return after
    return after.with_memory(changed(after.memory, session=open_charge))


def entered(f: Facts, state: State, cause: Cause) -> Memory:
    """The memory when `state` has just been entered, for this cause: everything that counts from there."""
    memory, before = f.memory, f.memory.state
    begins, flowed = state in ENERGISED, before in ENERGISED
    told = charger.told_anew(memory.charger)
    begun = changed(
        memory,
        state=state,
        since_s=f.now_s,
        stage=stage.EMPTY,
        stop=safestop.update(f, state, cause),
        charger=told,
        sequence=memory.sequence if begins else sequence.ends(memory.sequence),
        session=session.begins(f, state, before) if begins else memory.session,
    )
    if flowed or not begins:
        return begun
    return changed(
        begun,
        charger=charger.begins(f, told),
        sequence=sequence.begins(memory.sequence, f.now_s),
        battery=battery.begins(memory.battery),
    )
