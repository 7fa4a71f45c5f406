"""The exhaustive grid: every state × every row of the fault table × the current activity of the line.

A bay is brought into the state, on the whole service in virtual time. Then, while the line is idle, has a request in
flight, or has half of a reply, the row's condition becomes true for as long as the row needs. A row with a stopping
effect must end in verified standby, its stop written as soon as the line is free; any other must leave the bay in a
state from which the operator's stop leads to verified standby.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import inf
from typing import Any
from unittest.mock import patch

from orchestrator.config.load import load_policy
from orchestrator.core import latches, safestop
from orchestrator.core.faults import FAULTS, FaultRow
from orchestrator.core.states import QUIET, SETTLED
from orchestrator.model import STOP, Action, Alarm, Cause, ControlMode, Effect, Request, State
from orchestrator.protocol.charger import STATUS_REPLY_BYTES, STOP_FRAME
from orchestrator.service.news import CALM_TICK_S
from orchestrator.sim.faults import FAULTS as INJECTIONS
from orchestrator.sim.pack import Pack
from orchestrator.sim.presets import PACKS
from tests.core.said import reason_of
from tests.proof.play import POLICIES
from tests.proof.virtual_rig import ANSWER_S, Nature
from tests.proof.virtual_service import World, station, world


class Phase(StrEnum):
    """The line's activity when the fault occurs."""

    IDLE = "idle line"
    IN_FLIGHT = "request in flight"
    HALF = "reply half received"


#: From the decision to stop to its first byte: at most the rest of a transaction, the reply's deadline.
STOP_WITHIN_S = {Phase.IDLE: 0.01, Phase.IN_FLIGHT: 0.125, Phase.HALF: 0.125}
#: A frame's time on the wire, and the gap after it.
FRAME_S = 0.01
#: A status request, and half a reply to it.
POLL, HALF_REPLY = 0x01, 14
#: A stop is verified within this; the operator's gets the same time. A charger that disobeyed is believed later.
SETTLE_S = 3.5
BELIEVED_S = safestop.LASTS_S + SETTLE_S
REACH_S = 30.0


@dataclass(frozen=True, slots=True)
class Situation:
    """How a bay gets into a state: its pack, and events in given states on the way."""

    soc_pct: float | None = 50.0  #: None: the toy pack, deeply discharged
    acts: tuple[tuple[State, str], ...] = ()
    speed: float = 1.0

    @property
    def is_toy(self) -> bool:
        return self.soc_pct is None or self.speed > 1

    def nature(self, line: str = "bytewise") -> Nature:
        pack = PACKS["demo"]()
        if self.soc_pct is not None:
            pack = Pack()
            pack.set_soc(self.soc_pct)
        if self.speed > 1:
            pack = replace(PACKS["demo"]())
            pack.set_soc(self.soc_pct or 0.0)
        return Nature(pack, line=line, speed=self.speed)


#: Not an action: continue when the charger runs.
RUNS = "until it runs"

S = State
SITUATIONS: dict[State, Situation] = {
    S.STARTING: Situation(),
    S.OFFLINE: Situation(acts=((S.STARTING, "bmu_silent"),)),
    S.IDLE: Situation(soc_pct=99.0),
    S.HELD: Situation(acts=((S.QUALIFYING, "stop"),)),
    S.QUALIFYING: Situation(),
    S.PRECHARGE_PULSE: Situation(soc_pct=None),
    S.PRECHARGE_CONTINUOUS: Situation(soc_pct=None, acts=((S.PRECHARGE_PULSE, "fast forward"),)),
    S.CHARGING: Situation(),
    S.FULL: Situation(soc_pct=93.0, speed=6),
    S.SUSPENDED: Situation(acts=((S.QUALIFYING, "pause"),)),
    S.STOPPING: Situation(acts=((S.CHARGING, RUNS), (S.CHARGING, "stop"))),
    S.TRIPPED: Situation(acts=((S.QUALIFYING, "status_bits"),)),
    S.UNCONTROLLABLE: Situation(acts=((S.CHARGING, RUNS), (S.CHARGING, "ignore_stop"), (S.CHARGING, "stop"))),
}


