"""`check --exhaustive`: its findings on policies that break something, and on one that does not."""

import os
import sys
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from orchestrator.cli import main
from orchestrator.config.load import load_policy
from orchestrator.config.shipped import shipped_names
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import Request, Snapshot, State
from orchestrator.workbench import processes, verbs
from orchestrator.workbench.prove import exhaustive
from orchestrator.workbench.prove.endings import ENDINGS
from orchestrator.workbench.prove.exhaustive import bay_of, bays_in, here
from orchestrator.workbench.prove.explore import Explorer
from orchestrator.workbench.prove.inputs import StationInputs
from orchestrator.workbench.prove.lasting import reaches, settles
from orchestrator.workbench.prove.story import Move
from tests.proof.exploring import few, small, walk_on

ROOT = Path(__file__).parent
#: Policy → what it breaks, and the end of the counterexample. All three pass every rule of `check`.
BROKEN = {
    "odd/narrow": (
        "charges",
        "→ SUSPENDED: the pack has 22.0 °C, the limit is 24 °C (narrow.yaml:2); it charges again below 19 °C; 24.1 °C "
        "at t = 0.75 s; let it cool down; goes on by itself 10 s after it is gone; no command",
    ),
    "broken/volts": (
        "charges, as measured",
        "→ SUSPENDED: the charger reads 47.95 V, the BMU 47.45 V: not the same battery, or a bad connection; "
        "since t = 32.00 s; check that this BMU belongs to this charger's battery; goes on by itself 1 s after it is "
        "gone; no command",
    ),
    "broken/amps": (
        "charges, as measured",
        "→ TRIPPED: check for loads on the battery and for a wrong node id, then reset – the charger reads 0.00 A, "
        "the BMU 0.50 A; 14.00 A and 14.50 A at t = 38.75 s; reset is refused while it lasts; no command",
    ),
}  # fmt: skip


@pytest.mark.parametrize("policy", BROKEN)
def test_a_broken_policy_gets_its_story(policy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT / Path(policy).parent)
    walk = walk_on(small(Rules.of(bay_of(load_policy(f"{Path(policy).name}.yaml")))))
    explorer = Explorer(walk, here(walk))
    explorer.run(most=60)
    reaches(explorer)
    name, ending = BROKEN[policy]
    assert name in explorer.found
    *_, last = str(explorer.found[name]).splitlines()
    assert last.strip() == ending


def test_the_page_of_policies_shows_the_story_that_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT.parents[1] / "docs" / "policies.md").read_text(encoding="utf-8")
    shown = (
        page[page.index("volts.yaml: charges, as measured: ") :]
        .partition(" properties, 1 BROKEN")[0]
        .rpartition("\n")[0]
    )
    monkeypatch.chdir(ROOT / "broken")
    walk = walk_on(small(Rules.of(bay_of(load_policy("volts.yaml")))))
    explorer = Explorer(walk, here(walk))
    explorer.run(most=60)
    reaches(explorer)
    told = f"volts.yaml: {explorer.found['charges, as measured']}"
    lines = [line.strip() for line in shown.splitlines() if line.strip() not in ("", "…")]
    assert [line.strip() for line in told.splitlines() if line.strip() in lines][-1] == lines[-1]
    assert [line for line in lines if line not in map(str.strip, told.splitlines())] == []


@pytest.mark.parametrize("policy", shipped_names("policies"))
def test_a_shipped_policy_ends_every_charge_and_wakes_every_pack(policy: str) -> None:
    """Whatever its hold at the top, and wherever its stages of precharge meet; `make campaign` has all inputs."""
    walk = walk_on(few(Rules.of(bay_of(load_policy(f"policies/{policy}.yaml")))))
    explorer = Explorer(walk, here(walk))
    explorer.run(most=110)
    assert State.CHARGING in {node.place.memory.state for node in explorer.nodes}
    reaches(explorer)
    assert not explorer.found


class Aimed:
    """The same inputs, with a target in every start."""

    def __init__(self, inputs: StationInputs) -> None:
        self._inputs = inputs

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inputs, name)

    def snapshot(self, move: Move, now_s: float, memory: Memory) -> Snapshot:
        target_pct = 100.0 if move.request is Request.START else None
        return replace(self._inputs.snapshot(move, now_s, memory), target_pct=target_pct)


def test_a_charge_to_a_target_keeps_every_property() -> None:
    """With what the endings speak of, and nothing else."""
    whole = few(Rules.of(bay_of(load_policy("li-ion-48v"))))
    chargers = {ending.charger: whole.chargers[ending.charger] for ending in ENDINGS}
    batteries = {ending.battery: whole.batteries[ending.battery] for ending in ENDINGS}
    walk = walk_on(replace(whole, chargers=chargers, batteries=batteries))
    walk.inputs = Aimed(walk.inputs)  # type: ignore[arg-type]  # with a snapshot of its own
    explorer = Explorer(walk, here(walk))
    explorer.run(most=170)
    aimed = {node.place.memory.state for node in explorer.nodes if node.place.memory.operator.target_pct is not None}
    assert {State.QUALIFYING, State.CHARGING, State.SUSPENDED} <= aimed
    reaches(explorer)
    assert not explorer.found


def test_bays_that_differ_in_wiring_only_are_proved_once() -> None:
    """Two of three are alike; an object map decides nothing."""
    named = [name for name, _ in bays_in(str(ROOT / "broken" / "station.yaml"))]
    assert named == [f"{ROOT}/broken/station.yaml, bay-1, bay-3", f"{ROOT}/broken/station.yaml, bay-2"]
    assert list(bays_in("configs/maps/tabos.yaml")) == []


def test_the_command_explores_on_every_core(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The complete run, on a bay with few inputs: the same findings as in one process."""
    monkeypatch.setattr(exhaustive, "StationInputs", SimpleNamespace(of=few))
    monkeypatch.setattr(processes, "get_context", lambda _: get_context("fork"))  # children have those few too
    assert main(["check", "--exhaustive", "--jobs", "2", str(ROOT / "broken" / "automatic.yaml")]) == 1
    said, told = capsys.readouterr()
    assert f"\n{ROOT}/broken/automatic.yaml, bay-1: 33 properties, 2 BROKEN; " in said
    assert "bay-1: charges: a healthy battery is charged" in told
    assert "charges, as measured" in told
    assert "decisions explored" not in told  # progress is for terminals


def test_every_part_of_the_search_says_how_far_it_is() -> None:
    told: list[str] = []
    walk = walk_on(small(Rules.of(bay_of(load_policy("li-ion-48v")))))
    explorer = Explorer(walk, here(walk), told.append)
    explorer.run(most=5)
    assert told[0].endswith(" decisions explored")
    told.clear()
    reaches(explorer, ENDINGS[:2])
    assert told == ["1 of 2 endings", "2 of 2 endings"]
    told.clear()
    settles(explorer, explorer.nodes[:1])
    assert told == [f"{number} of {len(told)} searches for livelocks" for number in range(1, len(told) + 1)]
    assert told


def test_progress_is_one_line_of_a_terminal_rewritten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verbs, "PROGRESS_S", 0.0)
    monkeypatch.setenv("COLUMNS", "20")
    ours, theirs = os.openpty()
    with os.fdopen(theirs, "w", encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        tell = verbs.progress("a/very/long/name/of/a/file: ")
        tell("5 decisions")
        tell("")
        expected, shown = b"\r\x1b[Ka/very/l5 decisions\r\x1b[K", b""
        while len(shown) < len(expected):
            shown += os.read(ours, 1000)
    os.close(ours)
    assert shown == expected
