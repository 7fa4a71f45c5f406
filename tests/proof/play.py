"""Plays a script on the virtual service and checks the true state against the invariants; the result is a `Played`.

The invariants: no charger runs under a STOP-worthy condition for longer than its budget, unless the bay reports it out
of control; every decision keeps the properties of `orchestrator.workbench`; every start was qualified; no thread dies,
hangs or raises; and at the end, with all faults removed, every charger is in verified standby.
"""

import traceback
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial

from orchestrator.config.load import load_policy
from orchestrator.config.shipped import shipped_dir
from orchestrator.core.memory import Memory
from orchestrator.core.states import ENERGISED, SETTLED
from orchestrator.model import Alarm, ChargeMode, ControlMode, Decision, Request, Snapshot, State
from orchestrator.protocol.charger import STOP_FRAME
from orchestrator.service.asked import Asked
from orchestrator.sim.can_noise import Bus
from orchestrator.sim.can_wire import PERFECT
from orchestrator.sim.faults import FAULTS
from orchestrator.sim.presets import PACKS
from orchestrator.workbench.prove.properties import PROPERTIES
from orchestrator.workbench.prove.story import Move, Taken
from tests.proof.script import ARRIVES, MENDS, Happening, Script
from tests.proof.truth import CONDITIONS, MARGIN_S, VERIFY_S, Bay, Heard, named
from tests.proof.virtual_rig import ANSWER_S, Nature
from tests.proof.virtual_service import FIRST_NODE, World, station, world

POLICIES = {"48v": load_policy("li-ion-48v"), "demo": load_policy(shipped_dir() / "configs/demo/policy.yaml")}
#: Interval of the checks.
LOOK_S = 0.05
#: Number of heartbeats within the guardian's time-out.
UNWELL = 4
#: An operator's request is answered within this: by the next decision, or one more for each earlier request.
ANSWERED_S = 0.6
#: A port that returns is found within this, and its first frame is a stop.
REOPENED_S = 1.3
#: A bay must be in QUALIFYING for this long before its charger starts.
QUALIFY_S = 2.0


@dataclass(slots=True)
class Injected:
    """One fault injected while the charger ran, and its outcome."""

    name: str
    t_s: float
    stop_s: float | None = None  #: from then to the first byte of a stop
    fault: str = ""  #: the id of the first fault raised
    verified: bool = False  #: the bay came to verified standby afterwards
    named: bool = False  #: it said that the charger is out of control
    lasted_s: float | None = None  #: until it was removed, an operator's request, or the end
    alone: bool = True  #: no other fault was active before it


@dataclass(slots=True)
class Played:
    """The result of a script."""

    script: Script
    violations: list[str] = field(default_factory=list)
    injected: list[Injected] = field(default_factory=list)
    status: int = 0  #: the service's exit status
    changes: set[tuple[State, State]] = field(default_factory=set)  #: of the bays' states
    rows: set[str] = field(default_factory=set)  #: of the fault table, that were raised


@dataclass(slots=True)
class Watch:
    """The data tracked for one bay."""

    heard: Heard = field(default_factory=Heard)
    since_s: dict[str, float] = field(default_factory=dict)  #: condition → since when it holds while the charger runs
    before: Memory | None = None
    qualified_s: float | None = None  #: when QUALIFYING was last left for a charge
    qualifying_s: float | None = None
    open: list[Injected] = field(default_factory=list)
    named_s: float = 0.0  #: when the bay last said that its charger is out of control
    reachable_s: float | None = None  #: since when the port accepts writes
    faulty: bool = False  #: a fault was injected and not healed since


