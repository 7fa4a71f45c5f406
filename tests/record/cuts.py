"""A power cut at any byte of any write of one charge: the next run makes the right record of what is on the disk."""

import tempfile
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

from orchestrator.core.persisted import Persisted
from orchestrator.model import Request, State
from orchestrator.record.lines import decoded
from orchestrator.service import rotating
from tests.record.kept import EDGE_AH, Kept, charges_in


class Writes:
    """The writes of one charge with a pause: what was on the disk before each, what it added, and the bay's state."""

    def __init__(self) -> None:
        self.all: list[tuple[bytes, bytes, Persisted, float]] = []
        with tempfile.TemporaryDirectory() as directory, ExitStack() as stack:
            self.kept = Kept(Path(directory))
            stack.enter_context(patch("orchestrator.service.bay.time", self.kept.wall))
            stack.enter_context(patch("orchestrator.service.recorder.append", self._append))
            self.kept.bench.charging()
            for request, state in ((Request.PAUSE, State.SUSPENDED), (Request.START, State.CHARGING)):
                self.kept.recorder.turn()
                self.kept.bench.ask(request)
                self.kept.bench.until(state)
            self.kept.bench.battery.values["soc_pct"] = 100.0
            self.kept.recorder.turn()
            self.kept.bench.until(State.FULL)
            self.kept.recorder.turn()
            self.kept.bench.store._ownership.give_up()

    def _append(self, path: Path, data: bytes, *, durable: bool) -> None:
        before = path.read_bytes() if path.exists() else b""
        self.all.append((before, data, self.kept.persisted(), self.kept.bench.now_s))
        rotating.append(path, data, durable=durable)


def cut(before: bytes, written: bytes, persisted: Persisted, at_s: float) -> None:
    """The power goes when so much is written; AssertionError if the next run makes a wrong record of that."""
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        (directory / "sessions").mkdir()
        (directory / "sessions" / "2026-11.jsonl").write_bytes(before + written)
        kept = Kept(directory)
        kept.bench.now_s = at_s
        known = [record for line in (before + written).splitlines() if (record := decoded(line)) is not None]
        with patch("orchestrator.service.bay.time", kept.wall):
            kept.again(persisted, 30.0, "another boot")
            for _ in range(10):
                kept.bench.step()
                kept.recorder.turn()
        kept.bench.store._ownership.give_up()
        charges, session = charges_in(directory), persisted.session
        assert len(charges) == int(bool(known) or session is not None), "a charge is lost, or there twice"
        known_ah = max((record["charger"]["ah"] for record in known), default=0.0)
        least_ah = max(known_ah, session.charged_ah if session is not None else 0.0)
        for charge in charges.values():
            assert abs(charge["charger"]["ah"] - least_ah) <= EDGE_AH, "its Ah are lost, or there twice"
            over = session is None or "end" in {record["type"] for record in known}
            assert (charge["type"] == "end") is over, "whether it goes on is wrong"


def cuts(stride: int) -> int:
    """A power cut at every so many bytes of every write of a charge; how many there were."""
    count = 0
    for number, (before, data, persisted, at_s) in enumerate(Writes().all):
        for size in sorted({*range(0, len(data), stride), len(data) - 1, len(data)}):
            try:
                cut(before, data[:size], persisted, at_s)
            except AssertionError as error:
                raise AssertionError(f"write {number}, cut after {size} of {len(data)} bytes: {error}") from error
            count += 1
    return count
