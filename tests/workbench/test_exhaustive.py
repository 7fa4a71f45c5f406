"""`check --exhaustive`: its findings on policies that break something, and on one that does not."""

from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace

import pytest

from orchestrator.cli import main
from orchestrator.config.load import load_policy
from orchestrator.config.shipped import shipped_names
from orchestrator.core.rules import Rules
from orchestrator.model import State
from orchestrator.workbench import processes
from orchestrator.workbench.prove import exhaustive
from orchestrator.workbench.prove.exhaustive import bay_of, bays_in, here
from orchestrator.workbench.prove.explore import Explorer
from orchestrator.workbench.prove.lasting import reaches
from tests.proof.exploring import small, walk_on

ROOT = Path(__file__).parent
#: Policy → what it breaks, and the end of the counterexample. All three pass every rule of `check`.
BROKEN = {
    "odd/narrow": (
        "charges",
        "→ SUSPENDED: the pack has 22.0 °C, the limit is 24 °C (narrow.yaml:2); it charges again below 19 °C; 24.1 °C "
        "at 1001 s; let it cool down; goes on by itself 10 s after it is gone; no command",
    ),
    "broken/volts": (
        "charges, as measured",
        "→ SUSPENDED: the charger reads 47.95 V, the BMU 47.45 V: not the same battery, or a bad connection; "
        "since 1032 s; check that this BMU belongs to this charger's battery; goes on by itself 1 s after it is gone; "
        "no command",
    ),
    "broken/amps": (
        "charges, as measured",
        "→ TRIPPED: check for loads on the battery and for a wrong node id, then reset – the charger reads 0.00 A, "
        "the BMU 0.50 A; 14.00 A and 14.50 A at 1039 s; reset is refused while it lasts; no command",
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


@pytest.mark.parametrize("policy", shipped_names("policies"))
def test_a_shipped_policy_ends_every_charge_and_wakes_every_pack(policy: str) -> None:
    """Whatever its hold at the top, and wherever its stages of precharge meet."""
    walk = walk_on(small(Rules.of(bay_of(load_policy(f"policies/{policy}.yaml")))))
    explorer = Explorer(walk, here(walk))
    explorer.run(most=110)
    assert State.CHARGING in {node.place.memory.state for node in explorer.nodes}
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
    monkeypatch.setattr(exhaustive, "StationInputs", SimpleNamespace(of=small))
    monkeypatch.setattr(processes, "get_context", lambda _: get_context("fork"))  # children have those few too
    assert main(["check", "--exhaustive", "--jobs", "2", str(ROOT / "broken" / "automatic.yaml")]) == 1
    said, told = capsys.readouterr()
    assert said.startswith(f"{ROOT}/broken/automatic.yaml, bay-1: 33 properties, 2 BROKEN; ")
    assert "bay-1: charges: a healthy battery is charged" in told
    assert "charges, as measured" in told