#: These may be over before a row has lasted long enough.
PASSING = frozenset({S.STARTING, S.STOPPING, S.QUALIFYING})
#: By whether the row applies in the state.
NOT_RAISED = {True: "state left before it lasted", False: "not looked for there"}
#: The toy pack is full before a row lasts longer than this.
TOY_S = 20.0


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell of the grid."""

    state: State
    row: FaultRow
    phase: Phase

    def __str__(self) -> str:
        return f"{self.state} × {self.row.id} × {self.phase}"


@dataclass(slots=True)
class Used:
    """Table rows used, over many cells."""

    rows: set[str] = field(default_factory=set)
    changes: set[tuple[State, State]] = field(default_factory=set)


@dataclass(slots=True)
class Ended:
    """The result of a cell."""

    word: str = ""
    stop_s: float | None = None  #: from the decision to stop to its first byte, if none was commanded before
    wrong: list[str] = field(default_factory=list)


class Run:
    """One run of a cell."""

    def __init__(self, cell: Cell, on: World, used: Used) -> None:
        self.cell, self.world, self.time, self.used = cell, on, on.time, used
        self.rig = on.rigs[0]
        self.ended = Ended()
        self.wrong = self.ended.wrong
        self.forced = ""
        self._acts = list(SITUATIONS[cell.state].acts)
        self._armed = self._injected = False
        self._ordered = False  # the previous decision stopped the charger
        self._standing = False  # a stop was commanded before the fault was raised
        self._raised_s: float | None = None
        self._stopped_s: float | None = None
        self._heard = 0
        self._free_s = inf  # from when on the line is idle
        self._before = S.STARTING
        on.on_step = self._stepped
        self.rig.wire.on_bytes = self._asked
        self.rig.tty.on_delivered = self._answered

    def run(self) -> Ended:
        self.time.call_later(REACH_S, self._too_late)
        status = self.world.run()
        if status:
            self.wrong.append(f"the service ended with {self.world.console.said[-1]!r}")
        if self.rig.bay.charger.running:
            self.wrong.append("the charger runs at the end")
        self.wrong += [line for line in self.world.console.said if "internal error" in line]
        if self.world.guardian.unwell:
            self.wrong.append("a thread of the service ended or hung")
        return self.ended

    def rows(self) -> tuple[FaultRow, ...]:
        """The fault table, with the cell's row under control."""
        row, check = self.cell.row, self.cell.row.check

        def forced(f: Any) -> Cause | None:
            return Cause.of("said", text=self.forced) if self.forced else check(f)

        return tuple(replace(row, check=forced) if other.id == row.id else other for other in FAULTS)

    # --- on the way to the state --------------------------------------------------------------------------------------

    def _stepped(self, runner: Any) -> None:
        decision = runner.decision
        self.used.rows |= {fault.id for fault in decision.faults}
        if decision.state is not self._before:
            self.used.changes.add((self._before, decision.state))
            self._before = decision.state
        while self._acts and self._acts[0][0] is decision.state:
            if self._acts[0][1] == RUNS and not self.rig.bay.charger.running:
                break
            self._act(self._acts.pop(0)[1])
        if decision.state is self.cell.state and not self._acts and not self._armed:
            self._armed = True
            if self.cell.phase is Phase.IDLE:
                self._when_idle()
        if self._raised_s is None and self._injected and any(x.id == self.cell.row.id for x in decision.faults):
            self._raised_s = self.time.now_s
            self._standing = self._standing or self._ordered
        self._ordered = decision.command == STOP

    def _act(self, name: str) -> None:
        if name in set(Request):
            self.world.ask(Request(name))
        elif name == "fast forward":
            self.rig._speed = 5.0
        elif name != RUNS:
            same = (name, self.cell.row.id) == ("status_bits", "status_trip")  # otherwise it would be active already
            other = "error_stop" if same else name
            self.rig.inject(lambda rig: INJECTIONS[other].happen(rig, None))

    # --- the moment ---------------------------------------------------------------------------------------------------

    def _when_idle(self) -> None:
        """Nothing is being sent or awaited."""
        schedule = self.world.supervisor._ports[0]._schedule
        if self._free_s < self.time.now_s < schedule.next().at_s - 0.001:
            self._inject()
        else:
            self.time.call_later(0.003, self._when_idle)

    def _asked(self, now_s: float, data: bytes) -> None:
        if STOP_FRAME in data and self._raised_s is not None and self._stopped_s is None:
            self._stopped_s = now_s
        self._free_s = now_s + FRAME_S
        if len(data) > 4 and data[4] == POLL:
            self._heard, self._free_s = 0, inf
            if self._armed and self.cell.phase is Phase.IN_FLIGHT:
                self.time.call_later(0.002, self._inject)

    def _answered(self, count: int) -> None:
        self._heard += count
        if self._heard >= STATUS_REPLY_BYTES:
            self._free_s = self.time.now_s + FRAME_S
        if self._armed and self.cell.phase is Phase.HALF and self._heard >= HALF_REPLY:
            self._inject()

    def _inject(self) -> None:
        if self._injected:
            return
        self._injected = True
        decision = self.world.decision()
        if decision.state is not self.cell.state:
            self.wrong.append(f"the fault came in {decision.state}")
        self._standing = decision.command == STOP
        self.forced = "seen by the grid"
        self.world.supervisor._wake.put(0)
        calm = decision.state in QUIET or decision.state is State.CHARGING
        looks_s = CALM_TICK_S if calm else 0.0  # a bay in which nothing happens looks so rarely
        lasts_s = self.cell.row.for_s + 0.3 + 0.5 * self.cell.row.polls + 2 * looks_s
        self.time.call_later(lasts_s, self._gone)
        self.time.call_later(lasts_s + SETTLE_S, self._judge)

    def _gone(self) -> None:
        self.forced = ""

    # --- its result --------------------------------------------------------------------------------------------

    def _judge(self) -> None:
        cell, decision = self.cell, self.world.decision()
        raised = self._raised_s is not None
        at_once = cell.row.for_s == 0 and cell.row.polls == 1
        passes = cell.state in PASSING or (SITUATIONS[cell.state].is_toy and cell.row.for_s > TOY_S)
        if cell.state in cell.row.where and not raised and (at_once or not passes):
            self.wrong.append(f"{cell.row.id} was not raised")
        self.ended.word = "said, and went on" if raised else NOT_RAISED[cell.state in cell.row.where]
        if raised and cell.row.effect >= Effect.PAUSE:
            uncontrolled = (
                decision.state is State.UNCONTROLLABLE
                and decision.alarm is Alarm.DANGER
                and self.rig.bay.charger.ignores_stop
            )
            self.ended.word = "out of control, and said so" if uncontrolled else "stopped, verified"
            if not (uncontrolled or (decision.state in SETTLED and not self.rig.bay.charger.running)):
                self.wrong.append(f"{decision.state}: {reason_of(decision)}")
        if raised and cell.row.effect >= Effect.STOP:
            self._judge_stop()
        self.rig.inject(lambda rig: INJECTIONS["heal"].happen(rig, None))
        self.rig.bmu.port.faults.delay_s = ANSWER_S
        self.world.ask(Request.STOP)
        unbelieved = decision.state is State.UNCONTROLLABLE
        self.time.call_later(BELIEVED_S if unbelieved else SETTLE_S, self.world.end)

    def _judge_stop(self) -> None:
        if self._standing:
            return  # commanded before, repeated every 500 ms, and the end is verified
        if self._stopped_s is None or self._raised_s is None:
            self.wrong.append("no stop was written")
            return
        at_once = self.cell.row.for_s == 0 and self.cell.row.polls == 1  # otherwise it is raised once it has lasted
        took_s = self.ended.stop_s = self._stopped_s - self._raised_s
        allowed_s = STOP_WITHIN_S[self.cell.phase if at_once else Phase.IN_FLIGHT]
        if took_s > allowed_s:
            self.wrong.append(
                f"the stop was written {took_s * 1000:.0f} ms after the step, allowed are {allowed_s * 1000:.0f}"
            )

    def _too_late(self) -> None:
        if not self._injected:
            self.wrong.append(f"{self.cell.state} or its moment was not reached, but {self.world.decision().state}")
            self.world.end()


