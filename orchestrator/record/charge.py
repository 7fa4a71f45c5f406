"""One charge on its way into the record: the fold over the decisions of its bay. Pure.

Theory of operation. `begun` makes a charge from the first decision that has an open one, `follow` makes the next from
each later decision, `resumed` goes on with one that an earlier run of the service left open. What an interruption costs
is a pause of the same charge, whatever interrupted it. The core has no ids: an open charge of the core is the one that
the record has open in that bay, unless it is seen to be another (`is_same`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from orchestrator.model import Cause, Session
from orchestrator.model.cause import plain
from orchestrator.record import amounts as amount
from orchestrator.record import forecast as foresight
from orchestrator.record import measured as measuring
from orchestrator.record import met as trouble
from orchestrator.record import pauses as pause
from orchestrator.record import spread
from orchestrator.record.amounts import Amounts, Counted
from orchestrator.record.forecast import Forecast
from orchestrator.record.look import Look
from orchestrator.record.measured import Measured
from orchestrator.record.met import Trouble
from orchestrator.record.pauses import Pauses
from orchestrator.record.spread import Spreads
from orchestrator.record.stamp import Stamp, as_fields

#: A running charge is recorded this often at least, a paused one every day: so it is never far back in the files.
CHECKPOINT_S, PAUSED_S = 600.0, 86_400.0
#: Two times of the same moment, by one monotonic clock, differ by less.
SAME_S = 2.0
#: How much older than the record the core's counters may be: they are written every 30 s, by a disk that may be slow.
OLDER_S = 300.0
#: … and how much older than the end of a charge that the core has not persisted: that is written at once.
ENDED_S = 60.0
#: More changes of the policy are not kept.
MOST_CHANGES = 50


@dataclass(frozen=True, slots=True)
class Charge:
    """One charge: what does not change of it, and what has been counted."""

    id: str
    head: Mapping[str, object]  #: station, bay, battery, policy …
    begin: Stamp
    last: Stamp  #: the last decision
    written: Stamp  #: the last record of it
    started_s: float  #: the core's begin of it, by the monotonic clock of `last`
    soc_start_pct: float | None  #: … and its SOC then
    number: int = 0  #: of its records so far
    amounts: Amounts = Amounts()
    spreads: Spreads = spread.NONE
    pauses: Pauses = Pauses()
    trouble: Trouble = Trouble()
    measured: Measured = Measured()
    forecast: Forecast = Forecast()
    changes: tuple[Mapping[str, object], ...] = ()  #: from when on another policy, or version, was in force
    closed: bool = False  #: whether the contactor was to be closed
    due: bool = False  #: something to be recorded at once
    result: Mapping[str, object] | None = None  #: why it ended; None while it has not


def begun(id_: str, head: Mapping[str, object], look: Look, session: Session, counted: Counted | None = None) -> Charge:
    """The charge that this decision shows first; `counted` is what of it an earlier charge has counted already."""
    begin = look.stamp.back(max(look.now_s - session.started_s, 0.0)) if counted is None else look.stamp
    amounts = Amounts() if counted is None else Amounts(counted)
    new = Charge(id_, head, begin, look.stamp, look.stamp, session.started_s, session.soc_start_pct, amounts=amounts)
    return follow(new, look)


def follow(charge: Charge, look: Look, *, resumed: bool = False) -> Charge:
    """The same after one more decision."""
    session, before = look.session, charge.pauses
    ends = session is not None and session.result is not None
    pauses = pause.ended(before, look.stamp) if ends else pause.follow(before, look)
    amounts = amount.follow(charge.amounts, look, resumed=resumed)
    point = measuring.seen(look, amounts.ah, amounts.bmu_ah)
    now = replace(
        charge,
        last=look.stamp,
        amounts=amounts,
        spreads=spread.follow(charge.spreads, look.values()),
        pauses=pauses,
        trouble=trouble.follow(charge.trouble, look),
        measured=measuring.follow(charge.measured, look.now_s, point, _end_v(charge)),
        forecast=foresight.follow(charge.forecast, look, look.stamp.since(charge.begin)),
        closed=look.decision.closed,
        due=charge.due or pauses.lasts is not before.lasts,
    )
    if session is None or session.result is None:
        return now
    return replace(now, result=look.plainly(session.result))


def under(charge: Charge, policy: str, sha256: str, software: str, now: Stamp) -> Charge:
    """The same, if need be with the note that from now on it goes on under this policy and this version."""
    first, last = charge.head["policy"], charge.changes[-1] if charge.changes else None
    known = last or {"sha256": first.get("sha256") if isinstance(first, Mapping) else "", **charge.head}
    if (known["sha256"], known["software"]) == (sha256, software) or len(charge.changes) >= MOST_CHANGES:
        return charge
    change = {**as_fields(now), "policy": policy, "sha256": sha256, "software": software}
    return replace(charge, changes=(*charge.changes, change), due=True)


def _end_v(charge: Charge) -> float | None:
    """The pack's end voltage, by the policy; None in a record of an earlier version."""
    policy = charge.head.get("policy")
    found = policy.get("end_v") if isinstance(policy, Mapping) else None
    return float(found) if isinstance(found, int | float) else None


def resumed(charge: Charge, look: Look, session: Session) -> Charge:
    """The charge of an earlier run of the service, after the first decision of this one.

    By the core's counters it has gone on after its last record: the pause began no earlier.
    """
    more_s = max(session.energised_s - charge.amounts.counted.energised_s, 0.0)
    seen = replace(charge, last=charge.last.back(-more_s))
    pauses = pause.died(charge.pauses, seen.last, _died(seen))
    then = replace(charge, pauses=pauses, started_s=session.started_s, written=look.stamp, due=True)
    return follow(then, look, resumed=True)


def is_same(charge: Charge, session: Session, now: Stamp) -> bool:
    """Whether the core's open charge is this one, which an earlier run of the service has recorded.

    Within one boot its begin tells. Across boots only clocks that may have stepped do; there the SOC at the begin and
    the counters show a charge that has begun since.
    """
    if now.boot and now.boot == charge.last.boot:
        return abs(session.started_s - charge.started_s) <= SAME_S
    older_s = charge.amounts.counted.energised_s - session.energised_s
    return session.soc_start_pct == charge.soc_start_pct and older_s <= (OLDER_S if charge.result is None else ENDED_S)


def lost(charge: Charge) -> Charge:
    """The same, ended because its service died and nothing went on."""
    return replace(charge, result=_died(charge))


def unseen(charge: Charge) -> Charge:
    """The same, ended although no decision said so."""
    return replace(charge, result=plain(Cause("end_unseen")))


def _died(charge: Charge) -> Mapping[str, object]:
    return plain(Cause.of("service_died", last_at=charge.last.local()))


def is_due(charge: Charge, now: Stamp) -> bool:
    """Whether it is time for a checkpoint."""
    return charge.due or now.mono_s - charge.written.mono_s >= (PAUSED_S if charge.pauses.lasts else CHECKPOINT_S)


def wrote(charge: Charge, now: Stamp) -> Charge:
    """The same after one more record."""
    return replace(charge, written=now, number=charge.number + 1, due=False)
