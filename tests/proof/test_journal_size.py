"""The journal reaches as far back as `check` says, and replays what it holds."""

from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.service.reach import ALONE_B_S, SNAPSHOTS_B_S
from tests.proof.journal_size import Measured, measure

#: Bays on one bus → what the product says that each of them writes.
SAID = {1: ALONE_B_S, 2: SNAPSHOTS_B_S[0][1], 16: SNAPSHOTS_B_S[-1][1]}


@pytest.mark.parametrize("bays", SAID)
def test_a_charging_bay_writes_what_check_says(bays: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    measured = measure(bays, 120.0 if bays < 16 else 40.0, tmp_path)
    assert 0.6 * SAID[bays] < measured.bytes_s <= SAID[bays], measured
    assert main(["replay", str(tmp_path)]) == 0
    assert "all as recorded" in capsys.readouterr().out


def test_a_gigabyte_holds_a_week_of_16_bays_and_two_days_of_64() -> None:
    said = Measured(16, 0.0, SNAPSHOTS_B_S[-1][1])
    assert said.days(16) >= 7
    assert said.days(64) >= 2
