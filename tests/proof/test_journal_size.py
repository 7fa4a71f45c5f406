"""The journal reaches as far back as `check` says, and replays what it holds."""

from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.service.reach import SNAPSHOTS_B_S
from tests.proof.journal_size import Measured, measure

#: The most bays on a bus for each figure that stands in the product, or the fewest where fewer write more.
SIZES = {1: 0, 4: 1, 16: 2}


@pytest.mark.parametrize("bays", SIZES)
def test_a_charging_bay_writes_what_check_says(bays: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    measured, said = measure(bays, 240.0 / (bays + 3), tmp_path), SNAPSHOTS_B_S[SIZES[bays]][1]
    assert 0.6 * said < measured.bytes_s <= said, measured
    assert main(["replay", str(tmp_path)]) == 0
    assert "all as recorded" in capsys.readouterr().out


def test_a_gigabyte_holds_a_week_of_16_bays_and_two_days_of_64() -> None:
    said = Measured(16, 0.0, SNAPSHOTS_B_S[-1][1])
    assert said.days(16) >= 7
    assert said.days(64) >= 2
