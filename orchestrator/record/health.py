"""A battery's health, from the charges on record: what it holds, its resistance, and what it has been through. Pure.

`health` takes the records of one battery as `Charges.whole` gives them. The estimates use the newest `WINDOW` charges
that say something, of the last year: a battery is as it is now, not as it was. Everything else counts all charges
given.

`METHOD` is the version of the method and stands in each result. A change that moves a figure makes it a higher one:
two figures of different methods must not be compared, lest a battery seem to heal.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.record import measured as measuring
from orchestrator.record import resistance as resisting
from orchestrator.record.capacity import LEAST_AH, Aged, Estimate, balance, capacity, is_usable
from orchestrator.record.lines import END, Record
from orchestrator.record.measured import Measured
from orchestrator.record.resistance import Resistance, Steps
from orchestrator.record.stamp import Stamp, figure, from_fields
from orchestrator.record.stretch import MOST

#: The version of the method: of this file, `capacity.py`, `resistance.py`, `fit.py` and what `measured.py` measures.
METHOD = 1
#: The charges that an estimate is made from, and how old they may be.
WINDOW, LONGEST_YEARS = 60, 1.0
YEAR_S = 365.25 * 86_400.0
#: Faults by which the core doubts the SOC (FAULTS B17).
DOUBTS = frozenset({"soc_jump", "soc_falls", "figures_disagree"})
#: The sources of an identity, the surest last.
SOURCES = ("assumed", "typed", "serial_number")
#: Rules that bind in a precharge begin so.
PRECHARGE = "precharging_"
#: Less current is none.
NO_CURRENT_A = 0.1
#: The BMU's SOH is in whole per cent, rounded or cut off.
SOH_PCT = 1.0


@dataclass(frozen=True, slots=True)
class Rest:
    """The pack's voltage without current, as a charge began."""

    pack_v: float
    soc_pct: float
    at: Stamp


@dataclass(frozen=True, slots=True)
class Health:
    """Of one battery, at the end of its newest charge; None where nothing can be said."""

    method: int
    battery: str
    source: str  #: the weakest by which one of the charges was known to be this battery's
    charges: int
    newest: Stamp | None
    capacity: Estimate | None  #: Ah
    rated_ah: float | None  #: by the policy of the newest charge
    resistance: Resistance | None
    usable: tuple[int, int]  #: charges of the last year that tell a capacity, and a resistance
    bmu_soh_pct: float | None
    balance: float | None  #: Ah by the BMU, as a share of those by the charger
    rest: Rest | None
    high_s: float  #: at or above `HIGH_SHARE` of the end voltage, in charges
    hot_s: float  #: at or above `HOT_C`, in charges
    deep_discharges: int  #: charges with a precharge
    faults: tuple[tuple[str, str, int], ...]  #: id, effect, how often; the most frequent first

    @property
    def soh_pct(self) -> Estimate | None:
        """The capacity as per cent of the rated one."""
        return self.capacity.of(self.rated_ah) if self.capacity is not None and self.rated_ah else None

    @property
    def parts(self) -> bool:
        """Whether the BMU's own SOH lies outside the interval."""
        own = self.soh_pct
        if own is None or self.bmu_soh_pct is None:
            return False
        return not own.low - SOH_PCT <= self.bmu_soh_pct <= own.high + SOH_PCT


@dataclass(frozen=True, slots=True)
class _Charge:
    """One record, and what was measured in it."""

    record: Record
    measured: Measured
    end: Stamp


