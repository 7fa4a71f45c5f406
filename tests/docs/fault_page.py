"""docs/faults.md from the fault table: `python -m tests.docs.fault_page > docs/faults.md`."""

import sys
from collections.abc import Iterator

from orchestrator.core.faults import FAULTS, RANK, Clear, FaultRow
from orchestrator.core.latches import BACKOFF_S, CLEAN_S
from orchestrator.model import Cause, Effect
from orchestrator.text.catalogue import advise, say
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

What `status` says of a fault is in the tense that is true. While it is there: the evidence as it is now, since when,
and its figure then and at its worst. Once it is gone: what it was, when, and the same quantity now. It ends with what
comes next, which is also what a refused `start` or `reset` is answered: a command to type, a time, or what must happen
first.

{samples}

Of several faults the one with the worst effect is told first, and of those with the same effect the most dangerous one,
however old it is. The table below is in this order.

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
HOT, WAS_HOT = (
    Cause.of("over_temperature", place="policy.yaml:12", pack_c=pack_c, limit_c=45, again_c=40)
    for pack_c in (46.1, 45.3)
)
BITS = Cause.of("status_trip", advice="status_trip", bits=("high_temperature",), status=0x10, effect="TRIP")
DOUBTS = Cause.of(
    "soc_not_believed", advice="soc_not_believed",
    whats=(
        Cause.of("soc_step", before_pct=50, soc_pct=57, passed_s=1),
        Cause.of("energy_disagrees", remaining_ah=10, available_wh=100, implied_v=10, pack_v=48),
    ),
)  # fmt: skip
GONE = Cause.of("gone", gone_at="21:09:40")
AT = {"raised_at": "21:02:14", "past": True}
SAMPLES = {
    "there": HOT.with_(
        "over_temperature", since_at="21:02:14", was=(Cause.of("figure_c", value=45.3),),
        then=Cause.of("goes_on_after", wait_s=10, strike=None),
    ),
    "gone": WAS_HOT.with_(
        "", **AT,
        worst=Cause.of("up_to", figure=Cause.of("figure_c", value=46.8)), now=(Cause.of("figure_c", value=39.8),),
        then=Cause.of("goes_on_in", gone=GONE, left_s=8, strike=None),
    ),
    "there, latched": BITS.with_("", since_at="21:02:14", then=Cause.of("refused_while", request="reset")),
    "gone, latched": BITS.with_("", **AT, then=Cause.of("reset_now", gone=GONE, bay="bay-1")),
    "reset too often": BITS.with_("", **AT, then=Cause.of("reset_locked", until_at="22:05", times=3)),
    "counts for a time": DOUBTS.with_(
        "", since_at="21:02:14", then=Cause.of("refused_until", request="start", until_at="21:18")
    ),
}  # fmt: skip
BACKOFFS = ", ".join(f"{CLEAN_S + wait_s:g}" for wait_s in BACKOFF_S)
ENDS = {
    Clear.BACKOFF: f"by itself, {BACKOFFS} s after it has gone (first, second, third time in an hour), then by `reset`",
    Clear.OPERATOR: "by `start`, once it has gone",
    Clear.RESET: "by `reset`, once it has gone, and then `start`",
}


def page() -> str:
    """The whole page."""
    return (
        HEAD.format(samples="\n".join(_samples()))
        + "\n".join(_table())
        + "\n"
        + NUMBERS
        + "\n".join(_numbers())
        + "\n"
        + STUCK
    )


def _samples() -> Iterator[str]:
    yield "| | what `status` says |"
    yield "| --- | --- |"
    yield from (f"| {stage} | {say(cause)} |" for stage, cause in SAMPLES.items())


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


def rows_of(number: str) -> list[FaultRow]:
    """The rows that name this number of the catalogue."""
    return [row for row in FAULTS if number in row.source.split(", ")]


def _advice(row: FaultRow) -> str:
    do = advise(row.id)
    return f"{do}; once it has stopped: {advise(row.at_rest)}" if row.at_rest else do


def _end(row: FaultRow) -> str:
    if row.clear is Clear.AUTO:
        return f"by itself, {row.clean_s:g} s after it has gone"
    gone = f" for {row.clean_s:g} s" if row.clean_s else ""
    departs = "; also when the battery is removed" if row.departs else ""
    counts = "; until when it counts, `status` says" if row.until else ""
    return ENDS[row.clear].replace("has gone,", f"has gone{gone},") + departs + counts


if __name__ == "__main__":
    sys.stdout.write(page())
