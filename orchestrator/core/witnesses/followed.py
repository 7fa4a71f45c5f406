"""The state of both witnesses carried between decisions."""

from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING

from orchestrator.core.drain import drained
from orchestrator.core.parts import changed, event, measured
from orchestrator.core.states import ENERGISED, RESTING
from orchestrator.core.witnesses.standby import FROZEN, UNORDERED_MOST_S, sees_current
from orchestrator.model import BatteryReading

if TYPE_CHECKING:
    from orchestrator.core.facts import Facts

#: How far back the trail goes, and the interval between its samples.
TRAIL_S, TRAIL_EVERY_S = 10.0, 0.5
#: Less of the charger's current proves nothing about whose pack it flows into.
FIRST_A = 0.5
#: The BMU must see this share of it, on top of what flowed before.
OWN_SHARE = 0.5


#: Everything that a BMU reports.
WORDS = attrgetter(*BatteryReading.__slots__)


@dataclass(frozen=True, slots=True)
class Sample:
    """Pack and charger at one moment."""

    t_s: float
    pack_v: float
    pack_a: float
    charger_v: float
    charger_a: float


@dataclass(frozen=True, slots=True)
class Frozen:
    """The BMU's report, unchanged since `t_s`, and the charger's volts and the session's Ah at that time."""

    t_s: float
    words: tuple[float | None, ...]
    charger_v: float
    charged_ah: float


@dataclass(frozen=True, slots=True)
class Witnessed:
    """What both have shown until now."""

    stop_s: float | None = event(None)  #: when the first whole stop of the present state was handed to the port
    proof: tuple[float, ...] = measured(())  #: request times of the first and the newest status reply of an
    #: unbroken run of standby replies since then
    sees: bool = measured(default=False, tells=RESTING)  #: the BMU sees a charging current without a command …
    unordered_s: float = measured(0.0)  #: … and for how long it has; drains
    trail: tuple[Sample, ...] = measured(())  #: of the last seconds under current, oldest first
    frozen: Frozen | None = measured(None)
    before_a: float = measured(0.0)  #: what the BMU saw before this charge began
    proved: bool = event(default=False, tells=ENERGISED)  #: the BMU has seen the charge begin
    alone_s: float = measured(0.0)  #: for how long the charger has delivered without that; drains


def update(f: "Facts", passed_s: float) -> Witnessed:
    """What is known after this decision's facts; `passed_s` since the previous decision."""
    before = f.memory.witnessed
    stop_s, known = _stop_s(f), _first_amperes(f, before, passed_s)
    proof = _proof(f, stop_s, before.proof if stop_s == before.stop_s else ())
    sees = sees_current(f) and not f.energised
    unordered_s = 0.0 if f.energised else _unordered_s(before, passed_s, sees=sees)
    trail, frozen = _trail(f, before.trail), _frozen(f, before.frozen)
    now = (stop_s, proof, sees, unordered_s, trail, frozen)
    if now == (known.stop_s, known.proof, known.sees, known.unordered_s, known.trail, known.frozen):
        return known
    return changed(known, stop_s=stop_s, proof=proof, sees=sees, unordered_s=unordered_s, trail=trail, frozen=frozen)


def _unordered_s(known: Witnessed, passed_s: float, *, sees: bool) -> float:
    """Time before it was first seen does not count: it may have begun just now."""
    if sees and not known.sees:
        return known.unordered_s
    return min(UNORDERED_MOST_S, drained(known.unordered_s, passed_s, holds=sees))


def _stop_s(f: "Facts") -> float | None:
    """The first whole stop of this state; later ones repeat it."""
    since_s, sent_s, known_s = f.memory.since_s, f.charger.stop_sent_s, f.memory.witnessed.stop_s
    if since_s is None or sent_s is None or sent_s < since_s:
        return None
    return known_s if known_s is not None and known_s >= since_s else sent_s


def _proof(f: "Facts", stop_s: float | None, proof: tuple[float, ...]) -> tuple[float, ...]:
    reading = f.reading
    if stop_s is None or reading is None or not f.standby or sees_current(f):
        return ()
    if reading.t_s < stop_s or reading.t_s in proof:
        return proof
    return (*proof[:1], reading.t_s)


def _trail(f: "Facts", trail: tuple[Sample, ...]) -> tuple[Sample, ...]:
    if not f.energised or f.pack_v is None or f.pack_a is None or f.volts is None or f.amps is None:
        return () if not f.energised else trail
    if trail and f.now_s - trail[-1].t_s < TRAIL_EVERY_S:
        return trail
    sample = Sample(f.now_s, f.pack_v, f.pack_a, f.volts, f.amps)
    return (*(one for one in trail if f.now_s - one.t_s <= TRAIL_S), sample)


def _frozen(f: "Facts", frozen: Frozen | None) -> Frozen | None:
    """Tracked during a charge; a report found frozen stays so, at rest too, until a value changes."""
    session, battery = f.memory.session, f.snapshot.battery
    if frozen is None and (session is None or not f.energised):
        return None
    words = tuple([word.value if word is not None else None for word in WORDS(battery)])
    if frozen is not None and frozen.words == words:
        return frozen if f.energised or FROZEN in f.raised else None
    if f.volts is None or session is None or not f.energised or f.pack_v is None:
        return None
    return Frozen(f.now_s, words, f.volts, session.charged_ah)


def _first_amperes(f: "Facts", known: Witnessed, passed_s: float) -> Witnessed:
    if not f.energised:
        before_a = f.pack_a or 0.0
        if (known.before_a, known.proved, known.alone_s) == (before_a, False, 0.0):
            return known
        return changed(known, before_a=before_a, proved=False, alone_s=0.0)
    if known.proved or f.amps is None or f.pack_a is None:
        return known
    flows = f.amps >= FIRST_A
    proved = flows and f.pack_a - known.before_a >= OWN_SHARE * f.amps
    return changed(known, proved=proved, alone_s=drained(known.alone_s, passed_s, holds=flows and not proved))
