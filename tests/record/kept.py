"""A bay of the bench whose charges are recorded, over runs of the service; time is simulated."""

import gzip
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.core.persisted import Persisted
from orchestrator.model import Cause
from orchestrator.record.lines import decoded
from orchestrator.service.recorder import Recorder
from tests.service.bench import STEP_S, Bench

#: 2026-11-28T06:00:00Z, at the monotonic moment 0.
WALL_S = 1_795_845_600.0
#: The first reading of a run, and the one under way when it ends, are not counted: at 14 A each.
EDGE_AH = 2 * STEP_S * 14.0 / 3600


class Kept:
    """One station over its runs; `off_s` is how far the wall clock has been stepped."""

    def __init__(self, directory: Path) -> None:
        self.directory, self.off_s, self.boot = directory, 0.0, "boot-1"
        self.said: list[Cause] = []
        self.recorder, self.bench = self._begin(None, 1000.0)

    def _begin(self, persisted: Persisted | None, now_s: float) -> tuple[Recorder, Bench]:
        recorder = Recorder(self.directory, 5.0, self.wall, self.said.append, boot=self.boot, curves_days=365.0)
        self.bench = Bench(self.directory, persisted, now_s=now_s, wall=self.wall, recorder=recorder)
        recorder.turn()
        return recorder, self.bench

    def wall(self) -> float:
        return WALL_S + self.bench.now_s + self.off_s

    def persisted(self) -> Persisted:
        assert self.bench.bay._memory is not None
        return Persisted.of(self.bench.bay._memory, self.bench.now_s)

    def again(self, persisted: Persisted, down_s: float = 5.0, boot: str = "") -> None:
        """The next run of the service, with this state from the last one; nothing else of it is left."""
        charger = self.bench.charger.reading
        self.bench.store._ownership.give_up()  # as when its process ends
        now_s, boot = (50.0, boot) if boot else (self.bench.now_s + down_s, self.boot)
        self.off_s += 0.0 if boot == self.boot else self.bench.now_s + down_s - now_s
        self.boot = boot
        self.recorder, _ = self._begin(persisted.aged(down_s), now_s)
        self.bench.charger.reading = charger

    def records(self) -> list[dict[str, Any]]:
        """All that is on the disk."""
        self.recorder.turn()
        return [json.loads(line) for line in lines_in(self.directory)]


def lines_in(directory: Path) -> list[bytes]:
    """Every line of every file, in the order of the months."""
    paths = sorted((directory / "sessions").glob("*.jsonl*"))
    files = [gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes() for path in paths]
    return [line for data in files for line in data.splitlines()]


def charges_in(directory: Path) -> Mapping[str, Any]:
    """All that is known of each charge, by id; AssertionError if a record is there twice, or missing."""
    found: dict[str, dict[str, Any]] = {}
    seen: set[tuple[str, int]] = set()
    for line in lines_in(directory):
        record = decoded(line)
        if record is None:
            continue
        key = (record["id"], record["n"])
        assert key not in seen, f"record {key} is there twice"
        seen.add(key)
        now = found.get(record["id"])
        if now is None or record["n"] > now["n"]:
            found[record["id"]] = {**(now or {}), **record}
    for id_ in found:
        numbers = sorted(number for one, number in seen if one == id_)
        assert numbers == list(range(len(numbers))), f"records of {id_} are missing: {numbers}"
    return found
