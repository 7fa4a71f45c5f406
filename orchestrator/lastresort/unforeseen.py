"""What the controller says about an error that nothing in it handles. Imported before everything else."""

import sys
from types import TracebackType

ADVICE = (
    "its guardian stops the chargers; if memory or threads ran out, raise MemoryMax= and TasksMax= of the unit, or "
)
ADVICE += "ulimit -v and -u, else report this"


def say_unforeseen(_kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Say what has gone wrong, where, and what to do; in English, since no other text may be loaded yet."""
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = f" in {trace.tb_frame.f_code.co_filename}, line {trace.tb_lineno}" if trace else ""
    print(f"orchestrator: the service cannot go on: {error!r}{where}: {ADVICE}", file=sys.stderr)  # noqa: T201
