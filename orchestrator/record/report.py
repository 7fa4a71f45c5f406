"""The charges of a month: energy, how they ended, how long full took, and which batteries need a look. Pure.

A charge belongs to the month in which it began, by the clock of its station.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from orchestrator.model import Cause
from orchestrator.record.lasting import lasting
from orchestrator.record.lines import FULL, Record
from orchestrator.record.sections import Row, Section, heads
from orchestrator.record.stamp import from_fields
from orchestrator.record.table import DASH, began, why_ended
from orchestrator.record.utc import unix_s
from orchestrator.text.catalogue import fields, say

#: Faults of these effects are of account, …
GRAVE = frozenset({"STOP", "TRIP"})
#: … a pack below this is commonly called worn out, …
LEAST_SOH_PCT = 80.0
#: … and two witnesses of a month's Ah differ by less, where there are enough to compare.
MOST_APART, ENOUGH_AH = 0.10, 5.0
MONTH = re.compile(r"[12]\d{3}-(0[1-9]|1[0-2])")
#: No local time is further from UTC.
DAY_S = 86_400.0

Warnings = Mapping[str, Sequence[Cause]]  #: of each battery


@dataclass(slots=True)
class Sum:
    """What some charges come to."""

    charges: int = 0
    full_s: list[float] = field(default_factory=list)  #: how long those took that became full
    ah: float = 0.0
    wh: float = 0.0
    bmu_ah: float = 0.0

    def add(self, charge: Record) -> None:
        """One more."""
        self.charges += 1
        self.ah, self.wh = self.ah + charge["charger"]["ah"], self.wh + charge["charger"]["wh"]
        self.bmu_ah += charge["bmu"]["ah"]
        if cause_of(charge) == FULL:
            self.full_s.append(charge["lasted_s"])

    @property
    def mean_s(self) -> float | None:
        """How long those took on average that became full."""
        return sum(self.full_s) / len(self.full_s) if self.full_s else None

    def as_fields(self) -> dict[str, object]:
        """As JSON has it."""
        return {
            "charges": self.charges,
            "full": len(self.full_s),
            "ah": round(self.ah, 4),
            "wh": round(self.wh, 2),
            "mean_full_s": None if self.mean_s is None else round(self.mean_s, 1),
        }

    def cells(self, language: str) -> Row:
        """As a table has it."""
        mean = say(lasting(self.mean_s), language) if self.mean_s is not None else DASH
        return str(self.charges), str(len(self.full_s)), f"{self.ah:.1f}", f"{self.wh / 1000:.2f}", mean


def span_s(month: str) -> tuple[float, float]:
    """From when to when, in Unix time, charges of a month began, wherever on earth."""
    year, number = int(month[:4]), int(month[5:])
    after = f"{year + number // 12}-{number % 12 + 1:02}"
    return unix_s(f"{month}-01T00:00Z") - DAY_S, unix_s(f"{after}-01T00:00Z") + DAY_S


def is_of(charge: Record, month: str) -> bool:
    """Whether it began in this month."""
    return began(charge).startswith(month)


def cause_of(charge: Record) -> str:
    """The id of why it ended; of an open one `charge_open`."""
    return str((charge["result"] or {"id": "charge_open"})["id"])


def sums(charges: Iterable[Record]) -> tuple[dict[str, Sum], Sum]:
    """What each bay's charges come to, and all of them."""
    total, bays = Sum(), defaultdict[str, Sum](Sum)
    for charge in charges:
        total.add(charge)
        bays[charge["bay"]].add(charge)
    return bays, total


def report(month: str, charges: Iterable[Record], warnings: Warnings, language: str) -> list[Section]:
    """Of the charges of a month, the newest first; `warnings` are of the health of their batteries."""
    all_ = list(charges)
    bays, total = sums(all_)
    rows = [(bay, *of.cells(language)) for bay, of in sorted(bays.items())]
    everything = (say(Cause("report_total"), language), *total.cells(language))
    stations = tuple(sorted({charge["station"] for charge in all_}))
    title = Cause.of("report_of", month=month, stations=stations, zones=tuple(zones(all_)))
    table = (heads("report_head", language), *rows, everything)
    return [
        Section(say(title, language), table, has_head=True),
        Section(say(Cause("report_ends"), language), _ends(all_, language), has_head=True),
        Section(say(Cause("report_look"), language), list(_looks(all_, warnings, language))),
    ]


