"""A bay's past: which persisted entries are its own, and what it inherits from others. Pure.

Persisted state belongs to a *place*: the bay's name, its charger's port and its BMU. Editing the station file can move
names, ports and batteries between bays; then the actual wiring is unknown, and a person must look. Whatever was
latched, held or running at either place stays so.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os.path import abspath, realpath

from orchestrator.config.station import BayConfig, Rs485
from orchestrator.core.persisted import Persisted, PersistedFault
from orchestrator.model import Cause, ControlMode
from orchestrator.model.cause import parts as causes
from orchestrator.model.cause import together


@dataclass(frozen=True, slots=True)
class Place:
    """The owner of an entry; in the first format only the name is known, the rest is empty."""

    bay: str
    port: str = ""  #: absolute, as configured: names below by-path are not resolved
    can: str = ""
    node_id: int = 0
    control: ControlMode = field(default=ControlMode.MANUAL, compare=False)
    rs485: Rs485 = field(default=Rs485.OFF, compare=False)

    @classmethod
    def of(cls, bay: BayConfig) -> "Place":
        """The present place of this bay."""
        charger, battery, port = bay.charger, bay.battery, abspath(bay.charger.port)  # noqa: PTH100 - not resolved
        return cls(bay.name, port, battery.can, battery.node_id, charger.control, charger.rs485)

    @property
    def bmu(self) -> tuple[str, int]:
        """The battery's BMU."""
        return self.can, self.node_id

    def is_port_of(self, other: "Place") -> bool:
        """Whether both are the same serial port, whatever their names."""
        return self.port == other.port or ("" not in (self.port, other.port) and _device(self) == _device(other))

    def overlaps(self, other: "Place") -> bool:
        """Whether they share a name, a port or a BMU."""
        return self.bay == other.bay or self.is_port_of(other) or self.bmu == other.bmu

    def __str__(self) -> str:
        return f"{self.bay} on {shown(self.port)}"


@dataclass(frozen=True, slots=True)
class Entry:
    """The persisted state of one place."""

    place: Place
    persisted: Persisted
    run: int  #: the newest run of the service in which a bay had this place


def past_of(place: Place, entries: Sequence[Entry], file: str) -> Persisted:
    """The state that a bay begins with.

    Another entry counts if its place was used later than the bay's own: otherwise it was inherited already.
    """
    own = next((entry for entry in entries if entry.place == place), None)
    since = own.run if own else -1
    others = [entry for entry in entries if entry is not own and entry.place.overlaps(place) and entry.run > since]
    if own is None and [entry.place for entry in others] == [Place(place.bay)]:
        return others[0].persisted  # the first format knew names only
    if not others:
        unknown = Cause.of("past_unknown", bay=place.bay, port=shown(place.port), file=file)
        return own.persisted if own else Persisted(hold=unknown)
    moves = [_moved(entry.place, place) for entry in others]
    return merged([*([own.persisted] if own else []), *(entry.persisted for entry in others)], moves)


def _moved(old: Place, new: Place) -> Cause:
    if not old.port:
        return Cause.of("older_version_ran", bay=old.bay)
    if old.bay != new.bay:
        if old.is_port_of(new):
            return Cause.of("port_was_of", port=shown(new.port), old_bay=old.bay, bay=new.bay)
        return Cause.of("bmu_was_of", can=new.can, node_id=new.node_id, old_bay=old.bay, bay=new.bay)
    if old.port != new.port:
        return Cause.of("bay_moved_port", bay=new.bay, old_port=shown(old.port), port=shown(new.port))
    return Cause.of(
        "bay_moved_bmu",
        bay=new.bay, old_can=old.can, old_node_id=old.node_id, can=new.can, node_id=new.node_id,
    )  # fmt: skip


def shown(port: str) -> str:
    """A path for people, even if it is not valid text."""
    return port.encode(errors="backslashreplace").decode()


def merged(parts: Sequence[Persisted], moves: Sequence[Cause]) -> Persisted:
    """The strictest combination of all of them, held for `moves` and for whatever held any of them."""
    holds = dict.fromkeys([*moves, *(one for part in parts if part.hold is not None for one in causes(part.hold))])
    faults: dict[str, PersistedFault] = {}
    for part in parts:
        for name, fault in part.faults.items():
            faults[name] = _worse(faults[name], fault) if name in faults else fault
    sessions = [part.session for part in parts if part.session is not None]
    fulls = [part.full_pct for part in parts if part.full_pct is not None]
    batteries = {(part.serial, part.typed) for part in parts}
    serial, typed = batteries.pop() if len(batteries) == 1 else (None, "")
    return Persisted(
        running=any(part.running for part in parts),
        uncontrollable=max((one for part in parts if (one := part.uncontrollable) is not None), default=None),
        hold=together(list(holds)) if holds else None,
        paused=any(part.paused for part in parts),
        paused_by=next((part.paused_by for part in parts if part.paused_by is not None), None),
        faults=faults,
        resets=tuple(sorted({reset for part in parts for reset in part.resets}, reverse=True)),
        session=max(sessions, key=lambda session: session.charged_ah, default=None),
        full_pct=min(fulls, default=None),
        full=max((part.full for part in parts if part.full is not None), default=None),
        soc=min((part.soc for part in parts if part.soc is not None), default=None),
        serial=serial,
        typed=typed,
    )


def _worse(one: PersistedFault, other: PersistedFault) -> PersistedFault:
    """One fault at two places: active if it is active at either, and gone only once it is gone at both."""
    first, second = sorted((one, other), key=lambda fault: (fault.latched, fault.raised is not None), reverse=True)
    gone = None if None in (one.clean, other.clean) else min(one.clean or 0.0, other.clean or 0.0)
    strikes = max(one.strikes, other.strikes, key=len)
    return replace(first, clean=gone if second.raised is not None else first.clean, strikes=strikes)


def settled(
    places: Sequence[Place], pasts: Mapping[Place, Persisted], entries: Iterable[Entry], run: int
) -> list[Entry]:
    """All entries after the bays have inherited their pasts, in this run of the service.

    Entries of places without a bay stay for ever. A running charger belongs to the bay that has its port.
    """
    now = [Entry(place, pasts[place], run) for place in places]
    for entry in entries:
        old = entry.place
        if old in pasts or any(old == Place(place.bay) or _renamed(old, place) for place in places):
            continue
        taken_over = entry.persisted.running and any(old.is_port_of(place) for place in places)
        kept = replace(entry.persisted, running=False, uncontrollable=None) if taken_over else entry.persisted
        now.append(replace(entry, persisted=kept))
    return now


def _renamed(old: Place, new: Place) -> bool:
    return (old.port, old.bmu) == (new.port, new.bmu)


def _device(place: Place) -> str:
    return realpath(place.port)
