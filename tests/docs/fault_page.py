"""docs/faults.md from the fault table: `python -m tests.docs.fault_page > docs/faults.md`."""

import sys
from collections.abc import Iterator

from orchestrator.core.faults import FAULTS, Clear, Row
from orchestrator.core.latches import BACKOFF_S, CLEAN_S
from orchestrator.model import Effect

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

"""
BACKOFFS = ", ".join(f"{CLEAN_S + wait_s:g}" for wait_s in BACKOFF_S)
ENDS = {
    Clear.BACKOFF: f"by itself, {BACKOFFS} s after it has gone (first, second, third time in an hour), then by `reset`",
    Clear.OPERATOR: "by `start`, once it has gone",
    Clear.RESET: "by `reset`, once it has gone, and then `start`",
}


def page() -> str:
    """The whole page."""
    return HEAD + "\n".join(_table()) + "\n"


def _table() -> Iterator[str]:
    yield "| fault | effect | what to do | how it ends |"
    yield "| --- | --- | --- | --- |"
    for row in sorted(FAULTS, key=lambda row: (-row.effect, row.id)):
        yield f"| `{row.id}` | {Effect(row.effect).name} | {row.advice} | {_end(row)} |"


def _end(row: Row) -> str:
    if row.clear is Clear.AUTO:
        return f"by itself, {row.clean_s:g} s after it has gone"
    gone = f" for {row.clean_s:g} s" if row.clean_s else ""
    departs = "; also when the battery has left" if row.departs else ""
    return ENDS[row.clear].replace("has gone,", f"has gone{gone},") + departs


if __name__ == "__main__":
    sys.stdout.write(page())
