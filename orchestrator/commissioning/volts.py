"""Holds the volts that each charger reads against those of the BMUs: swapped cables show another bay's. Pure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

#: Below this a charger has no battery at its terminals; a contactor between them may be open.
TERMINAL_V = 5.0


@dataclass(frozen=True, slots=True)
class Volts:
    """What one bay's devices read; None where they did not answer, or said nothing plausible."""

    bay: str
    charger_v: float | None
    bmu_v: float | None
    differ_v: float  #: how much the two may differ, by the bay's policy

    @property
    def known(self) -> bool:
        """Whether there are two values to compare."""
        return self.bmu_v is not None and self.charger_v is not None and self.charger_v >= TERMINAL_V

    def sees(self, other: "Volts") -> bool:
        """Whether this charger reads the volts of the other bay's battery."""
        if self.charger_v is None or other.bmu_v is None:
            return False
        return abs(self.charger_v - other.bmu_v) <= self.differ_v

    @property
    def agree(self) -> bool:
        """Whether its own two do."""
        return self.sees(self)


def compared(found: Sequence[Volts]) -> Iterator[str]:
    """A line for each bay, then what may be swapped, and where that could not be seen."""
    for one in found:
        yield f"{one.bay}: charger {_v(one.charger_v)}, BMU {_v(one.bmu_v)}: {_verdict(one)}"
    yield from swapped(found)
    alike = [one for one in found if one.known and one.agree]
    for one, other in combinations(alike, 2):
        if one.sees(other) and other.sees(one):
            yield (
                f"{one.bay} and {other.bay} have batteries of the same volts: cables swapped between them would not "
                "show here"
            )


def swapped(found: Sequence[Volts]) -> Iterator[str]:
    """Chargers that read another bay's battery instead of their own."""
    wrong = [one for one in found if one.known and not one.agree]
    told: set[str] = set()
    for one in wrong:
        for other in found:
            if other is one or one.bay in told or not one.sees(other):
                continue
            if other in wrong and other.sees(one):
                told |= {one.bay, other.bay}
                yield (
                    f"swapped? {one.bay} and {other.bay}: each charger reads the volts of the other's battery: "
                    "exchange their serial ports, or their node ids, in the station file or at the cables"
                )
            else:
                told.add(one.bay)
                yield (
                    f"swapped? {one.bay}'s charger reads the volts of {other.bay}'s battery: see which cables go where"
                )


def _verdict(one: Volts) -> str:
    if not one.known or one.charger_v is None or one.bmu_v is None:
        low = one.charger_v is not None and one.charger_v < TERMINAL_V
        return "the charger sees no battery; is a contactor open?" if low else "nothing to compare"
    if one.agree:
        return "they agree"
    return f"they differ by {abs(one.charger_v - one.bmu_v):.1f} V, at most {one.differ_v:.1f} V is right"


def _v(volts: float | None) -> str:
    return f"{volts:.1f} V" if volts is not None else "–"