def cells(phases: Callable[[int], tuple[Phase, ...]]) -> Iterator[Cell]:
    """The whole grid, or the phases `phases(number)` of each pair of state and row."""
    number = 0
    for state in State:
        for row in FAULTS:
            yield from (Cell(state, row, phase) for phase in phases(number))
            number += 1


def play(cell: Cell, used: Used) -> Ended:
    """From the start to the operator's stop."""
    situation = SITUATIONS[cell.state]
    the_station = station([ControlMode.MANUAL], [POLICIES["demo" if situation.is_toy else "48v"]], sweep_s=0.5)
    line = "bytewise" if cell.phase is Phase.HALF else "real"  # where nobody looks, a reply need not come in pieces
    with world(the_station, [situation.nature(line)], end_s=120.0 + cell.row.for_s) as made:
        run = Run(cell, made, used)
        with patch.object(latches, "FAULTS", run.rows()):
            return run.run()


def commands(limit_a: float, soc_pct: float | None) -> set[tuple[Action, int]]:
    """The commands that leave the interlock in a charge with this station limit.

    Without a SOC: a whole charge, from the first pulse to full.
    """
    policy = load_policy("li-ion-48v") if soc_pct is not None else POLICIES["demo"]
    let_out: set[tuple[Action, int]] = set()
    with world(
        station([ControlMode.MANUAL], [policy], limit_a, sweep_s=0.3),
        [Situation(soc_pct=soc_pct).nature()],
        end_s=120.0,
    ) as made:
        made.rigs[0].bay.charger.current_step = 4  # as the previous controller left it
        port = made.supervisor._ports[0]
        write = port._write

        def written(line: Any, frame: bytes, command: Any, *args: Any, **named: Any) -> None:
            let_out.add((command.action, command.value))
            write(line, frame, command, *args, **named)

        port._write = written  # type: ignore[method-assign]  # whoever watches sees every order
        made.time.call_later(9.0 if soc_pct is not None else 75.0, made.end)
        assert made.run() == 0
    return let_out
