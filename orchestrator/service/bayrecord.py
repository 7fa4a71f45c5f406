"""One bay's charges, kept for the record: folds the bay's decisions, and has the recorder write what is due."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import localtime

from orchestrator import __version__
from orchestrator.config.amperes import end_v
from orchestrator.config.station import BayConfig
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import Decision, Request, Session, Snapshot
from orchestrator.model.identity import Identity, Source
from orchestrator.record import charge as charges
from orchestrator.record import lines
from orchestrator.record.charge import Charge
from orchestrator.record.curve import Curve
from orchestrator.record.look import Foreseen, Look
from orchestrator.record.stamp import Stamp
from orchestrator.service.forecast import foresee
from orchestrator.service.past import Place
from orchestrator.service.recorder import Recorder
from orchestrator.service.wallclock import WallClock

#: Decisions that wait until the earlier records are read; the core's counters bridge a gap.
MOST_EARLY = 2000


class BayRecord:
    """Used by the control loop's thread only."""

    def __init__(self, recorder: Recorder, station: str, bay: BayConfig) -> None:
        self._recorder, self._station = recorder, station
        self._place = Place.of(bay)
        self._charge: Charge | None = None
        self._curve = Curve()
        self._over: Charge | None = None  # ended in the record, and still open in the core
        self._pending: list[Charge] | None = None  # left open by earlier runs; None: not known yet
        self._by: Mapping[str, object] | None = None  # who has asked for the next charge, if anybody
        self._early: deque[tuple[Look, BayConfig, Identity]] = deque(maxlen=MOST_EARLY)

    def take(
        self, clock: WallClock, snapshot: Snapshot, decision: Decision, rules: Rules, identity: Identity, memory: Memory
    ) -> None:
        """One more decision and what it remembers, under this policy, of this battery.

        Nothing that fails here may reach the charger.
        """
        try:
            look = self._look(clock, snapshot, decision, partial(foresee, snapshot, memory, rules))
            self._early.append((look, rules.bay, identity))
            while self._early and self._recorder.loaded:
                self._take(*self._early.popleft())
        except Exception as error:  # noqa: BLE001 - whatever it is, the bay goes on
            self._recorder.failed(error)

    def rest(self) -> None:
        """The service ends: record what has been counted until now."""
        if self._charge is not None:
            self._recorder.put_curve(self._charge.id, self._curve.rest(), ended=True)
            self._put(self._charge, self._charge.last)

    def _look(
        self, clock: WallClock, snapshot: Snapshot, decision: Decision, foresee: Callable[[], Foreseen | None]
    ) -> Look:
        offset_min = localtime(clock.wall_s).tm_gmtoff // 60
        stamp = Stamp(clock.wall_s, offset_min, clock.now_s, self._recorder.boot)
        return Look(stamp, snapshot, decision, clock.told, foresee)

    def _take(self, look: Look, bay: BayConfig, identity: Identity) -> None:
        session, asked = look.session, look.snapshot
        if asked.request is Request.START and asked.asked_by is not None and look.decision.answer is None:
            self._started(look.plainly(asked.asked_by), once=asked.target_pct is not None)
        if self._pending is None:
            self._pending = self._recorder.opened(self._place.bay, self._place.port)
            self._over = self._recorder.last(self._place.bay)
        if self._pending and not self._go_on(self._pending, look, session, bay):
            return
        charge = self._charge
        if charge is not None and session is not None and session.started_s == charge.started_s:
            self._keep(charges.follow(_under(_of(charge, identity), look, bay), look), look)
            return
        if charge is not None:
            self._put(charges.unseen(charge), charge.last)
        if session is not None:
            self._begin(look, session, bay, identity)

    def _started(self, by: Mapping[str, object], *, once: bool) -> None:
        """Somebody has started it; one who gives a charge that goes on a target of its own is named there, too."""
        if self._charge is None:
            self._by = by
        elif once:
            self._charge = replace(self._charge, head={**self._charge.head, "by": by})

    def _go_on(self, pending: Sequence[Charge], look: Look, session: Session | None, bay: BayConfig) -> bool:
        """Go on with the charge left open that the core goes on with; the others have ended unseen. False: not yet."""
        if session is None and look.snapshot.not_persisted is not None:
            return False  # the core may have had no disk to remember it from: the next start will
        same = [one for one in pending if session is not None and charges.is_same(one, session, look.stamp)][-1:]
        for one in pending:
            if one not in same:
                self._put(charges.lost(one), one.last)
        self._pending = []
        if same and session is not None:
            self._keep(charges.resumed(_under(same[0], look, bay), look, session), look)
            return False
        return True

    def _begin(self, look: Look, session: Session, bay: BayConfig, identity: Identity) -> None:
        over, counted = self._over, None
        if over is not None and charges.is_same(over, session, look.stamp):
            self._over = over if session.result is None else None
            if not look.runs:
                return  # its end did not reach the core's memory: it is ended once more
            counted = over.amounts.counted.at_most(session)
        self._over, self._curve = None, Curve()
        head, self._by = self._head(bay, identity), None
        id_ = self._recorder.new_id(look.stamp.unix_s)
        charge = charges.begun(id_, head, look, session, counted)
        self._recorder.put(lines.begin(charge))
        self._keep(replace(charge, number=1, due=False), look)

    def _keep(self, charge: Charge, look: Look) -> None:
        """The charge as it is now, recorded if that is due."""
        self._charge, ended = charge, charge.result is not None
        self._curve.take(look, look.stamp.since(charge.begin), charge.amounts.ah)
        if ended or charge.due or self._curve.is_due(look.now_s):
            self._recorder.put_curve(charge.id, self._curve.rest(), ended=ended)
        if charge.result is not None or charges.is_due(charge, look.stamp):
            self._put(charge, look.stamp)

    def _put(self, charge: Charge, now: Stamp) -> None:
        ended = charge.result is not None
        self._recorder.put(lines.end(charge) if ended else lines.checkpoint(charge))
        self._charge = None if ended else charges.wrote(charge, now)

    def _head(self, bay: BayConfig, identity: Identity) -> Mapping[str, object]:
        """What does not change of a charge that begins now."""
        policy = bay.policy
        return {
            "station": self._station,
            "bay": self._place.bay,
            "port": self._place.port,
            "battery": _fields(identity),
            "policy": {
                "name": policy.policy,
                "sha256": policy.source.digest,
                "capacity_ah": policy.pack.capacity_ah,
                "end_v": end_v(policy.pack),
            },
            "software": __version__,
            "by": self._by,
            "contactor_fitted": bay.contactor is not None,
        }  # fmt: skip


def _of(charge: Charge, identity: Identity) -> Charge:
    """The charge, of this battery: who tells or types which one it is may do so after the begin."""
    if identity.source is Source.ASSUMED or charge.head["battery"] == _fields(identity):
        return charge  # a battery that has just left is not known any more, and its charge ends with that
    return replace(charge, head={**charge.head, "battery": _fields(identity)})


def _under(charge: Charge, look: Look, bay: BayConfig) -> Charge:
    """The charge, under this policy: another one may have been read in a pause, or by the next run."""
    policy = bay.policy
    return charges.under(charge, policy.policy, policy.source.digest, __version__, look.stamp)


def _fields(identity: Identity) -> Mapping[str, object]:
    node = f"0x{identity.node_id:02X}"
    return {"id": identity.id, "source": identity.source.value, "can": identity.can, "node": node}
