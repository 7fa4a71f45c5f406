"""`orchestrator simulate` on the command line."""

import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.cli import main

RUN = ("simulate", "li-ion-48v", "--scenario", "deep-discharge")


def test_a_table_comes_out(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(RUN) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    head, *lines = printed.out.splitlines()
    assert head.split() == ["li-ion-48v"]
    assert any(line.startswith("time PRECHARGE_PULSE, h:min:s") for line in lines)


def test_files_are_written_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(("simulate", "long-life-48v", *RUN[1:], "--out", str(tmp_path))) == 0
    assert capsys.readouterr().out.splitlines()[-2:] == [
        f"{tmp_path}/deep-discharge.html",
        f"{tmp_path}/deep-discharge.png",
    ]


def test_a_sweep_is_played(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("--sweep", "finish.target_soc_pct=98..100:2", "--jobs", "1", "--out", str(tmp_path))
    assert main((*RUN, *arguments)) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed[1:3]] == ["98", "100"]
    assert printed[-1] == f"{tmp_path}/deep-discharge-sweep.csv"


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (("simulate", "li-ion-48", "--scenario", "agv-day"), 1, "did you mean li-ion-48v?"),
        (("simulate", "li-ion-48v", "--scenario", "agv-days"), 1, "did you mean agv-day?"),
        (("simulate", "li-ion-24v", "--scenario", "agv-day"), 1, "is for 7 cells in series"),
        ((*RUN, "--sweep", "finish.soc_pct"), 2, "write KEY=FROM..TO:COUNT"),
        (("simulate", "lfp-48v", *RUN[1:], "--sweep", "finish.soc_pct=90..100:2"), 2, "name one policy"),
        ((*RUN, "--sweep", "finish.sco_pct=90..100:2", "--jobs", "1"), 1, ""),
    ],
)
def test_what_is_wrong_is_said(
    arguments: tuple[str, ...], status: int, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == status
    assert says in capsys.readouterr().err


def test_the_table_needs_no_more_than_the_gateway_has() -> None:
    """Only pages and pictures need the extra."""
    code = "import sys; from orchestrator.cli import main; main(sys.argv[1:]); "
    code += "print([name for name in ('matplotlib', 'numpy', 'jinja2', 'distributed') if name in sys.modules])"
    run = subprocess.run((sys.executable, "-c", code, *RUN), check=True, capture_output=True, text=True)
    assert run.stdout.splitlines()[-1] == "[]"
