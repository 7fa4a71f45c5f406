"""The cost of the journal: of the control loop's time, of the writer's, on the disk, and to replay.

python -m benchmarks.journal DIRECTORY     a journal: `python -m tests.proof.journal_size 16 300 DIRECTORY` makes one
"""

import json
import resource
import sys
import time
import zlib
from collections.abc import Sequence
from pathlib import Path

from orchestrator.core.memory import Memory
from orchestrator.model import State
from orchestrator.service.records import SnapshotRecorder, TimedLine
from orchestrator.workbench.replay.again import Repeater
from orchestrator.workbench.replay.recording import Recorded, Recording

#: Decisions of one bay that are recorded again, and how often.
STEPS, RUNS = 2000, 9


def recorded_again(steps: Sequence[Recorded]) -> tuple[float, list[TimedLine]]:
    """Seconds that the control loop spends on each decision's record, and the lines."""
    rules = next(step.rules for step in steps if step.rules is not None)
    recorder, memory, lines = SnapshotRecorder(rules.bay), Memory(), list[TimedLine]()
    began_s = time.process_time()
    for step in steps:
        lines += recorder.lines(step.at_s, step.snapshot, memory, State.CHARGING, news=False)
    return (time.process_time() - began_s) / len(steps), lines


def written(lines: Sequence[TimedLine]) -> tuple[float, int]:
    """Seconds that the writer spends on these lines, and their compressed size."""
    began_s = time.process_time()
    texts = [json.dumps(line[1]() if callable(line[1]) else line[1], separators=(",", ":")) for _, line in lines]
    size = len(zlib.compress("\n".join(texts).encode()))
    return time.process_time() - began_s, size


def main(arguments: Sequence[str]) -> int:
    """Measure and report."""
    began_s, repeaters, kept, count = time.process_time(), dict[str, Repeater](), list[Recorded](), 0
    for step in Recording([Path(arguments[0])]):
        repeaters.setdefault(step.bay, Repeater()).take(step)
        count += 1
        if step.bay == min(repeaters) and len(kept) < STEPS:
            kept.append(step)
    replay_s = (time.process_time() - began_s) / count
    most_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
    runs = [recorded_again(kept) for _ in range(RUNS)]
    costs = [written(lines) for _, lines in runs]
    print(f"control loop: {min(loop_s for loop_s, _ in runs) * 1e6:.1f} µs for each decision")
    print(f"writer: {min(cost_s for cost_s, _ in costs) / len(kept) * 1e6:.1f} µs for each decision")
    print(f"on the disk: {costs[0][1] / len(kept):.1f} bytes for each decision, complete snapshots among them")
    print(f"replay: {replay_s * 1e6:.0f} µs for each of {count:,} decisions, {most_mb:.0f} MB of memory")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
