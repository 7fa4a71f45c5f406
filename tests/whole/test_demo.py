"""The demo as people start it: it ends properly, and cannot be reached from outside the machine."""

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from orchestrator.demo.stage import Stage
from tests.waiting import wait_until
from tests.whole.station import die_with_parent

#: The kernel's tables of all network sockets on this machine; their inode column.
TABLES = {"tcp": 9, "tcp6": 9, "udp": 9, "udp6": 9, "raw": 9, "raw6": 9, "packet": 8}


def network_sockets() -> set[str]:
    """The inodes of all of them."""
    tables = [(Path(f"/proc/net/{name}"), column) for name, column in TABLES.items()]
    return {
        line.split()[column]
        for table, column in tables
        if table.exists()
        for line in table.read_text(encoding="ascii").splitlines()[1:]
    }


def sockets_of(pid: int) -> set[str]:
    names = [str(fd.readlink()) for fd in Path(f"/proc/{pid}/fd").iterdir() if fd.is_symlink()]
    return {name.removeprefix("socket:[").removesuffix("]") for name in names if name.startswith("socket:")}


def family_of(pid: int) -> list[int]:
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [pid, *(one for child in children for one in family_of(int(child)))]


def test_nothing_listens_beyond_this_machine() -> None:
    with Stage() as stage:
        wait_until(lambda: (stage.bay() or {}).get("state") == "PRECHARGE_PULSE", 30, "a charge", 0.2)
        processes = family_of(os.getpid())
        assert {stage.plant.pid, stage.service.pid} < set(processes) and len(processes) >= 4
        found = {pid: sockets_of(pid) for pid in processes}
        assert found[stage.service.pid], "the service has sockets, and they were not seen"
        network = network_sockets()
        assert {pid: sockets & network for pid, sockets in found.items() if sockets & network} == {}
        assert stage.end() == 0


#: The demo in less time: the fault comes in the first pulse, and what follows is watched for a second.
QUICKLY = (
    "-c",
    "import sys; from orchestrator.demo import story; from orchestrator.__main__ import main; "
    "story.STAGES = dict.fromkeys(story.SINCE, 'PRECHARGE_PULSE'); story.INJECT_AFTER_S = story.LOOK_S = 1.0; "
    "sys.exit(main())",
)


def run_demo(
    directory: Path, *arguments: str, program: Sequence[str] = ("-m", "orchestrator")
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-P", *program, "demo", *arguments],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},  # a poor terminal at that
        cwd=directory,
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
        preexec_fn=die_with_parent,
    )


def test_a_fault_is_shown_with_its_stop(tmp_path: Path) -> None:
    done = run_demo(tmp_path, "--plain", "--fault", "over_temperature", program=QUICKLY)
    assert (done.returncode, done.stderr) == (0, "")
    assert "It stopped because: " in done.stdout
    assert re.search(r"The first stop frame reached the charger \S+ s after the pack began to heat up", done.stdout)
    assert "The emulated charger: operation 0, 0.00 A." in done.stdout


def test_the_faults_are_listed(tmp_path: Path) -> None:
    done = run_demo(tmp_path, "--fault", "list")
    assert done.returncode == 0
    assert "over_temperature" in done.stdout


@pytest.mark.parametrize("arguments", [("--fault", "nonsense"), ("--unknown",)])
def test_wrong_use_is_one_sentence(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    done = run_demo(tmp_path, *arguments)
    assert done.returncode in (1, 2)
    assert "Traceback" not in done.stderr
