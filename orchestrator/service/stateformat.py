"""The file format of the persisted state: JSON with a version. Data from a disk is untrusted until it is decoded."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

from orchestrator.config.station import Rs485
from orchestrator.core.persisted import COUNTERS_S, Persisted, from_first_format
from orchestrator.model import Cause, ControlMode
from orchestrator.service.past import Entry, Place
from orchestrator.service.sentences import of_sentences, said
from orchestrator.service.typed import MOST, structure

FORMAT = 3
#: The previous format had sentences instead of causes.
SENTENCES = 2
#: A clock before this moment (2024-01-01) has never been set.
NEVER_SET_S = 1_704_067_200.0
#: The keys beside a bay's persisted state.
PLACE = ("bay", "port", "can", "node_id", "control", "rs485", "run")
TOO_DEEP = "it is nested deeper than anything that this service writes"
#: Every entry must have these; keys added by later versions have defaults.
NEEDED = frozenset({"running", "hold", "paused", "faults"})


@dataclass(frozen=True, slots=True)
class Stamp:
    """When it was written."""

    wall_s: float  #: by the wall clock
    clock_s: float  #: by the monotonic clock …
    boot: str  #: … of this boot of the machine; "" if unknown

    def age_s(self, now: "Stamp") -> float:
        """How long ago that was; 0 if no clock can tell. An age too small keeps every limit in force."""
        if self.boot and self.boot == now.boot and self.clock_s <= now.clock_s:
            return min(now.clock_s - self.clock_s, MOST / 2)
        if self.wall_s < NEVER_SET_S or not self.wall_s <= now.wall_s <= MOST / 2:
            return 0.0
        return now.wall_s - self.wall_s


def encode(stamp: Stamp, run: int, entries: Sequence[Entry]) -> bytes:
    """The file's bytes, one entry per line."""
    head = {"format": FORMAT, "written": stamp.wall_s, "clock_s": stamp.clock_s, "boot": stamp.boot, "run": run}
    lines = ",\n".join(json.dumps(_entry(entry)) for entry in entries)
    return f'{json.dumps(head)[:-1]}, "entries": [\n{lines}\n]}}\n'.encode()


def _entry(entry: Entry) -> dict[str, object]:
    place = entry.place
    return {
        "bay": place.bay,
        "port": place.port,
        "can": place.can,
        "node_id": place.node_id,
        "control": place.control.name.lower(),
        "rs485": place.rs485.value,
        "run": entry.run,
        **asdict(entry.persisted),
    }


def decode(data: bytes, now: Stamp) -> tuple[int, list[Entry]]:
    """The newest run of the service and all entries, with their ages `now`; ValueError for a foreign file."""
    try:
        document = json.loads(data)
        if not isinstance(document, dict) or document.get("format") not in (FORMAT, SENTENCES):
            raise ValueError("it is not of a format that this version knows")
        figures = {name: structure(document.get(name), float) for name in ("written", "clock_s")}
        stamp = Stamp(figures["written"], figures["clock_s"], structure(document.get("boot"), str))
        run, age_s = structure(document.get("run"), int), stamp.age_s(now)
        entries = list(_entries(document.get("entries"), age_s, sentences=document["format"] == SENTENCES))
    except RecursionError:
        raise ValueError(TOO_DEEP) from None
    except (ArithmeticError, LookupError) as error:
        raise ValueError(repr(error)) from None
    if len({entry.place for entry in entries}) < len(entries):
        raise ValueError("one place is in it twice")
    return run, entries


def _entries(values: object, age_s: float, *, sentences: bool) -> Iterator[Entry]:
    if not isinstance(values, list):
        raise ValueError("it has no list of entries")
    for value in values:
        if not isinstance(value, dict):
            raise ValueError(f"{value!r:.80} is no entry")
        place = Place(
            structure(value.get("bay"), str),
            _path(value.get("port")),
            structure(value.get("can"), str),
            structure(value.get("node_id"), int),
            ControlMode[structure(value.get("control"), str).upper()],
            Rs485(structure(value.get("rs485"), str)),
        )
        if not value.keys() >= NEEDED:
            raise ValueError(f"{', '.join(sorted(NEEDED - value.keys()))} is missing")
        plain = {key: one for key, one in value.items() if key not in PLACE}
        persisted: Persisted = structure(of_sentences(plain) if sentences else plain, Persisted)
        unseen_s = age_s or COUNTERS_S  # an unknown age is 0
        yield Entry(place, persisted.aged(age_s, unseen_s), structure(value.get("run"), int))


def _path(value: object) -> str:
    """A path; it need not be valid text, and was written in Python's representation."""
    if not isinstance(value, str) or "\0" in value:
        raise ValueError(f"{value!r:.80} is no path")
    return value


def decode_first(data: bytes, run: int) -> list[Entry]:
    """The entries of the first format, which had only the bays' names; ValueError for a foreign file."""
    try:
        document = json.loads(data)
    except RecursionError:
        raise ValueError(TOO_DEEP) from None
    if not isinstance(document, dict):
        raise ValueError("it is no object")
    return [Entry(Place(structure(name, str)), _first(value), run) for name, value in document.items()]


@dataclass(frozen=True, slots=True)
class _First:
    running: bool
    hold: str
    paused: bool


def _first(value: object) -> Persisted:
    if not isinstance(value, dict) or not isinstance(value.get("faults"), dict):
        raise ValueError(f"{value!r:.80} is not what was written")
    plain = structure({key: one for key, one in value.items() if key != "faults"}, _First)
    faults = {structure(name, str): structure(text, str) for name, text in value["faults"].items()}
    kept = {name: from_first_format(name, text) for name, text in faults.items()}
    hold = structure(said(plain.hold), Cause | None)
    return Persisted(running=plain.running, hold=hold, paused=plain.paused, faults=kept)
