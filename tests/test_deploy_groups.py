"""The drop-in that lets the sockets belong to groups fits the unit, and opens little."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DEPLOY = Path(__file__).resolve().parent.parent / "deploy"
ANALYZE = [path for path in (shutil.which("systemd-analyze"),) if path]


@pytest.mark.parametrize("analyze", ANALYZE)
def test_the_unit_with_groups_is_one_and_its_exposure_is_low(analyze: str, tmp_path: Path) -> None:
    added = (DEPLOY / "orchestrator-groups.conf").read_text(encoding="utf-8").partition("[Service]")[2]
    text = (DEPLOY / "orchestrator.service").read_text(encoding="utf-8").replace("[Install]", f"{added}\n[Install]")
    unit = tmp_path / "orchestrator.service"
    unit.write_text(text.replace("/opt/orchestrator/bin/orchestrator", sys.executable), encoding="utf-8")
    checked = subprocess.run([analyze, "verify", str(unit)], capture_output=True, text=True, check=True)
    assert checked.stderr == ""
    command = [analyze, "security", "--offline=true", "--no-pager", "--threshold=15", str(unit)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert float(done.stdout.rpartition(": ")[2].split()[0]) <= 1.5
