"""The diagram of the state machine: it shows the whole table, with the values of a policy."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from orchestrator.cli import main
from orchestrator.config.load import load_policy
from orchestrator.core.machine import TABLE
from orchestrator.model import State
from orchestrator.workbench.draw.diagram import Diagram, diagram, mermaid
from orchestrator.workbench.draw.drawing import draw

Transitions = set[tuple[str, str, str]]


def shown(of: Diagram) -> Transitions:
    """Every transition in the diagram, as a person would read it."""
    members: dict[str, tuple[State, ...]] = {group.name: group.states for group in of.groups}
    inside = {
        (group.name, *line.split(" → ")) for group in of.groups for line in group.lines if " → " in line
    }  # fmt: skip
    found: Transitions = set()
    for arrow in of.arrows:
        triggers = arrow.lines if arrow.dest in members else arrow.lines[:1]
        for trigger in triggers:
            dests = [dest for name, said, dest in inside if (name, said) == (arrow.dest, trigger)] or [arrow.dest]
            found |= {
                (source, trigger, dest) for source in members.get(arrow.source, (arrow.source,)) for dest in dests
            }
    return found | {(source, trigger, dest) for name, trigger, dest in inside for source in members[name]}


def test_the_picture_shows_the_table_and_nothing_else() -> None:
    table = {(source, trigger, dest) for trigger, sources, dest in TABLE for source in sources if dest is not None}
    assert shown(diagram()) == table


def test_a_policy_without_precharge_has_no_such_states() -> None:
    states = {state for group in diagram(load_policy("lfp-48v")).groups for state in group.states}
    assert State.PRECHARGE_PULSE in states
    text = mermaid(diagram(replace(load_policy("lfp-48v"), precharge=None)))
    assert "PRECHARGE" not in text
    assert "QUALIFYING --> CHARGING : charge" in text


def test_a_policy_names_its_thresholds_with_their_lines() -> None:
    policy = load_policy("li-ion-48v")
    lines = Path(__file__).parents[2].joinpath("policies", "li-ion-48v.yaml").read_text(encoding="utf-8").splitlines()
    said = [line for arrow in diagram(policy).arrows for line in arrow.lines if "(line " in line]
    assert "SOC below 98 % (line 26)" in said
    for line in said:
        number = int(line.rpartition("(line ")[2].rstrip(")"))
        assert lines[number - 1].strip(), line
    assert lines[25].strip().startswith("soc_below_pct: 98")


def test_it_is_drawn(tmp_path: Path) -> None:
    svg = ElementTree.fromstring(draw(diagram(), "svg"))
    texts = {"".join(node.itertext()) for node in svg.iter("{http://www.w3.org/2000/svg}text")}
    assert set(State) <= texts
    png = tmp_path / "machine.png"
    assert main(["diagram", "--policy", "li-ion-48v", "--format", "png", "--out", str(png)]) == 0
    assert png.read_bytes().startswith(b"\x89PNG")


def test_text_is_what_comes_without_any_option(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    subprocess.run([sys.executable, "-m", "orchestrator", "diagram"], check=True)
    assert capfdbinary.readouterr().out.decode() == mermaid(diagram())


def test_a_folder_that_is_not_there_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagram", "--out", str(tmp_path / "no" / "machine.mmd")]) == 1
    assert capsys.readouterr().err.endswith("machine.mmd: No such file or directory\n")
