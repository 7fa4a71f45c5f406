"""The message for a charger that was not seen to stop: first what to do, then the report of each witness."""

from orchestrator.core.facts import Facts
from orchestrator.core.safestop import LASTS_S
from orchestrator.core.witnesses.standby import sees_current
from orchestrator.model import Cause


def out_of_control(f: Facts) -> Cause:
    """First what to do, then why."""
    memory, port = f.memory, f.rules.bay.charger.port
    if f.stopped:
        lasts_s = f.now_s - memory.witnessed.proof[0]
        return Cause.of("uncontrollable_stands_by", port=port, lasts_s=lasts_s, limit_s=LASTS_S)
    if f.charger.online and f.reading is not None and not f.runs and sees_current(f):
        # a BMU with an offset, or a frozen one, looks the same as a charger that lies
        charger_a, pack_a = f.reading.current_a, f.pack_a
        return Cause.of("uncontrollable_contradicted", port=port, charger_a=charger_a, pack_a=pack_a)
    since_s = memory.stop.stopping_s if memory.stop.stopping_s is not None else f.now_s - f.state_s
    id_ = "uncontrollable" if _heard(f) and f.runs else "uncontrollable_unproved"
    return Cause.of(id_, port=port, since_s=f.now_s - since_s, why=_witnesses(f))


def _heard(f: Facts) -> bool:
    """Whether the charger's report is current.

    Only then can it be said not to obey: one that is not heard may have stopped.
    """
    return f.charger.online and not f.charger.problem and f.reading is not None


def _witnesses(f: Facts) -> Cause:
    """The report of each witness, with its age if it is old."""
    bmu = Cause.of("bmu_sees", pack_a=f.pack_a) if f.pack_a is not None else Cause("bmu_not_heard")
    if not _heard(f) or f.reading is None:
        heard, last = f.snapshot.charger, None
        if heard is not None:
            last = Cause.of("last_heard", charger_a=heard.current_a, age_s=f.now_s - heard.t_s)
        return Cause.of("witnesses", charger=problem(f, "no_answer_on"), last=last, bmu=bmu)
    if f.runs:
        return Cause.of("witnesses", charger=Cause.of("delivers", charger_a=f.reading.current_a), last=None, bmu=bmu)
    return Cause.of("witnesses", charger=Cause("no_lasting_standby"), last=None, bmu=bmu)


def problem(f: Facts, silent: str) -> Cause:
    """Why the charger cannot be heard; `silent` is the id if it simply does not answer."""
    if f.charger.problem:
        return f.charger.problem
    return Cause.of(silent, port=f.rules.bay.charger.port)
