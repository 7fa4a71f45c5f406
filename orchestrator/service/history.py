"""What happened, in sentences, from the events of a journal. Pure but for the reading."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.model import Cause
from orchestrator.model.cause import from_plain, said, without_then
from orchestrator.record.lasting import session_figures
from orchestrator.record.utc import unix_s
from orchestrator.service.journal_files import Fields, records_of
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import say

#: Kinds that are for programs: what they say is in the others, or changes constantly.
UNTOLD = frozenset({"snapshot", "decision", "command"})
#: What needs a person, as the states and effects of the records say it.
LEVELS = {"UNCONTROLLABLE": "danger", "TRIPPED": "attention", "TRIP": "attention"}
#: The failures of the station itself, by the ids of what it says.
FAILURES = frozenset({
    "guardian_died", "guardian_silent", "guardian_full", "unable", "ended", "disk_internal", "bay_internal",
    "journal_dead", "journal_hangs", "journal_failed", "disk_failed", "disk_slow", "disk_hangs", "disk_silent",
    "socket_internal", "socket_taken", "socket_lost", "reload_refused", "reload_failed", "stray_found", "stray_runs",
})  # fmt: skip
#: A charge that has lasted longer does not begin, but was left open.
OPEN_S = 1.0
#: A part of a run that goes on begins with the run's name as well; its own line stands at the run's very beginning.
SAME_S = 0.5

Broken = Callable[[Path, int, str], None]


@dataclass(frozen=True, slots=True)
class Happened:
    """One event. `bay` is "" for the station itself."""

    wall: str  #: as in the journal
    unix_s: float
    bay: str
    kind: str
    text: str
    id: str = ""  #: of its cause
    level: str = ""  #: "danger", "attention", or "" if nobody had to come
    by: str = ""  #: who, where that is known


class Story:
    """Follows the records of a journal in their order. `language` "" leaves the sentences as they were written."""

    def __init__(self, language: str) -> None:
        self._language = language
        self._reasons: dict[str, tuple[float, str]] = {}  # per bay, when its state last changed, and the cause's id
        self._boot: str | None = None  # of the run before
        self._ended: bool | None = None  # whether that run said that it ends; None: it would not have said it

    def tell(self, record: Fields) -> Happened | None:
        """What this record says; None if that is nothing new to a person."""
        tell = TELLERS.get(record["kind"], Story._other)
        try:
            wall_s, told = unix_s(record["wall"]), tell(self, record)
        except (LookupError, TypeError, ValueError, OverflowError, OSError):
            return None
        if told is None:
            return None
        cause, level = told
        text, by = say(cause, self._language or "en"), _by(record)
        if by and by not in text:
            text = say(Cause.of("event_by", what=text, by=by), self._language)
        inner = record.get("cause")
        id_ = str(inner.get("id", "")) if isinstance(inner, Mapping) else cause.id
        return Happened(record["wall"], wall_s, record["bay"], record["kind"], text, id_, level, by)

    # --- each kind ---

    def _transition(self, record: Fields) -> tuple[Cause, str] | None:
        told, what = self._told(record), self._cause(record, "reason")
        self._reasons[record["bay"]] = record["t"], _id(record)
        level = LEVELS.get(record["to"], "")
        if record["from"] is None:
            return Cause.of("event_begins", state=record["to"], reason=what), level
        if told:
            return Cause.of("event_goes_on", before=record["from"], state=record["to"]), level
        return Cause.of("event_goes", before=record["from"], state=record["to"], reason=what), level

    def _told(self, record: Fields) -> bool:
        """Whether the bay's last change of state has said the same."""
        return _id(record) == self._reasons.get(record["bay"], (0.0, ""))[1] != ""

    def _fault(self, record: Fields) -> tuple[Cause, str] | None:
        if record["event"] == "cleared":
            return Cause.of("event_fault_over", what=self._cause(record, "text")), ""
        if self._reasons.get(record["bay"]) == (record["t"], _id(record)):
            return None  # the change of state has said it
        return Cause.of("event_fault", effect=record["effect"], what=self._cause(record, "text")), LEVELS.get(
            record["effect"], ""
        )

    def _session(self, record: Fields) -> tuple[Cause, str] | None:
        if record["event"] == "end":
            result = None if self._told(record) else self._cause(record, "result")
            return Cause.of("event_charged", figures=session_figures(record), result=result), ""
        if record["event"] == "begin" and (record.get("elapsed_s") or 0.0) > OPEN_S:
            return Cause.of("event_charge_open", figures=session_figures(record)), ""  # left open by the run before
        if record["event"] == "begin":
            return Cause.of("event_charge", soc_pct=record["soc_start_pct"]), ""
        return None

    def _contactor(self, record: Fields) -> tuple[Cause, str] | None:
        closed = "event_closed" if record["closed"] else "event_opened"
        problem = self._cause(record, "problem") if record.get("problem") else None
        return Cause.of(closed, problem=problem), "attention" if problem else ""

    def _run(self, record: Fields) -> tuple[Cause, str] | None:
        boot, begun_s = _run_of(record)
        if abs(record["t"] - begun_s) > SAME_S:
            return None  # a part of a run that goes on
        before, ended = self._boot, self._ended
        self._boot, self._ended = boot, None
        if ended is not False:
            return Cause("event_run"), ""
        return Cause("event_run_dead" if before == boot else "event_run_boot"), "attention"

    def _request(self, record: Fields) -> tuple[Cause, str] | None:
        """One that was refused, and a start for later, of which nothing else tells yet."""
        if not record.get("accepted") or record.get("start_at") is None:
            return self._other(record)
        words = {name: record[name] for name in ("target_soc_pct", "because") if record.get(name)}
        target = {"target_pct": words.pop("target_soc_pct")} if "target_soc_pct" in words else {}
        who, asked_s = record["by"] or "?", unix_s(record["wall"])
        id_ = "starts_at_to" if target else "starts_at"
        what = Cause.of(id_, who=who, asked_unix_s=asked_s, start_unix_s=record["start_at"], **target, **words)
        return WallClock(record["t"], asked_s).told(what) or what, ""

    def _station(self, record: Fields) -> tuple[Cause, str] | None:
        if _id(record) == "bay_refused":
            return None  # a start for later: its own record says it
        self._ended = _id(record) in ("ended", "ended_well")
        return self._cause(record, "text"), "attention" if _id(record) in FAILURES else ""

    def _timed(self, record: Fields) -> tuple[Cause, str] | None:
        return self._cause(record, "text"), "attention" if _id(record) == "start_not_made" else ""

    def _lost(self, record: Fields) -> tuple[Cause, str] | None:
        return Cause.of("event_lost", lines=record["lines"]), "attention"

    def _other(self, record: Fields) -> tuple[Cause, str] | None:
        """A kind that this version does not know: whatever it says in words."""
        if record["kind"] in UNTOLD or not (record.get("text") or record.get("cause")):
            return None
        return self._cause(record, "text"), ""

    def _cause(self, record: Fields, text: str) -> Cause:
        """What a record says, by the clock of its time; as it was written where that is not understood."""
        written = said(str(record.get(text) or ""))
        if not self._language and record.get(text):
            return written
        try:
            cause = without_then(from_plain(record["cause"]), advice=False)
            cause = WallClock(record["t"], unix_s(record["wall"])).told(cause) or cause
        except (LookupError, ValueError):
            return written
        told = say(cause, self._language or "en", str(record.get(text) or ""))
        return said(told)


