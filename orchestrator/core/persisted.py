"""What of a bay's memory survives a restart, and the memory that a restart begins with. Pure: no disk, no clock.

A restart is neither a reset nor a start, and it forgets no limit: everything latched, held, counted or raised
continues. A charger that may have been running waits for a person, and one that was out of control still is. Times are
stored as ages, since monotonic clocks start again.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from orchestrator.core.active import unknown
from orchestrator.core.faults import ROW, Clear
from orchestrator.core.latches import BACKOFF_S
from orchestrator.core.memory import FaultMemory, Memory, with_values
from orchestrator.core.states import MAY_RUN
from orchestrator.model import Cause, Session, State
from orchestrator.model.cause import said, together

#: Mere counters are written this often while nothing else changes.
COUNTERS_S = 30.0
UNFINISHED = Cause("unfinished")

Age = float  #: in seconds, at the time of writing


@dataclass(frozen=True, slots=True)
class PersistedFault:
    """An active fault, or the strikes left of one."""

    cause: Cause | None = None  #: the evidence; None if only strikes are left
    latched: bool = False
    raised: Age | None = None  #: None: it is not active
    clean: Age | None = None  #: since when its condition has been gone; None: it was still true
    strikes: tuple[Age, ...] = ()


@dataclass(frozen=True, slots=True)
class TimedStart:
    """A start that a person has asked for at a time of day, by the wall clock; the core knows nothing of it."""

    start_unix_s: float
    by: Cause | None = None  #: who asked for it, and when; None: unknown
    target_pct: float | None = None  #: of its one charge; None: by the policy
    outcome: Cause | None = None  #: why it was not made; None: it is to come


@dataclass(frozen=True, slots=True)
class Persisted:
    """The persisted state of one bay."""

    running: bool = False  #: the charger may be running: it was told to, and was not verified in standby since
    uncontrollable: Age | None = None  #: how long a charger out of control has not obeyed its stop; None: it is not
    hold: Cause | None = None  #: why a person must start; as in the core's memory
    paused: bool = False
    paused_by: Cause | None = None  #: who paused it, if known
    target_pct: float | None = None  #: the SOC to charge to once; None: by the policy …
    target_by: Cause | None = None  #: … and who has asked for that
    faults: Mapping[str, PersistedFault] = field(default_factory=dict)
    resets: tuple[tuple[Age, str], ...] = ()
    session: Session | None = None  #: the open charge with all its counters; `started_s` is an age
    full_pct: float | None = None
    full: Age | None = None  #: how long the battery has not been charged all the way; None: not counted yet
    soc: tuple[Age, float] | None = None  #: the newest SOC of the battery in the bay
    serial: int | None = None  #: its serial number; None: it has none
    typed: str = ""  #: its id as an operator typed it; the core knows nothing of it
    timed: TimedStart | None = None  #: the start at a time of day

    @classmethod
    def of(cls, memory: Memory, now_s: float) -> "Persisted":
        """What to persist of a bay's memory."""
        faults = {
            name: PersistedFault(
                cause=fault.cause if fault.raised_s is not None else None,
                latched=fault.latched,
                raised=_age(fault.raised_s, now_s),
                clean=_age(fault.clean_s, now_s),
                strikes=tuple(now_s - t_s for t_s in fault.strikes),
            )
            for name, fault in memory.faults.items()
            if fault.raised_s is not None or fault.strikes
        }
        soc_s, soc_pct = memory.battery.charge
        session = memory.session
        return cls(
            running=memory.state in MAY_RUN or memory.stage.intends or memory.stop.unverified,
            uncontrollable=_uncontrollable(memory, now_s),
            hold=memory.operator.hold,
            paused=memory.operator.paused,
            paused_by=memory.operator.paused_by,
            target_pct=memory.operator.target_pct,
            target_by=memory.operator.target_by,
            faults=faults,
            resets=tuple((now_s - t_s, name) for t_s, name in memory.operator.resets),
            session=replace(session, started_s=now_s - session.started_s) if session is not None else None,
            full_pct=memory.battery.full_pct,
            full=_age(memory.battery.full_s, now_s),
            soc=(now_s - soc_s, soc_pct) if soc_pct is not None else None,
            serial=memory.battery.serial,
        )

    @property
    def gist(self) -> tuple[object, ...]:
        """What must be on disk before it is relied on; the rest are ages and counters, which may be slightly older."""
        faults = frozenset(
            (name, fault.latched, fault.raised is not None, len(fault.strikes)) for name, fault in self.faults.items()
        )
        resets = tuple(name for _, name in self.resets)
        known = (
            self.uncontrollable is not None,
            self.session is not None,
            self.full_pct is None,
            self.serial,
            self.typed,
            self.timed,
            self.target_pct,
            self.target_by,
        )
        return self.running, self.hold, self.paused, self.paused_by, faults, resets, *known

    def aged(self, seconds: float, unseen_s: float | None = None) -> "Persisted":
        """The same state this much later; `unseen_s` if the time without counting differs from that."""
        return replace(
            self,
            uncontrollable=None if self.uncontrollable is None else self.uncontrollable + seconds,
            faults={
                name: replace(
                    fault,
                    raised=None if fault.raised is None else fault.raised + seconds,
                    clean=None if fault.clean is None else fault.clean + seconds,
                    strikes=tuple(age_s + seconds for age_s in fault.strikes),
                )
                for name, fault in self.faults.items()
            },
            resets=tuple((age_s + seconds, name) for age_s, name in self.resets),
            full=None if self.full is None else self.full + seconds,
            session=self._session(seconds, unseen_s),
            soc=(self.soc[0] + seconds, self.soc[1]) if self.soc is not None else None,
        )

    def _session(self, seconds: float, unseen_s: float | None) -> Session | None:
        """A running charger continued after its counters were written, at most until the next writing was due."""
        session = self.session
        if session is None:
            return None
        more_s = min(seconds if unseen_s is None else unseen_s, COUNTERS_S) if self.running else 0.0
        continuous = session.continuous_s > 0
        return replace(
            session,
            started_s=session.started_s + seconds,
            unseen_s=session.unseen_s + more_s,
            pulse_s=session.pulse_s + (0.0 if continuous else more_s),
            continuous_s=session.continuous_s + (more_s if continuous else 0.0),
            rise_s=session.rise_s + more_s,
        )

    def memory(self, now_s: float) -> Memory:
        """The memory that the bay begins with."""
        known = {name: one for name, one in self.faults.items() if name in ROW or one.latched or one.raised is None}
        faults = {name: _fault(fault, now_s) for name, fault in known.items()}
        if self.running:
            faults["found_running"] = FaultMemory(raised_s=now_s, cause=UNFINISHED)
        others = [unknown(name, one.cause) for name, one in self.faults.items() if name not in known]
        session = self.session
        out_s = None if self.uncontrollable is None else now_s - self.uncontrollable
        return with_values(
            Memory() if out_s is None else Memory(state=State.UNCONTROLLABLE),
            stopping_s=out_s,
            hold=self.hold or (together(others) if others else None),
            paused=self.paused,
            paused_by=self.paused_by,
            target_pct=self.target_pct,
            target_by=self.target_by,
            faults=faults,
            resets=tuple((now_s - age_s, name) for age_s, name in self.resets),
            session=replace(session, started_s=now_s - session.started_s) if session is not None else None,
            full_pct=self.full_pct,
            full_s=None if self.full is None else now_s - self.full,
            unverified=self.running,
            serial=self.serial,
            charge=(now_s - self.soc[0], self.soc[1]) if self.soc is not None else (0.0, None),
        )


