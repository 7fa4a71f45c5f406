"""docs/faults.md from the fault table: `python -m tests.docs.fault_page > docs/faults.md`."""

import sys
from collections.abc import Iterator

from orchestrator.core.faults import FAULTS, Clear, Row
from orchestrator.core.latches import BACKOFF_S, CLEAN_S
from orchestrator.model import Effect
from orchestrator.text.catalogue import advise
from tests.docs.catalogue import CATALOGUE

HEAD = """\
# Why did it stop?

Every fault that the service knows, as named in `status`, log and journal. The sentence there gives the evidence: what
was seen, the limit, and the line of the file that sets it. This page is generated from the fault table.

| effect | what happens |
| --- | --- |
| WARN | it is reported, nothing else |
| LIMIT | charging continues, on the lowest current step |
| NO_START | a running charge continues, none begins |
| PAUSE | charging stops, and resumes by itself |
| STOP | charging stops; the last column says how it resumes |
| TRIP | charging stops, and the bay stays stopped until a person resets and then starts it |

No fault requires its condition to last without interruption: while the condition is absent, its accumulated time
drains at a quarter of the speed. And no reading counts alone if a second witness can be heard: the charger's readings
are checked against the BMU's in every state, and the sentence names the device more likely to be wrong.

"""
NUMBERS = """
## By the numbers of the catalogue

The faults that this service must handle: C for the charger, B for battery and bus, G for the gateway, P for policies
and people. The code refers to them as FAULTS C1. The rows are the faults that report it; the last column says what
else is done, or where it is handled.

"""
STUCK = """
## A stuck temperature sensor

A sensor with an implausible reading (a value at or beyond its range, a jump of 5 K in a second, no value) stops every
charge. A sensor that keeps reporting a plausible temperature is not detected, because no rule can tell it from a
good one:

- A gently charged pack in a hall at constant temperature need not warm by the sensor's 0.1 °C for hours.
- More current does not reliably change that. The loss in the cells' resistance warms them, but during part of the
  charge the reaction itself absorbs about as much heat at moderate currents: the two may cancel for an hour.
- The pack's resistance and heat capacity, from which to predict a rise, are unknown.

People switch off a rule that stops good charges. What remains: the BMU's own high-temperature bit, its own protection
below all of this, and current steps that suit the pack. A BMU whose words *all* stand still while a charge flows in is
detected (`bmu_frozen`).
"""
BACKOFFS = ", ".join(f"{CLEAN_S + wait_s:g}" for wait_s in BACKOFF_S)
ENDS = {
    Clear.BACKOFF: f"by itself, {BACKOFFS} s after it has gone (first, second, third time in an hour), then by `reset`",
    Clear.OPERATOR: "by `start`, once it has gone",
    Clear.RESET: "by `reset`, once it has gone, and then `start`",
}


def page() -> str:
    """The whole page."""
    return HEAD + "\n".join(_table()) + "\n" + NUMBERS + "\n".join(_numbers()) + "\n" + STUCK


def _table() -> Iterator[str]:
    yield "| fault | effect | what to do | how it ends |"
    yield "| --- | --- | --- | --- |"
    for row in sorted(FAULTS, key=lambda row: (-row.effect, row.id)):
        yield f"| `{row.id}` | {Effect(row.effect).name} | {_advice(row)} | {_end(row)} |"


def _numbers() -> Iterator[str]:
    yield "| number | fault | rows | what else |"
    yield "| --- | --- | --- | --- |"
    for entry in CATALOGUE:
        rows = ", ".join(f"`{row.id}`" for row in rows_of(entry.number))
        yield f"| {entry.number} | {entry.about} | {rows or '–'} | {entry.also} |"


def rows_of(number: str) -> list[Row]:
    """The rows that name this number of the catalogue."""
    return [row for row in FAULTS if number in row.source.split(", ")]


def _advice(row: Row) -> str:
    do = advise(row.id)
    return f"{do}; once it has stopped: {advise(row.at_rest)}" if row.at_rest else do


def _end(row: Row) -> str:
    if row.clear is Clear.AUTO:
        return f"by itself, {row.clean_s:g} s after it has gone"
    gone = f" for {row.clean_s:g} s" if row.clean_s else ""
    departs = "; also when the battery is removed" if row.departs else ""
    return ENDS[row.clear].replace("has gone,", f"has gone{gone},") + departs


if __name__ == "__main__":
    sys.stdout.write(page())
