"""The shipped unit fits the program it runs, and the pages and files in deploy/ fit each other."""

import re
import shutil
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest

from orchestrator.lastresort import guardian, lastline
from orchestrator.lastresort.estop import VERIFY_S
from orchestrator.lastresort.estop_options import Options
from orchestrator.service import supervisor

ROOT = Path(__file__).resolve().parent.parent
UNIT = ROOT / "deploy" / "orchestrator.service"
NORTHBOUND = ROOT / "deploy" / "orchestrator-northbound.service"
UNITS = (UNIT, NORTHBOUND)
PAGE = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
NORTHBOUND_PAGE = (ROOT / "docs" / "northbound.md").read_text(encoding="utf-8")
#: systemd's own checker, if there is one: `systemd-analyze security` has --offline since version 250.
ANALYZE = [path for path in (shutil.which("systemd-analyze"),) if path]


def settings(file: Path) -> dict[str, list[str]]:
    """Key → its values, in order."""
    found = defaultdict(list)
    for line in file.read_text(encoding="utf-8").splitlines():
        key, equals, value = line.partition("=")
        if equals and not line.startswith("#"):
            found[key].append(value)
    return found


SERVICE = settings(UNIT)


def seconds(key: str) -> float:
    return float(SERVICE[key][0])


def test_systemd_waits_for_longer_than_the_program_does() -> None:
    closing_s = supervisor.STOP_S + guardian.END_S + guardian.VERIFY_S
    assert seconds("TimeoutStopSec") > closing_s
    assert seconds("TimeoutStopSec") > VERIFY_S + lastline.ROUND_S  # of ExecStopPost
    assert seconds("TimeoutStartSec") > guardian.STARTUP_S
    assert seconds("WatchdogSec") >= 5 * max(guardian.WATCHDOG_S, lastline.ROUND_S)


def test_the_service_is_never_given_up() -> None:
    assert SERVICE["Restart"] == ["always"]
    assert SERVICE["StartLimitIntervalSec"] == ["0"]


def test_run_and_estop_are_used_as_they_want_to_be() -> None:
    program, verb, station = SERVICE["ExecStart"][0].split()
    assert verb == "run"
    again, verb, *words = SERVICE["ExecStopPost"][0].split()
    assert (again, verb) == (program, "estop")
    options = Options(words)
    assert (options.wrong, options.stations, options.leave_held) == ("", [station], True)
    for path in (program.removesuffix("/bin/orchestrator"), station, SERVICE["Environment"][0].partition("=")[2]):
        assert path in PAGE


def test_the_page_installs_every_file_that_is_shipped_and_no_other() -> None:
    named = set(re.findall(r"deploy/([\w.-]+)", PAGE + NORTHBOUND_PAGE))
    assert named == {file.name for file in (ROOT / "deploy").iterdir()}


def test_every_exit_status_is_explained() -> None:
    told = set(re.findall(r"`status=(\d+)`", PAGE))
    assert told == {"1", "2", str(guardian.ACTED)}


def test_the_page_names_verbs_that_there_are() -> None:
    verbs = set(re.findall(r"(?<!-[ug] )orchestrator ([a-z]+)\b", PAGE))
    command = [sys.executable, "-m", "orchestrator", "--help"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert {"start", "stop", "status", "estop", "probe", "check"} <= verbs
    assert verbs <= set(re.findall(r"^    ([a-z]+)(?: |$)", listed, re.MULTILINE))


def runnable(unit: Path, directory: Path) -> Path:
    """The unit with an existing program; otherwise the checker complains about nothing else."""
    copy = directory / unit.name
    program = SERVICE["ExecStart"][0].split()[0]
    copy.write_text(unit.read_text(encoding="utf-8").replace(program, sys.executable), encoding="utf-8")
    return copy


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("analyze", ANALYZE)
def test_systemd_knows_every_key(analyze: str, unit: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [analyze, "verify", str(runnable(unit, tmp_path))], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("analyze", ANALYZE)
def test_exposure_is_low(analyze: str, unit: Path, tmp_path: Path) -> None:
    command = [analyze, "security", "--offline=true", "--no-pager", "--threshold=15", str(runnable(unit, tmp_path))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert float(done.stdout.rpartition(": ")[2].split()[0]) <= 1.5


def test_the_page_is_served_by_a_unit_that_knows_the_controller_by_its_sockets_alone() -> None:
    served = settings(NORTHBOUND)
    program, verb, file = served["ExecStart"][0].split()
    assert (program, verb) == (SERVICE["ExecStart"][0].split()[0], "serve")
    assert file in NORTHBOUND_PAGE
    assert served["User"] != SERVICE["User"]
    assert served["RestrictAddressFamilies"] == ["AF_UNIX AF_INET AF_INET6"]
    assert not {"DeviceAllow", "Requires", "BindsTo"} & served.keys()