Teller = Callable[[Story, Fields], tuple[Cause, str] | None]
TELLERS: Mapping[str, Teller] = {
    "transition": Story._transition,  # noqa: SLF001 - our own
    "fault": Story._fault,  # noqa: SLF001
    "session": Story._session,  # noqa: SLF001
    "contactor": Story._contactor,  # noqa: SLF001
    "run": Story._run,  # noqa: SLF001
    "request": Story._request,  # noqa: SLF001
    "station": Story._station,  # noqa: SLF001
    "timed_start": Story._timed,  # noqa: SLF001
    "lost": Story._lost,  # noqa: SLF001
}


def _id(record: Fields) -> str:
    cause = record.get("cause")
    return str(cause.get("id", "")) if isinstance(cause, Mapping) else ""


def _run_of(record: Fields) -> tuple[str, float]:
    """The machine's boot, and the monotonic time at which the run began: BOOT/SECONDS/UNIX TIME."""
    boot, begun, _ = str(record.get("run", "")).rsplit("/", 2)
    return boot, float(begun)


def _by(record: Fields) -> str:
    """Who asked for it, if the record knows."""
    by: Any = record.get("by")
    return str(by.get("user") or by.get("name") or "") if isinstance(by, Mapping) else by if isinstance(by, str) else ""


# --- reading ----------------------------------------------------------------------------------------------------------


def happened(
    files: Iterable[Path], language: str, wanted: Callable[[bytes], bool], broken: Broken = lambda *_: None
) -> Iterator[Happened]:
    """What the files say, line by line. `wanted` looks at a line before it is read."""
    story = Story(language)
    for path, number, record in records_of((path for path in files if path.exists()), wanted):
        if isinstance(record, str):
            broken(path, number, record)
        elif (told := story.tell(record)) is not None:
            yield told


def newest(files: Sequence[Path], most: int, tell: Callable[[Sequence[Path]], Iterator[Happened]]) -> list[Happened]:
    """The last `most` that `tell` finds, read part by part from the end: memory holds no more than these."""
    kept: list[Happened] = []
    for path in reversed(files):
        kept = [*deque(tell([path]), maxlen=most - len(kept)), *kept]
        if len(kept) >= most:
            break
    return kept
