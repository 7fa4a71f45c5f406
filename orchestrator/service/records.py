"""Turns decisions into the journal's lines. Pure; the journal writes them."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields, is_dataclass

from orchestrator.config.station import BayConfig
from orchestrator.core.memory import Memory, side_by_side
from orchestrator.core.states import QUIET
from orchestrator.model import (
    ActiveFault,
    BatteryLink,
    BatteryReading,
    Cause,
    ChargerLink,
    ChargerReading,
    Command,
    CurrentStep,
    Decision,
    Measurement,
    Session,
    Snapshot,
    State,
)
from orchestrator.model.cause import plain
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import say

Line = tuple[str, dict[str, object]]  #: kind, fields

#: The parts of a record that are texts for people, beside the cause.
TEXTS = frozenset({"reason", "text", "rule", "result"})
#: The parts of a snapshot that concern this service and its contactor.
OURS = (
    "internal", "late_s", "slept_s", "not_persisted", "ending", "connected", "contactor_problem", "waits", "moves",
    "running_persisted",
)  # fmt: skip
#: What of a reading or a link may have causes in it; the rest is written as it is.
DEEP = frozenset({Cause, tuple, dict})
#: The longest interval, in lines, between complete snapshots with memory and rules: a reader can begin at each of them.
WHOLE_EVERY = 250


def decision_lines(
    before: Decision | None, now: Decision, language: str = "en", clock: WallClock | None = None
) -> Iterator[Line]:
    """What has changed from one decision to the next, for programs and, in `language`, for people.

    A line has its own time, on both clocks: only sentences need the time of day (`clock`).
    """

    def why() -> dict[str, object]:
        return {"reason": say(_at(clock, now.cause), language), "cause": plain(now.cause)}

    if before is None or now.state is not before.state:
        yield "transition", {"from": before.state if before else None, "to": now.state, **why()}
    if before is None or now.command != before.command:
        yield "command", command_fields(now.command)
    yield from _fault_lines(before, now, language)
    yield from _session_lines(before, now, language, clock)
    if before is None or _gist(now) != _gist(before):
        yield "decision", {"state": now.state, **why(), "step": _step_fields(now.step, language)}


def _at(clock: WallClock | None, cause: Cause | None) -> Cause | None:
    return cause if clock is None else clock.told(cause)


def command_fields(command: Command | None) -> dict[str, object]:
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


def _fault_lines(before: Decision | None, now: Decision, language: str) -> Iterator[Line]:
    old = {fault.id: fault for fault in before.faults} if before else {}
    new = {fault.id: fault for fault in now.faults}
    for name, fault in new.items():
        if name not in old or old[name].effect is not fault.effect:
            yield "fault", _fault_fields(fault, "raised", fault.cause, language)
    for name, fault in old.items():
        if name not in new:  # what it was; what was seen of it last, nobody may have written down
            was = (fault.raised or fault.cause).with_(past=True)
            yield "fault", _fault_fields(fault, "cleared", was, language)


def _session_lines(before: Decision | None, now: Decision, language: str, clock: WallClock | None) -> Iterator[Line]:
    was = before.session if before and before.session and not before.session.result else None
    if now.session is None:
        return
    if was is None and not now.session.result:
        yield "session", {"event": "begin", **session_fields(now.session, language, clock)}
    elif now.session.result:
        yield "session", {"event": "end", **session_fields(now.session, language, clock)}


def session_fields(session: Session, language: str = "en", clock: WallClock | None = None) -> dict[str, object]:
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
    """Turns the decisions of one bay into `snapshot` lines: some complete, the others differences from the line before.

    In a quiet state nothing is written until something happens; then a complete line starts over. A line has the whole
    input of a decision: repeating it gives the same result.
    """

    def __init__(self, bay: BayConfig) -> None:
        self._since_whole = 0
        self.begin(bay)

    def begin(self, bay: BayConfig) -> None:
        """Start over with a complete line, with the policy now in force."""
        self._config = json.loads(json.dumps(asdict(bay), default=str))
        self._last: Snapshot | None = None

    def line(self, now_s: float, snapshot: Snapshot, memory: Memory, state: State, *, news: bool) -> Line | None:
        """The line for a decision made at `now_s` with `snapshot` and `memory`; None if nothing is to be recorded.

        `state` is the resulting state, `news` is whether there were any `decision_lines`.
        """
        if state in QUIET and not news and snapshot.request is None:
            self._last = None
            return None
        said: dict[str, object] = {"at_s": now_s}
        if self._last is None or self._since_whole >= WHOLE_EVERY:
            said |= {"whole": True, **_record(snapshot), "memory": _bare(side_by_side(memory)), "config": self._config}
            self._since_whole = 0
        else:
            said |= _difference(self._last, snapshot)
            self._since_whole += 1
        self._last = snapshot
        return "snapshot", said


def _difference(old: Snapshot, new: Snapshot) -> dict[str, object]:
    """Only the parts that differ; of the battery's values only the new ones."""
    said: dict[str, object] = {}
    if new.charger is not old.charger:
        said["charger"] = _plain(new.charger)
    if new.charger_link is not old.charger_link and new.charger_link != old.charger_link:
        said["charger_link"] = _record(new.charger_link)
    if new.battery is not old.battery:
        said["battery"] = _new_values(old.battery, new.battery)
    if new.battery_link is not old.battery_link:
        said["battery_link"] = _plain(new.battery_link)
    if new.request is not old.request:
        said["request"] = new.request
    for name in OURS:
        if getattr(new, name) != getattr(old, name):
            value = getattr(new, name)
            said[name] = _bare(value)
    return said


def _new_values(old: BatteryReading, new: BatteryReading) -> dict[str, object]:
    values: dict[str, object] = {}
    for name in BatteryReading.__slots__:
        value = getattr(new, name)
        if value is not getattr(old, name):
            values[name] = _plain(value)
    return values


def _plain(record: ChargerReading | BatteryLink | Measurement | None) -> dict[str, object] | None:
    """A record without records in it but causes. Far faster than `asdict`, and this is done for every reading."""
    if record is None:
        return None
    return {
        name: _bare(value) if (value := getattr(record, name)).__class__ in DEEP else value for name in record.__slots__
    }


def _record(record: Snapshot | ChargerLink) -> dict[str, object]:
    """The same for a record with others in it, however deep."""
    return {one.name: _bare(getattr(record, one.name)) for one in fields(record)}


def _bare(value: object) -> object:
    """A value with the records and causes in it as JSON has them."""
    if isinstance(value, Cause):
        return plain(value)
    if isinstance(value, tuple):
        return [_bare(one) for one in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: _bare(getattr(value, one.name)) for one in fields(value)}
    return {name: _bare(one) for name, one in value.items()} if isinstance(value, Mapping) else value
