"""One bay in the running service: the devices' newest views in, one decision out, carried out and recorded."""

import traceback
from collections.abc import Callable
from dataclasses import replace
from math import inf
from time import monotonic, time

from orchestrator.config.station import BayConfig
from orchestrator.core.decide import decide
from orchestrator.core.failed import carry_on
from orchestrator.core.memory import Memory
from orchestrator.core.persisted import Persisted
from orchestrator.core.states import ENERGISED, QUIET, SETTLED
from orchestrator.interlock import grant
from orchestrator.model import STOP, Alarm, Cause, Decision, Request, Snapshot, State
from orchestrator.model.bay_document import BayEntry
from orchestrator.service.asked import Answers, Asked, Requests, Taken
from orchestrator.service.bayjournal import BayJournal
from orchestrator.service.bayrecord import BayRecord
from orchestrator.service.contactor import Contactor
from orchestrator.service.devices import BatteryDevice, ChargerDevice
from orchestrator.service.identified import Identified
from orchestrator.service.journal import Journal
from orchestrator.service.news import TICK_S, due_s
from orchestrator.service.outlook import outlook
from orchestrator.service.past import Place
from orchestrator.service.policy_in_force import PolicyInForce, name_of
from orchestrator.service.records import transition
from orchestrator.service.start_timer import StartTimer
from orchestrator.service.starts import Starts
from orchestrator.service.status import bay_status, contactor_fields, told
from orchestrator.service.store import Store
from orchestrator.service.supply import Feed
from orchestrator.service.wallclock import WallClock


