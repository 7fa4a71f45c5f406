"""Turns decisions into the journal's lines. Pure; the journal writes them."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, fields
from functools import partial

from orchestrator.config.station import BayConfig
from orchestrator.core.memory import Memory, side_by_side
from orchestrator.core.states import QUIET
from orchestrator.model import (
    ActiveFault,
    Cause,
    Command,
    CurrentStep,
    Decision,
    Session,
    Snapshot,
    State,
)
from orchestrator.model.cause import plain
from orchestrator.model.document import Order, SessionFields
from orchestrator.service.rows import Row, as_columns, bare
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import say

Fields = Mapping[str, object]
Line = tuple[str, Fields | Callable[[], Fields]]  #: kind, fields or what makes them when the line is written
EventLine = tuple[str, dict[str, object]]
TimedLine = tuple[float, Line]  #: the monotonic time of what it records

#: The parts of a record that are texts for people, beside the cause.
TEXTS = frozenset({"reason", "text", "rule", "result"})
#: The longest interval between complete snapshots with memory and rules: a reader can begin at each of them.
WHOLE_S = 600.0
#: Decisions share a line for this long at most, …
GATHER_S = 5.0
#: … and so many of them.
MAX_ROWS = 250


def decision_lines(
    before: Decision | None, now: Decision, language: str = "en", clock: WallClock | None = None
) -> Iterator[EventLine]:
    """What has changed from one decision to the next, for programs and, in `language`, for people.

    A line has its own time, on both clocks: only sentences need the time of day (`clock`).
    """

    def why() -> dict[str, object]:
        return {"reason": say(_at(clock, now.cause), language), "cause": plain(now.cause)}

    if before is None or now.state is not before.state:
        yield "transition", {"from": before.state if before else None, "to": now.state, **why()}
    if before is None or now.command != before.command:
        yield "command", {**command_fields(now.command)}
    yield from _fault_lines(before, now, language)
    yield from _session_lines(before, now, language, clock)
    if before is None or _gist(now) != _gist(before):
        yield "decision", {"state": now.state, **why(), "step": _step_fields(now.step, language)}


def _at(clock: WallClock | None, cause: Cause | None) -> Cause | None:
    return cause if clock is None else clock.told(cause)


def command_fields(command: Command | None) -> Order:
    """A command as shown in journal and status."""
    return {"action": command.action, "value": command.value} if command else {"action": None}


def without_texts(said: Mapping[str, object]) -> dict[str, object]:
    """A record without its texts, which depend on language and version."""
    kept = {name: value for name, value in said.items() if name not in TEXTS}
    return {name: without_texts(value) if name == "step" and value else value for name, value in kept.items()}  # type: ignore[arg-type]


def _step_fields(step: CurrentStep | None, language: str) -> dict[str, object] | None:
    if step is None:
        return None
    rule = {"rule": say(step.rule, language), "cause": plain(step.rule)}
    return {"index": step.index, "current_a": step.current_a, **rule}


def _gist(decision: Decision) -> tuple[object, ...]:
    """A decision without the figures of its cause, which change constantly."""
    return decision.state, decision.step, decision.setpoint, decision.alarm


def _fault_fields(fault: ActiveFault, event: str, cause: Cause, language: str) -> dict[str, object]:
    said = {"text": say(cause, language), "cause": plain(cause)}
    return {"id": fault.id, "event": event, "effect": fault.effect.name, **said}


def transition(bay: str, before: Decision | None, now: Decision, clock: WallClock) -> Cause:
    """A change of state as the service's log says it."""
    state, reason = now.state.value, clock.told(now.cause)
    if before is None:
        return Cause.of("bay_begins", bay=bay, state=state, reason=reason)
    return Cause.of("bay_goes", bay=bay, before=before.state.value, state=state, reason=reason)


def _fault_lines(before: Decision | None, now: Decision, language: str) -> Iterator[EventLine]:
    old = {fault.id: fault for fault in before.faults} if before else {}
    new = {fault.id: fault for fault in now.faults}
    for name, fault in new.items():
        if name not in old or old[name].effect is not fault.effect:
            yield "fault", _fault_fields(fault, "raised", fault.cause, language)
    for name, fault in old.items():
        if name not in new:  # what it was; what was seen of it last, nobody may have written down
            was = (fault.raised or fault.cause).with_(past=True)
            yield "fault", _fault_fields(fault, "cleared", was, language)


def _session_lines(
    before: Decision | None, now: Decision, language: str, clock: WallClock | None
) -> Iterator[EventLine]:
    was = before.session if before and before.session and not before.session.result else None
    if now.session is None:
        return
    if was is None and not now.session.result:
        yield "session", {"event": "begin", **session_fields(now.session, language, clock)}
    elif now.session.result:
        yield "session", {"event": "end", **session_fields(now.session, language, clock)}


def session_fields(session: Session, language: str = "en", clock: WallClock | None = None) -> SessionFields:
    """A session as rounded figures, for people."""
    return {
        "elapsed_s": round(session.elapsed_s, 1),
        "energised_s": round(session.energised_s, 1),
        "charged_ah": round(session.charged_ah, 4),
        "charged_wh": round(session.charged_wh, 2),
        "soc_start_pct": session.soc_start_pct,
        "soc_pct": session.soc_pct,
        "step_changes": session.step_changes,
        "result": say(_at(clock, session.result), language),
        "cause": plain(session.result) if session.result else None,
    }


class SnapshotRecorder:
    """Turns the decisions of one bay into `snapshot` lines: some complete, the others with the changes since the last.

    In a quiet state nothing is written until something happens; then a complete line starts over. The lines have the
    whole input of every decision: repeating it gives the same result. What is expensive is left to whoever writes them.
    """

    def __init__(self, bay: BayConfig) -> None:
        self._rows: list[Row] = []  # the decisions since the last line
        self._base = Snapshot()  # the snapshot before them
        self.begin(bay)

    def begin(self, bay: BayConfig) -> None:
        """Start over with a complete line, with the policy now in force."""
        self._bay = bay
        self._whole_s: float | None = None  # when the last complete line was written; None: one is due

    def lines(self, now_s: float, snapshot: Snapshot, memory: Memory, state: State, *, news: bool) -> list[TimedLine]:
        """The lines due after a decision made at `now_s` with `snapshot` and `memory`.

        `state` is the resulting state, `news` is whether there were any `decision_lines`: what led to them is written
        with them.
        """
        if state in QUIET and not news and snapshot.request is None:
            self._whole_s = None
            return self.rest()
        if self._whole_s is None or now_s - self._whole_s >= WHOLE_S:
            lines = self.rest()
            lines.append((now_s, ("snapshot", partial(_whole, snapshot, memory, self._bay))))
            self._base, self._whole_s = snapshot, now_s
            return lines
        self._rows.append((now_s, snapshot))
        due = news or now_s - self._rows[0][0] >= GATHER_S or len(self._rows) >= MAX_ROWS
        return self.rest() if due else []

    def rest(self) -> list[TimedLine]:
        """The line for the decisions since the last one, if there were any."""
        if not self._rows:
            return []
        rows, base = self._rows, self._base
        self._rows, self._base = [], rows[-1][1]
        return [(rows[0][0], ("snapshot", partial(as_columns, base, rows)))]


def _whole(snapshot: Snapshot, memory: Memory, bay: BayConfig) -> dict[str, object]:
    config = json.loads(json.dumps(asdict(bay), default=str))
    said = {one.name: bare(getattr(snapshot, one.name)) for one in fields(snapshot)}
    return {"whole": True, **said, "memory": bare(side_by_side(memory)), "config": config}