def zones(charges: Iterable[Record]) -> list[str]:
    """The local time in which charges began: "UTC+09:00"; two where the clocks changed."""
    offsets = sorted({from_fields(charge["begin"]).offset_min for charge in charges})
    return [f"UTC{'-' if one < 0 else '+'}{abs(one) // 60:02}:{abs(one) % 60:02}" for one in offsets]


def _ends(charges: Sequence[Record], language: str) -> list[Row]:
    counts = Counter(map(cause_of, charges))
    newest = {cause_of(charge): charge for charge in reversed(charges)}
    rows = [
        (str(count), id_, newest[id_]["bay"], began(newest[id_])[:16], why_ended(newest[id_], language))
        for id_, count in sorted(counts.items(), key=lambda one: (-one[1], one[0]))
    ]
    return [heads("report_ends_head", language), *rows]


def _looks(charges: Sequence[Record], warnings: Warnings, language: str) -> Iterator[Row]:
    for battery, causes in to_look_at(charges, warnings):
        yield battery, "; ".join(say(cause, language) for cause in causes)


def to_look_at(charges: Sequence[Record], warnings: Warnings) -> Iterator[tuple[str, list[Cause]]]:
    """The batteries that need a look, and why."""
    of = defaultdict[str, list[Record]](list)
    for charge in charges:
        of[charge["battery"]["id"]].append(charge)
    for battery, mine in sorted(of.items()):
        if causes := [*looks(mine), *warnings.get(battery, ())]:
            yield battery, causes


def as_fields(month: str, charges: Sequence[Record], warnings: Warnings, language: str) -> dict[str, object]:
    """As JSON has it."""
    bays, total = sums(charges)
    newest = {cause_of(charge): charge for charge in reversed(charges)}
    return {
        "month": month,
        "stations": sorted({charge["station"] for charge in charges}),
        "bays": {bay: of.as_fields() for bay, of in sorted(bays.items())},
        "total": total.as_fields(),
        "ends": [
            {"id": id_, "charges": count, "last": newest[id_]["id"], "text": why_ended(newest[id_], language)}
            for id_, count in Counter(map(cause_of, charges)).most_common()
        ],
        "look_at": [
            {"battery": battery, "causes": [fields(cause, language) for cause in causes]}
            for battery, causes in to_look_at(charges, warnings)
        ],
    }


def looks(charges: Sequence[Record]) -> Iterator[Cause]:
    """Why a battery with these charges, the newest first, needs a look."""
    grave = faults(charges, GRAVE)
    if grave:
        yield Cause.of("look_faults", times=sum(grave.values()), faults=tuple(sorted(grave)))
    soh_pct = next((soh["end"] for charge in charges if (soh := charge["values"]["soh_pct"])), None)
    if soh_pct is not None and soh_pct < LEAST_SOH_PCT:
        yield Cause.of("look_soh", soh_pct=soh_pct, least_pct=LEAST_SOH_PCT)
    total = Sum()
    for charge in charges:
        total.add(charge)
    if total.ah >= ENOUGH_AH and abs(total.ah - total.bmu_ah) > MOST_APART * total.ah:
        yield Cause.of("look_amounts", ah=total.ah, bmu_ah=total.bmu_ah)


def faults(charges: Iterable[Record], effects: frozenset[str] | None = None) -> Mapping[str, int]:
    """How often each fault came, of these effects if any are given."""
    counts = Counter[str]()
    for charge in charges:
        for fault in charge["faults"]:
            if effects is None or fault["effect"] in effects:
                counts[fault["id"]] += int(fault["times"])
    return counts