class BayRunner:
    """Runs `decide()` for one bay. Used by the control loop's thread only, except `ask` and `status`."""

    def __init__(
        self,
        bay: BayConfig,
        charger: ChargerDevice,
        battery: BatteryDevice,
        journal: Journal,
        store: Store,
        say: Callable[[Cause], None],
        *,
        contactor: Contactor | None = None,
        starts: Starts | None = None,
        feed: Feed | None = None,
        record: BayRecord | None = None,
        snapshots: bool = True,
        language: str = "en",
    ) -> None:
        self.name, self.place = bay.name, Place.of(bay)
        self.last_s, self.due_s = 0.0, -inf  #: when the last decision was made, and when the next is due at the latest
        self.decision: Decision | None = None
        self.policy, self._language = PolicyInForce(bay), language
        self._store, self._say, self._charger, self._battery = store, say, charger, battery
        self._timer = StartTimer(self.place, store, journal, say, language)
        # A start that could not be persisted is withdrawn: the bay is held, as after a stop.
        self._answers = Answers(store, lambda: self.ask(Asked(Request.STOP)), self._timer.withdraw)
        self.identified = Identified(bay, store, journal, say, language)
        self._memory: Memory | None = None  # None before the first decision: the persisted state is still being read
        self._revision = 0  # the revision that persists this bay's memory
        self._ending: Cause | None = None
        self._waits: Cause | None = None  # why the next run must wait for an operator
        self._asleep_s, self._closely = 0.0, True  # the BMU is read closely until the first decision
        self._journal = BayJournal(bay, journal, language, snapshots=snapshots)
        self._contactor, self._record, self._feed = contactor, record, feed or Feed()
        self._starts, self._snapshot = starts or Starts(0.0, ""), Snapshot()  # no other bay to wait for
        self._requests, self._taken, self._internal = Requests(), Taken(), ""

    @property
    def verified(self) -> bool:
        """Whether the charger is in verified standby, and nothing is commanded."""
        decision = self.decision
        return decision is not None and decision.state in SETTLED and decision.command is None

    @property
    def alarm(self) -> Alarm:
        """How urgently people must look at it. Before the first decision its charger may be out of control."""
        return self.decision.alarm if self.decision is not None else Alarm.DANGER

    @property
    def owes(self) -> bool:
        """Whether somebody is waiting for an answer."""
        return bool(self._requests or self._answers.waiting or self.identified.asked)

    def has_news(self) -> bool:
        """Whether the next decision cannot wait for the tick. Any thread may ask."""
        if self.decision is None or self.owes or self._internal:
            return True
        return self.policy.news.matters(self.decision, self._snapshot, self._charger.view, self._battery.view)

    def is_due(self, now_s: float) -> bool:
        """Whether a decision is due. One for a value that would get too old is put off when a newer one has come."""
        if now_s >= self.due_s and self.decision is not None and self._memory is not None and not self._internal:
            self.due_s = due_s(self.last_s, self.decision, self._memory, self._charger.view[0], self._battery.view[0])
        return now_s >= self.due_s

    def answer(self) -> None:
        """Give all pending answers, at the end of the service."""
        self._answers.look(inf)

    def end(self, why: Cause, *, orderly: bool = True) -> None:
        """Stop because the service ends: this is not an operator's stop, so the next run may resume.

        Unless it is not `orderly` and ends a charge: then the bay waits for an operator, as after any failure (G3).
        """
        self._ending = why
        if not orderly and self.decision is not None and self.decision.state in ENERGISED:
            self._waits = Cause.of("ended_in_charge", why=why)

    def isolate(self) -> None:
        """Open the contactor for good, at the end of the service, and record that and the last decisions."""
        self._journal.rest()
        if self._record is not None:
            self._record.rest()
        if self._contactor is not None:
            self._contactor.give_back()
            self._journal.contactor(self._contactor)

    def ask(self, asked: Asked) -> None:
        """Submit an operator's request; the next decision handles it."""
        self._requests.put(asked)

    def run(self, now_s: float, asleep_s: float = 0.0) -> None:
        """Make one decision. An exception in our own code stops the bay and is passed to the next decision.

        `asleep_s` is how long the machine has been suspended since it was switched on.
        """
        before, clock = self._revision, WallClock(now_s, time())
        due = self._timer.due(clock)  # in any case: the first time reads what was kept
        asked = self._requests.take() or (due if self.decision is not None else ())
        taken = self._taken = self._timer.take(Taken.of(asked, self._memory, self.name), self.decision, clock)
        try:
            self._step(now_s, asleep_s, taken.request)
        except Exception as error:  # noqa: BLE001 - whatever it is: the charger must stop
            self._charger.command(STOP)
            self._failed(error, now_s, taken.request)
            self._drive(now_s, closed=self.decision is not None and self.decision.closed)
        answer = clock.told(taken.refusal or (self.decision.answer if self.decision else None))
        for one in asked:
            self._answers.give(one, answer, self._revision, now_s, changed=self._revision != before)
        self._answers.look(now_s)

    def _failed(self, error: Exception, now_s: float, request: Request | None) -> None:
        """Continue with a memory that knows since when the bay has been stopping; if even that fails, without one."""
        where = traceback.extract_tb(error.__traceback__)[-1]
        internal = f"{error!r} in {where.name}, line {where.lineno}"
        if internal != self._internal:
            self._say(Cause.of("bay_internal", bay=self.name, error=internal))
        self._internal, self.last_s, self.due_s = internal, now_s, now_s + TICK_S
        try:
            snapshot, memory = replace(self._snapshot, request=request, asked_by=self._taken.by), self._memory
            memory = memory or self._store.past(self.place).memory(now_s)
            self.decision, self._memory = carry_on(now_s, snapshot, memory, internal, self.name)
            self._keep(self._memory, now_s)
        except Exception:  # noqa: BLE001 - the stop is out; report the minimum
            self.decision = Decision(State.STOPPING, Cause.of("failed", error=internal), STOP, alarm=Alarm.DANGER)

    def _step(self, now_s: float, asleep_s: float, request: Request | None) -> None:
        if self.verified and self.decision is not None and self.decision.state is not State.QUALIFYING:
            self._take_over()
        snapshot, before = self._look(now_s, asleep_s, request), self.decision
        self._snapshot = snapshot
        memory = self._memory or self._store.past(self.place).memory(now_s)
        decision, self._memory = decide(now_s, snapshot, memory, self.policy.rules)
        self._charger.command(decision.command, grant(snapshot, now_s) if decision.command else None)
        self._feed.decided(now_s, snapshot, self._memory, decision, self.policy.rules)
        self._drive(now_s, closed=decision.closed)
        self._starts.follow(self.name, now_s, self._memory, snapshot)
        # In a quiet state no current flows and none is about to: what a BMU reports changes slowly.
        closely = decision.state not in QUIET
        self.decision, self._internal, self.last_s = decision, "", now_s
        self.due_s = due_s(now_s, decision, self._memory, snapshot.charger, snapshot.battery)
        if self._closely is not closely:
            self._closely = closely
            self._battery.attend(closely=closely)
        clock = WallClock(now_s, time())
        self._journal.decided(clock, before, decision, snapshot, memory)
        if before is None or before.state is not decision.state:
            self._say(transition(self.name, before, decision, clock))
        self.identified.follow(now_s, snapshot, self._memory)
        self._timer.decided(self._taken, decision.answer, clock)
        self._keep(self._memory, now_s)
        if self._record is not None:
            self._record.take(clock, snapshot, decision, self.policy.rules, self.identified.identity, self._memory)

    def _look(self, now_s: float, asleep_s: float, request: Request | None) -> Snapshot:
        """Everything known about the bay now."""
        reading, charger_link = self._charger.view
        values, battery_link = self._battery.view
        late_s = now_s - self.due_s if self.decision else 0.0
        slept_s = asleep_s - self._asleep_s if self.decision else 0.0
        self._asleep_s = asleep_s
        snapshot = Snapshot(
            reading, charger_link, values, battery_link, request, self._internal,
            late_s=late_s if late_s > TICK_S else 0.0,  # less is normal on such a machine
            slept_s=slept_s if slept_s > TICK_S else 0.0,
            not_persisted=self._store.not_persisted(now_s),
            ending=self._ending,
            waits=self._starts.waits(self.name, now_s),
            moves=self._starts.moves(self.name),
            running_persisted=(on_disk := self._store.on_disk(self.place)) is not None and on_disk.running,
            asked_by=self._taken.by,
            target_pct=self._taken.target_pct,
        )  # fmt: skip
        if (fitted := self._contactor) is not None:
            snapshot = replace(snapshot, connected=fitted.connects(reading), contactor_problem=fitted.problem)
        return self._feed.into(snapshot)

    def _drive(self, now_s: float, *, closed: bool) -> None:
        """Drive the contactor, if any, as decided: after the command, so that a stop goes first."""
        if self._contactor is not None:
            self._contactor.drive(now_s, closed=closed)
            self._journal.contactor(self._contactor)

    def _take_over(self) -> None:
        if (bay := self.policy.take_over()) is not None:
            self._journal.begin(bay)
            self._say(Cause.of("policy_in_force", bay=self.name, policy=name_of(bay)))

    def _keep(self, memory: Memory, now_s: float) -> None:
        persisted = self._timer.kept(self.identified.kept(Persisted.of(memory, now_s)))
        if self._waits and not persisted.hold:
            persisted = replace(persisted, hold=self._waits)
        self._revision = self._store.put(self.place, persisted)
        self.identified.answer(self._revision)

    def status(self, *, closely: bool = False) -> BayEntry:
        """The bay's part of the status document; `closely`: with what costs too much for every bay of every answer."""
        known, clock = (self._snapshot, self._memory, self.policy.rules), WallClock(monotonic(), time())
        decision = told(self.decision or Decision(State.STARTING, Memory().cause, alarm=Alarm.DANGER), *known)
        decision = self._timer.told(decision)
        return {
            **bay_status(self.name, self._snapshot, decision, clock.now_s, clock.wall_s, self._language),
            **outlook(decision, *known, clock, self._language, closely=closely),
            **self._timer.next(decision, clock),
            **self._feed.status(clock, self._language),
            "identity": self.identified.status(),
            "timed_start": self._timer.status(clock),
            "contactor": contactor_fields(self._contactor, self._language) if self._contactor is not None else None,
            "port": self.place.port,
            "bmu": {"can": self.place.can, "node_id": self.place.node_id},
            "policy": self.policy.status(),
        }
