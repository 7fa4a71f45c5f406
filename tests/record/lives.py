"""Lives of a recorded bay: kills, power cuts at any byte, clock steps and restarts, against the charger's own current.

    python -m tests.record.lives 2000        also power cuts at every byte of every write of a charge (`cuts.py`)

The record is right if no charge is in it twice, none is lost, ids are in the order of the charges, and the sum of their
Ah is the integral of the charger's current: but for what no disk had when a run ended, which is worked out here. An
index that was brought up to date after each run has just these charges, and is the same as a new one.
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from itertools import takewhile
from pathlib import Path
from random import Random
from sqlite3 import Connection
from typing import Any
from unittest.mock import patch

from orchestrator.core.persisted import COUNTERS_S, Persisted
from orchestrator.model import Operation, Request
from orchestrator.record import index
from orchestrator.record.months import FOLDER
from orchestrator.service import rotating
from tests.record.cuts import cuts
from tests.record.kept import EDGE_AH, Kept, charges_in
from tests.service.bench import STEP_S

#: Runs of the service in a life, and how far a clock steps.
RUNS = 5
WEEK_S, YEAR_S = 7 * 86_400.0, 365 * 86_400.0
STEPS_S = (WEEK_S, -WEEK_S, YEAR_S, -60 * YEAR_S, 30.0, -30.0)


class PowerCutError(BaseException):
    """No `except Exception` sees the power go."""


class Life:
    """One station from its first charge on."""

    def __init__(self, seed: int, directory: Path) -> None:
        self.dice, self.kept, self.had = Random(seed), Kept(directory), Counter[str]()
        self.true_ah = 0.0  # what the charger has delivered
        self.lost_ah = 0.0  # … of it, what no disk had when a run ended
        self.budget: int | None = None  # bytes until the power goes
        self.history: list[tuple[float, Persisted, float]] = []  # (true Ah, state, when) of this run's decisions
        self.recorded_ah = 0.0  # true Ah at the newest record on the disk
        self.runs = 0
        self.ids: list[str] = []  # in the order in which their charges began
        self.index: Connection | None = None  # brought up to date whenever a run has ended

    def run(self) -> None:
        with ExitStack() as stack:
            for name, fake in (
                ("orchestrator.service.bay.time", self.kept.wall),
                ("orchestrator.service.recorder.append", self._append),
                ("orchestrator.record.charge.CHECKPOINT_S", 8.0),
            ):
                stack.enter_context(patch(name, fake))
            self._steps(1)
            for _ in range(self.dice.randint(1, RUNS)):
                self._one_run()
                self._dies()
            self._one_run()
            self.kept.recorder.turn()
        self.judge()

    # --- what happens -------------------------------------------------------------------------------------------------

    def _one_run(self) -> None:
        for _ in range(self.dice.randint(1, 4)):
            what = self.dice.choice(("start", "start", "stop", "pause", "full", "clock", "nothing"))
            self.had[what] += 1
            if what == "clock":
                self.kept.off_s += self.dice.choice(STEPS_S)
            elif what == "full":
                self.kept.bench.battery.values["soc_pct"] = 100.0
            elif what != "nothing":
                self.kept.bench.battery.values["soc_pct"] = 50.0
                self._steps(1, Request(what))
            self._steps(self.dice.randint(0, 100))
        self.kept.bench.battery.values["soc_pct"] = 50.0

    def _steps(self, count: int, request: Request | None = None) -> None:
        for _ in range(count):
            self._step(request)
            self.kept.recorder.turn()
            self.recorded_ah = self.true_ah if self._wrote else self.recorded_ah

    def _step(self, request: Request | None = None) -> None:
        bench, self._wrote = self.kept.bench, False
        if request is not None:
            bench.ask(request)
        else:
            bench.step()
        if bench.charger.reading.operation is Operation.RUNNING:
            self.true_ah += bench.charger.reading.current_a * STEP_S / 3600
        newest = self.kept.recorder._last_id
        if newest and newest not in self.ids:
            self.ids.append(newest)
        self.history.append((self.true_ah, self.kept.persisted(), bench.now_s))

    # --- how it ends --------------------------------------------------------------------------------------------------

    def _dies(self) -> None:
        self._follow_index()
        how = self.dice.choice(("killed", "power", "power at a write", "in order"))
        self.had[how] += 1
        if how == "power at a write":
            for _ in range(150):
                self._step()
                if self.kept.recorder._waiting:
                    break
            self._cut()
        elif how == "in order":
            self.kept.bench.bay.isolate()
            self.kept.recorder.turn()
            self.recorded_ah = self.true_ah
        persisted_ah, persisted = self._on_disk(orderly=how == "in order")
        self.lost_ah += self.true_ah - max(persisted_ah, self.recorded_ah) if persisted.session else 0.0
        self.lost_ah += self.true_ah - self.recorded_ah if persisted.session is None else 0.0
        self._again(persisted, how)

    def _cut(self) -> None:
        """The power goes while records are written, at any byte."""
        self.budget = self.dice.choice((0, self.dice.randrange(4000)))
        try:
            self.kept.recorder.turn()
        except PowerCutError:
            self.had["torn"] += 1
        self.recorded_ah = self.true_ah if self._wrote else self.recorded_ah
        self.budget = None

    def _on_disk(self, *, orderly: bool) -> tuple[float, Persisted]:
        """What the store had on the disk: its last change that matters, or counters up to 30 s old."""
        newest = self.history[-1]
        back = 0 if orderly else self.dice.randint(0, int(COUNTERS_S / STEP_S))
        since = self.history[-back - 1 :]
        same = list(takewhile(lambda one: one[1].gist == newest[1].gist, reversed(since)))
        true_ah, persisted, at_s = same[-1]
        return true_ah, persisted.aged(self.kept.bench.now_s - at_s)

    def _again(self, persisted: Persisted, how: str) -> None:
        self.runs += 1
        reading = self.kept.bench.charger.reading
        boot = f"boot-{self.runs + 1}" if "power" in how else ""
        if how != "killed" or self.dice.random() < 0.5:
            self.kept.off_s += self.dice.choice((0.0, 0.0, *STEPS_S))
        off = {"operation": Operation.STOPPED, "current_a": 0.0}  # by the guardian
        self.kept.bench.charger.reading = type(reading)(**{**_fields(reading), **off})
        self.kept.again(persisted, self.dice.uniform(1.0, 600.0), boot)
        self.history = []
        self._steps(1)

    def _append(self, path: Path, data: bytes, *, durable: bool) -> None:
        if self.budget is not None and self.budget < len(data):
            rotating.append(path, data[: self.budget], durable=True)
            raise PowerCutError
        rotating.append(path, data, durable=durable)
        self._wrote = True

    def _follow_index(self) -> None:
        folder = self.kept.directory / FOLDER
        if self.index is not None:
            self.index = index._current(self.index, folder)
        elif folder.is_dir():
            self.index = index._built(":memory:", folder)

    # --- what must hold -----------------------------------------------------------------------------------------------

    def judge(self) -> None:
        charges = charges_in(self.kept.directory)
        assert [id_ for id_ in self.ids if id_ in charges] == sorted(charges), "the ids are not in the charges' order"
        left_open = [id_ for id_, charge in charges.items() if charge["type"] != "end"]
        assert len(left_open) <= 1, f"{len(left_open)} charges are open in one bay"
        state = self.kept.bench.bay.decision
        assert state is not None
        assert bool(left_open) <= (state.session is not None), "a charge is open that the core does not have"
        sum_ah = sum(charge["charger"]["ah"] for charge in charges.values())
        edges_ah = EDGE_AH * (self.runs + 1)
        now_ah = self.true_ah - self.recorded_ah  # since the newest record
        least_ah = self.true_ah - self.lost_ah - now_ah - edges_ah
        assert least_ah <= sum_ah <= self.true_ah + edges_ah, (
            f"{sum_ah:.4f} Ah are recorded of {self.true_ah:.4f}, of which {self.lost_ah:.4f} could not be known"
        )
        for charge in charges.values():
            shares_ah = sum(rule["ah"] for rule in charge["rules"])
            assert abs(shares_ah - charge["charger"]["ah"]) < 1e-4, "the rules' Ah are not the charge's"
        self._judge_index({id_: charge["charger"]["ah"] for id_, charge in charges.items()})

    def _judge_index(self, amounts: Mapping[str, float]) -> None:
        self._follow_index()
        if self.index is None:
            assert not amounts, "there is no index"
            return
        assert dict(self.index.execute("SELECT id, charger_ah FROM charges")) == amounts, "the index has other charges"
        new = index._built(":memory:", self.kept.directory / FOLDER)
        assert list(self.index.iterdump()) == list(new.iterdump()), "a new index is another one"


def _fields(reading: object) -> dict[str, Any]:
    return {name: getattr(reading, name) for name in type(reading).__slots__}  # type: ignore[attr-defined]


def live(seed: int) -> Counter[str]:
    """One life; AssertionError if its record is wrong."""
    with tempfile.TemporaryDirectory() as directory:
        life = Life(seed, Path(directory))
        try:
            life.run()
        except AssertionError as error:
            raise AssertionError(f"life {seed}: {error}") from error
        finally:
            life.kept.bench.store._ownership.give_up()
        life.had["charges"] += len(charges_in(Path(directory)))
        return life.had


def main(count: int) -> int:
    had, wrong = Counter[str](), 0
    for seed in range(count):
        try:
            had += live(seed)
        except AssertionError as error:
            wrong += 1
            print(error, flush=True)
    print(f"{count} lives, {wrong} wrong: {', '.join(f'{what} {times}' for what, times in sorted(had.items()))}")
    print(f"{cuts(1)} power cuts, one at each byte of each write of a charge: all well")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000))
