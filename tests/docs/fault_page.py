"""docs/faults.md from the fault table: `python -m tests.docs.fault_page > docs/faults.md`."""

import sys
from collections.abc import Iterator

from orchestrator.core.faults import FAULTS, RANK, Clear, Row
from orchestrator.core.latches import BACKOFF_S, CLEAN_S
from orchestrator.model import Effect
from orchestrator.text.catalogue import advise
from tests.docs.catalogue import CATALOGUE

HEAD = """\
# Why did it stop?

Every fault that the service knows, as `status`, log and journal name it. The sentence there has the evidence: what was
seen, the limit, and the line of the file that sets it. This page is made from the fault table itself.

| effect | what happens |
| --- | --- |
| WARN | it is said, nothing else |
| LIMIT | charging goes on, on the lowest current step |
| NO_START | a charge that runs goes on, none begins |
| PAUSE | charging stops, and goes on by itself |
| STOP | charging stops; how it goes on, says the last column |
| TRIP | charging stops, and the bay stays stopped until a person resets and then starts it |

What `status` says of a fault is in the tense that is true. While it is there: the evidence as it is now, since when, and
its figure then and at its worst. Once it is gone: what it was, when, and the same quantity now. It ends with what comes
next, which is also what a refused `start` or `reset` is answered: a command to type, a time, or what must happen first.

| | what `status` says |
| --- | --- |
| there | the pack has 46.1 °C, the limit is 45 °C (policy.yaml:12); it charges again below 40 °C; 45.3 °C at 21:02:14; let it cool down; goes on by itself 10 s after it is gone |
| gone | at 21:02:14, the pack had 45.3 °C, the limit is 45 °C (policy.yaml:12); it charges again below 40 °C; up to 46.8 °C, 39.8 °C now; gone since 21:09:40, goes on by itself in 8 s |
| there, latched | inspect the pack, then reset – the BMU reports high temperature (status word 0x0010); since 21:02:14; reset is refused while it lasts |
| gone, latched | inspect the pack, then reset – at 21:02:14, the BMU reported high temperature (status word 0x0010); gone since 21:09:40: orchestrator reset bay-1, then orchestrator start bay-1 |
| reset too often | … reset is locked until 22:05, because it was reset 3 times within an hour and came again |
| counts for a time | the SOC went from 50 to 57 % in 1 s; the BMU has 10.00 Ah and 100.0 Wh available …; since 21:02:14; have the BMU calibrated, then start; start is refused until 21:18: what was seen counts for so long |

Of several faults the one with the worst effect is told first, and of those with the same effect the most dangerous one,
however old it is. The table below is in this order.

No fault waits for its condition to last without a break: the time that it was seen for drains at a quarter of its speed
while it is away. And no word counts alone where a second witness can be heard: what the charger says and what the BMU
says are held against each other in every state, and the sentence names the one that is likelier wrong.

"""
NUMBERS = """
## By the numbers of the catalogue

The faults that this service must handle: C of the charger, B of battery and bus, G of the gateway, P of policies and
people. The code refers to them as FAULTS C1. A row is named where one sees the fault; the last column says what else is
done, or where it is handled.

"""
STUCK = """
## A temperature sensor that is stuck

One that says what cannot be (a value at or beyond its ends, a jump of 5 K in a second, nothing) stops every charge. One
that goes on saying a plausible temperature is not found, because no rule would tell it from a good one:

- A pack in a hall that keeps its temperature, charged gently, need not warm by the sensor's 0.1 °C for hours.
- More current does not change that for sure. The loss in the cells' resistance warms them, but the reaction itself
  takes up heat in part of the charge, of the same size at moderate currents: the two may cancel for an hour.
- What the pack's resistance and heat capacity are, from which a rise could be expected, nobody tells us.

A rule that stops good charges is switched off by the people who have to live with it. What is left: the BMU's own
high-temperature bit, its own protection below all of this, and current steps that suit the pack. A BMU of which *every*
word stands still while a charge goes in is found (`bmu_frozen`).
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
    for row in sorted(FAULTS, key=lambda row: (-row.effect, RANK[row.id])):
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
    departs = "; also when the battery has left" if row.departs else ""
    counts = "; until when it counts, `status` says" if row.until else ""
    return ENDS[row.clear].replace("has gone,", f"has gone{gone},") + departs + counts


if __name__ == "__main__":
    sys.stdout.write(page())