class Player:
    """One script on one world."""

    def __init__(self, script: Script, on: World, look_s: float = LOOK_S) -> None:
        self.script, self.world, self.time = script, on, on.time
        self._look_s = look_s
        self.played = Played(script)
        self.began_s = self.time.now_s
        self.out_of_reach: Callable[[], bool] = lambda: False  #: writes do not reach the line
        self.watches = [Watch() for _ in on.rigs]
        for number, rig in enumerate(on.rigs):
            rig.wire.on_bytes = partial(self._bytes, number)
            rig.wire.on_started = partial(self._started, number)
        on.bus.on_frame = self._frame
        on.on_step = self._stepped

    def run(self) -> Played:
        for one in self.script.happenings:
            self.time.call_at(self.began_s + one.t_s, self._happen, one)
        if self.script.heal_s is not None:
            for bay in range(len(self.watches)):
                self.time.call_at(self.began_s + self.script.heal_s, self._happen, Happening(0, bay, "heal"))
        self.time.call_at(self.began_s + self.script.end_s, self._end)
        self.time.call_later(self._look_s, self._look)
        try:
            self.played.status = self.world.run()
        except BaseException as error:  # noqa: BLE001 - a broken world is the worst finding
            where = traceback.extract_tb(error.__traceback__)[-1]
            self._wrong(0, "exception", f"{error!r} in {where.name}, {where.filename}:{where.lineno}")
        self._judge_end()
        return self.played

    # --- what happens -------------------------------------------------------------------------------------------------

    def _happen(self, one: Happening) -> None:
        rig, watch = self.world.rigs[one.bay], self.watches[one.bay]
        if one.name in (*MENDS, *Request):
            self._close(watch)  # later events may be due to this
        if one.name in set(Request):
            asked = self.world.ask(Request(one.name), one.bay)
            self.time.call_later(ANSWERED_S, self._answered, one, asked)
            return
        runs = rig.bay.charger.running
        name = "heal" if one.name in MENDS else one.name
        {"port_stalled": self._stall, "bus_down": self._bus_down, "bus_lost": self._bus_lost}.get(
            name, lambda _: rig.inject(lambda rig: FAULTS[name].happen(rig, one.value))
        )(one)
        if one.name == ARRIVES:
            rig.bay.pack.set_soc(one.value or 0.0)
            rig.bmu.reboot()
        if one.name in MENDS:
            rig.bmu.port.faults.delay_s = ANSWER_S
            rig.tty.stalled = self.world.bus.down = self.world.bus.lost = False
        elif runs:
            rig.wire.counters.mark()
            watch.open.append(Injected(one.name, self.time.now_s, alone=not watch.faulty))
            self.played.injected.append(watch.open[-1])
        watch.faulty = one.name not in MENDS

    def _end(self) -> None:
        for watch in self.watches:
            self._close(watch)
        self.world.end()

    def _close(self, watch: Watch) -> None:
        for injected in watch.open:
            injected.lasted_s = self.time.now_s - injected.t_s
        watch.open.clear()

    def _stall(self, one: Happening) -> None:
        self.world.rigs[one.bay].tty.stalled = True

    def _bus_down(self, _: Happening) -> None:
        self.world.bus.go_down()
        self.time.call_later(3.0, self._bus_up)

    def _bus_up(self) -> None:
        self.world.bus.down = False

    def _bus_lost(self, _: Happening) -> None:
        self.world.bus.lost = True

    def _answered(self, one: Happening, asked: Asked) -> None:
        accepted = asked.done.is_set() and not asked.answer
        heard = self.watches[one.bay].heard
        if not asked.done.is_set():
            self._wrong(one.bay, "operator", f"{one.name} was not answered within {ANSWERED_S:g} s")
        if accepted and one.name in (Request.STOP, Request.PAUSE):
            heard.stop_asked_s = self.time.now_s
        elif accepted and one.name == Request.START:
            heard.stop_asked_s = None

    # --- what is seen -------------------------------------------------------------------------------------------------

    def _bytes(self, number: int, now_s: float, data: bytes) -> None:
        if STOP_FRAME in data:
            watch = self.watches[number]
            watch.heard.stop_frame_s = now_s
            for injected in watch.open:
                injected.stop_s = now_s - injected.t_s if injected.stop_s is None else injected.stop_s

    def _frame(self, cob_id: int, data: bytes) -> None:
        number, kind = (cob_id & 0x7F) - FIRST_NODE, cob_id & 0x780
        if kind == 0x700 and data == b"\0":
            self.watches[number].heard.boot_s = self.time.now_s
        elif kind == 0x080 and data[1:2] != b"\0":
            self.watches[number].heard.emergency_s = self.time.now_s

    def _started(self, number: int, now_s: float) -> None:
        watch, heard = self.watches[number], self.watches[number].heard
        heard.started_s = now_s
        stop_s = heard.stop_frame_s
        if watch.qualified_s is None or (stop_s is not None and watch.qualified_s < stop_s):
            self._wrong(number, "resumed", "the charger was started, and the bay had not qualified since its last stop")

    def _stepped(self, runner: object) -> None:
        number = self.world.bays.index(runner)  # type: ignore[arg-type]  # a BayRunner
        bay, watch = self.world.bays[number], self.watches[number]
        decision, after, snapshot = bay.decision, bay._memory, bay._snapshot
        assert decision is not None
        assert after is not None
        before = watch.before or Memory()
        if after.state is not before.state:
            self._changed(number, before.state, after.state)
        taken = Taken(Move(0.0, "", ""), after.last_s or 0.0, snapshot, before, decision, after, bay.policy.rules)
        for rule in PROPERTIES:
            if (wrong := rule.check(taken)) is not None:
                self._wrong(number, rule.name, wrong)
        watch.before = after
        self._follow_injected(watch, decision, snapshot)

    def _changed(self, number: int, before: State, after: State) -> None:
        watch = self.watches[number]
        self.played.changes.add((before, after))
        if after is State.QUALIFYING:
            watch.qualifying_s = self.time.now_s
        elif before is State.QUALIFYING and after in ENERGISED:
            watch.qualified_s = self.time.now_s
            if watch.qualifying_s is None or self.time.now_s - watch.qualifying_s < QUALIFY_S:
                self._wrong(number, "resumed", "QUALIFYING took less than 2 s")

    def _follow_injected(self, watch: Watch, decision: Decision, snapshot: Snapshot) -> None:
        self.played.rows |= {fault.id for fault in decision.faults}
        for injected in watch.open:
            news = [fault.id for fault in decision.faults if fault.since_s >= injected.t_s]
            injected.fault = injected.fault or (news[0] if news else "")
            injected.named = injected.named or decision.alarm is Alarm.DANGER
            at_rest = decision.state in SETTLED and snapshot.charger is not None
            injected.verified = injected.verified or (at_rest and injected.stop_s is not None)

    # --- what must be -------------------------------------------------------------------------------------------------

    def _look(self) -> None:
        self.time.call_later(self._look_s, self._look)
        for number, rig in enumerate(self.world.rigs):
            rig.catch_up()
            runner = self.world.bays[number]
            if runner.decision is not None:
                self._judge(
                    number, Bay(rig, runner.policy.rules, runner.decision, self.time.now_s, self.watches[number].heard)
                )
        if self.world.guardian.unwell > UNWELL:
            self._wrong(0, "hangs", "a thread of the service has ended or hangs: the guardian would have acted")

    def _judge(self, number: int, bay: Bay) -> None:
        watch, now_s = self.watches[number], self.time.now_s
        reachable = bay.rig.tty.present and not bay.rig.tty.stalled and not self.out_of_reach()
        watch.reachable_s = (watch.reachable_s or now_s) if reachable else None
        if named(bay):
            watch.named_s = now_s
        for condition in CONDITIONS:
            if not (bay.runs and condition.holds(bay)):
                watch.since_s.pop(condition.name, None)
                continue
            since_s = watch.since_s.setdefault(condition.name, now_s)
            lasted_s, stop_s = now_s - since_s, watch.heard.stop_frame_s
            unnamed_s = now_s - max(since_s, watch.named_s)
            if lasted_s <= condition.within_s:
                continue
            reached_s = now_s - (watch.reachable_s if watch.reachable_s is not None else now_s)
            if reached_s > REOPENED_S and (stop_s is None or stop_s < since_s - VERIFY_S):
                self._wrong(number, condition.name, f"no stop was written for {lasted_s:.2f} s")
            if unnamed_s > condition.within_s + VERIFY_S + MARGIN_S:
                self._wrong(
                    number, condition.name, f"runs for {unnamed_s:.2f} s, and the bay is in {bay.decision.state}"
                )
        self._judge_limit(number, bay)

    def _judge_limit(self, number: int, bay: Bay) -> None:
        charger, limit_a = bay.rig.bay.charger, self.script.limit_a
        ordered = bay.rules.manual and charger.control_mode is ControlMode.MANUAL and bay.decision.state in ENERGISED
        ran_before = self.script.bays[number].running and self.watches[number].heard.started_s is None
        if ordered and charger.running and charger.mode is ChargeMode.CHARGE and not ran_before:
            step_a = charger.steps_a[charger.current_step]
            if step_a > limit_a:
                self._wrong(
                    number,
                    "limits",
                    f"the charger runs on a step of {step_a:g} A, the station's limit is {limit_a:g} A",
                )

    def _judge_end(self) -> None:
        for line in self.world.console.said:
            if "internal" in line:
                self._wrong(0, "exception", line)
        if self.script.heal_s is None:
            return
        if self.played.status:
            self._wrong(0, "end", f"all faults are gone, and the service ended with {self.world.console.said[-1]!r}")
        for number, rig in enumerate(self.world.rigs):
            rig.catch_up()
            if rig.bay.charger.running:
                self._wrong(number, "end", "the service has ended and the charger runs")

    def _wrong(self, number: int, name: str, text: str) -> None:
        t_s = self.time.now_s - self.began_s
        if not any(f" {name}: " in line for line in self.played.violations):
            self.played.violations.append(f"t = {t_s:.2f} s, bay {number}, {name}: {text}")


def play(script: Script) -> Played:
    """Play it to its end."""
    with stage(script) as made:
        return Player(script, made).run()


def stage(script: Script, bus: Bus = PERFECT) -> AbstractContextManager[World]:
    """The world of a script."""
    controls = [ControlMode.AUTOMATIC if bay.automatic else ControlMode.MANUAL for bay in script.bays]
    policies = [POLICIES[bay.pack] for bay in script.bays]
    the_station = station(controls, policies, script.limit_a, sweep_s=script.sweep_s, tpdo_s=script.tpdo_s)
    natures = []
    for bay, control in zip(script.bays, controls, strict=True):
        pack = PACKS[bay.pack]()
        if bay.soc_pct is not None:
            pack.set_soc(bay.soc_pct)
        pack.temperature_c = pack.ambient_c = bay.temperature_c
        natures.append(Nature(pack, control, bay.line, bay.seed, running=bay.running))
    return world(the_station, natures, end_s=script.end_s + 60.0, bus=bus)
