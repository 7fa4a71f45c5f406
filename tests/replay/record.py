"""Journals for replay: the demo's, in real time, and those of some campaign fault scripts, in virtual time.

    python -m tests.replay.record              all of them again
    python -m tests.replay.record scripts      only those in virtual time

They are references: record them again only where a decision was changed on purpose, and check the replay's output first
(`orchestrator replay tests/replay/journals/…`). A bug found in the field becomes another of them. Those in `version-4`
were recorded by an older version, whose journals stay readable: nobody can record them again.
"""

import gzip
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from orchestrator.demo.stage import Stage
from orchestrator.service.journal import _line
from orchestrator.service.journal_files import files_of, lines_of
from orchestrator.service.records import SnapshotRecorder
from orchestrator.workbench.replay.recording import read
from tests.proof.play import Player, stage
from tests.proof.report import say
from tests.proof.script import Script
from tests.waiting import wait_until

JOURNALS = Path(__file__).parent / "journals"
#: Fault scripts that together cover every state and most faults, several bays, automatic and manual chargers.
SEEDS = (14, 20, 21, 22, 27, 41, 46, 79, 102, 105)
#: The real time at which virtual time starts.
BEGAN_S = 1_767_225_600.0
DEMO_S = 150.0


def script(seed: int) -> bytes:
    """The journal of a campaign script."""
    lines: list[bytes] = []
    the_script = Script.of_seed(seed)
    with stage(the_script) as made:
        player = Player(the_script, made)

        def put(bay: str, line: Any, t_s: float | None = None) -> None:
            about_s = made.time.now_s if t_s is None else t_s
            lines.append(_line((about_s, BEGAN_S + about_s, bay, line)))

        made.journal.put = put  # type: ignore[method-assign]  # what it is given is written down
        for runner in made.bays:
            runner._journal._recorder = SnapshotRecorder(runner.policy.rules.bay)
        player.run()
    return b"".join(lines)


def demo() -> bytes:
    """The journal of the demo's whole charge."""
    with Stage() as made:
        wait_until(lambda: (made.bay() or {}).get("state") == "FULL", DEMO_S, "the demo's battery is full", 0.5)
        made.end()
        return b"".join(
            (text or b"") + b"\n"
            for path in files_of([made.directory / "run" / "journal"])
            for _, text in lines_of(path)
        )


def write(name: str, journal: bytes) -> None:
    """Gzipped without a timestamp, so the same journal gives the same file."""
    path = JOURNALS / f"{name}.jsonl.gz"
    path.write_bytes(gzip.compress(journal, mtime=0))
    say(f"{path.name}: {sum(map(len, read([path]).bays.values()))} steps, {path.stat().st_size / 1000:.0f} kB")


def main(arguments: Sequence[str]) -> int:
    """Record; returns the exit status."""
    JOURNALS.mkdir(exist_ok=True)
    names: Iterable[str] = arguments or ("demo", "scripts")
    if "demo" in names:
        write("demo", demo())
    if "scripts" in names:
        for seed in SEEDS:
            write(f"script-{seed}", script(seed))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