def _uncontrollable(memory: Memory, now_s: float) -> Age | None:
    """Since the first stop in vain; only a standby that lasts ends it, however often the service restarts."""
    if memory.state is not State.UNCONTROLLABLE:
        return None
    since_s = memory.stop.stopping_s if memory.stop.stopping_s is not None else memory.since_s
    return 0.0 if since_s is None else now_s - since_s


def _age(t_s: float | None, now_s: float) -> Age | None:
    return None if t_s is None else now_s - t_s


def _fault(fault: PersistedFault, now_s: float) -> FaultMemory:
    return FaultMemory(
        raised_s=None if fault.raised is None else now_s - fault.raised,
        clean_s=None if fault.clean is None else now_s - fault.clean,
        cause=fault.cause,
        latched=fault.latched,
        strikes=tuple(now_s - age_s for age_s in fault.strikes),
    )


def from_first_format(name: str, text: str) -> PersistedFault:
    """A fault in the first format, which stored only those that wait for a person, by id and evidence."""
    row = ROW.get(name)
    backoff = row is not None and row.clear is Clear.BACKOFF  # with fewer strikes it would not have been stored
    strikes = (0.0,) * (len(BACKOFF_S) + 1) if backoff else ()
    latched = row is None or row.clear is not Clear.OPERATOR
    return PersistedFault(said(text), latched, raised=0.0, strikes=strikes)