def health(battery: str, records: Iterable[Record]) -> Health:
    """What the ended charges of this battery show; records of others, open ones and damaged ones are passed over."""
    charges = sorted(_ended(battery, records), key=lambda one: str(one.record["id"]))
    newest = charges[-1] if charges else None
    window = [(one, (newest.end.unix_s - one.end.unix_s) / YEAR_S) for one in charges] if newest is not None else []
    window = [(one, years) for one, years in window if 0.0 <= years <= LONGEST_YEARS]
    stretches = [
        Aged(stretch, years)
        for one, years in window
        if (stretch := one.measured.stretch) is not None and is_usable(stretch) and not _doubted(one.record)
    ]
    steps = [Steps(found, years) for one, years in window if (found := resisting.usable(one.measured.steps))]
    return Health(
        METHOD,
        battery,
        min((str(one.record["battery"].get("source")) for one in charges), key=_rank, default=SOURCES[0]),
        len(charges),
        newest.end if newest is not None else None,
        capacity(stretches[-WINDOW:]),
        _rated(newest),
        resisting.resistance(steps[-WINDOW:]),
        (len(stretches), len(steps)),
        next((soh for one in reversed(charges) if (soh := _value(one, "soh_pct", "end")) is not None), None),
        balance([one.stretch for one in stretches[-WINDOW:]]),
        next((rest for one in reversed(charges) if (rest := _rest(one)) is not None), None),
        sum(one.measured.high_s for one in charges),
        sum(one.measured.hot_s for one in charges),
        sum(any(str(rule["id"]).startswith(PRECHARGE) for rule in one.record["rules"]) for one in charges),
        _faults(charges),
    )


def for_capacity(listed: Record) -> Record:
    """A charge as the index lists it, for `health`: its capacity and SOH, and nothing else of it, can be relied on."""
    return {**listed, "rules": [], "measured": {**listed["measured"], "steps": [], "hot_s": 0.0, "high_s": 0.0}}


def _ended(battery: str, records: Iterable[Record]) -> Iterator[_Charge]:
    for record in records:
        try:
            if record["type"] == END and record["battery"]["id"] == battery:
                yield _charge(record)
        except (AttributeError, LookupError, TypeError, ValueError):
            continue


def _charge(record: Record) -> _Charge:
    """Raises LookupError, TypeError or ValueError for a damaged record."""
    for name, kind in (("policy", Mapping), ("rules", Sequence), ("faults", Sequence), ("values", Mapping)):
        if not isinstance(record[name], kind):
            raise ValueError(f"{name} of charge {record['id']!s:.40} is damaged")
    for fault in record["faults"]:
        if not isinstance(fault["id"], str) or not isinstance(fault["effect"], str) or figure(fault["times"]) < 1:
            raise ValueError(f"a fault of charge {record['id']!s:.40} is damaged")
    for rule in record["rules"]:
        if not isinstance(rule["id"], str):
            raise ValueError(f"a rule of charge {record['id']!s:.40} is damaged")
    return _Charge(record, measuring.from_fields(record), from_fields(record["end"]))


def _doubted(record: Record) -> bool:
    return any(fault["id"] in DOUBTS for fault in record["faults"])


def _rank(source: str) -> int:
    return SOURCES.index(source) if source in SOURCES else 0


def _value(charge: _Charge, name: str, part: str) -> float | None:
    spread = charge.record["values"].get(name)
    return _known(spread.get(part)) if isinstance(spread, Mapping) else None


def _known(value: Any) -> float | None:  # noqa: ANN401 - whatever the record has there
    try:
        return None if value is None else figure(value)
    except ValueError:
        return None


def _rated(newest: _Charge | None) -> float | None:
    known = _known(newest.record["policy"].get("capacity_ah")) if newest is not None else None
    return known if known is not None and LEAST_AH <= known <= MOST else None


def _rest(charge: _Charge) -> Rest | None:
    volts, amps, soc = (_value(charge, name, "begin") for name in ("pack_v", "pack_a", "soc_pct"))
    if volts is None or soc is None or amps is None or abs(amps) > NO_CURRENT_A:
        return None
    try:
        return Rest(volts, soc, from_fields(charge.record["begin"]))
    except (LookupError, ValueError):
        return None


def _faults(charges: Iterable[_Charge]) -> tuple[tuple[str, str, int], ...]:
    found: dict[tuple[str, str], int] = {}
    for one in charges:
        for fault in one.record["faults"]:
            key = (str(fault["id"]), str(fault["effect"]))
            found[key] = found.get(key, 0) + int(fault["times"])
    ordered = sorted(found.items(), key=lambda item: (-item[1], item[0]))
    return tuple((id_, effect, times) for (id_, effect), times in ordered)
