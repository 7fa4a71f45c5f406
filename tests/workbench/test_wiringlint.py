"""Advice that depends on the machine: which name an adapter has, which files are in memory, what can be created."""

import os
from pathlib import Path

import pytest

from orchestrator.config.load import check, load_station
from orchestrator.config.shipped import shipped_dir
from orchestrator.workbench.disklint import in_memory, unmakeable
from orchestrator.workbench.prove.lint import LINT
from orchestrator.workbench.wiringlint import EXAMPLE_STEPS_A, unstable

STATIONS = sorted((shipped_dir() / "configs" / "stations").glob("*.yaml"))
MOUNTS = """\
/dev/mmcblk0p2 / ext4 rw 0 0
tmpfs {top}/run tmpfs rw 0 0
/dev/sda1 {top}/run/a\\040disk ext4 rw 0 0
/dev/sda2 {top}/mnt ext4 rw 0 0
tmpfs {top}/mnt tmpfs rw 0 0
nonsense
"""


def test_the_stable_name_of_an_adapter_that_is_plugged_in_is_said(tmp_path: Path) -> None:
    port, links, none = tmp_path / "ttyUSB0", tmp_path / "by-path", tmp_path / "by-id"
    links.mkdir()
    port.touch()
    (tmp_path / "ttyUSB1").touch()
    (links / "pci-1-port0").symlink_to("../ttyUSB1")
    (links / "pci-2-port0").symlink_to("../ttyUSB0")
    assert unstable(str(port), (none, links)).endswith(f"write {links}/pci-2-port0")
    assert unstable(str(port), (none,)).endswith("write its name below /dev/serial/by-path or /dev/serial/by-id")


def test_an_adapter_is_recognised_behind_a_name_of_our_own(tmp_path: Path) -> None:
    """As udev rules give one: the name says nothing, what it points to does."""
    (tmp_path / "ttyUSB0").touch()
    for name, device in (("bay-1", "ttyUSB0"), ("CHECKOUT", "ttyS1")):
        (tmp_path / name).symlink_to(device)
        station = tmp_path / "station.yaml"
        text = (Path(__file__).parent / "odd" / "wiring-right.yaml").read_text(encoding="utf-8")
        station.write_text(text.replace("/dev/ttyS1", str(tmp_path / name)), encoding="utf-8")
        told = [finding.text.partition(":")[0] for finding in check([station], LINT)]
        assert told == (["bays[1].charger.rs485"] if device == "ttyUSB0" else [])


@pytest.mark.parametrize("example", STATIONS, ids=lambda path: path.stem)
def test_a_copy_of_an_example_is_told_what_was_left_in(example: Path, tmp_path: Path) -> None:
    """The example itself is not: see `test_nothing_is_odd_about_what_ships`."""
    copy = tmp_path / "station.yaml"
    copy.write_text(example.read_text(encoding="utf-8"), encoding="utf-8")
    told = [finding.text.split(": ")[0] for finding in check([copy], LINT)]
    bays = range(len(load_station(example).bays))
    assert told[0] == "bays[0].charger.port"
    assert [path for path in told if path != "bays[0].charger.port"] == [f"bays[{i}].charger.steps_a" for i in bays]


@pytest.mark.parametrize("example", STATIONS, ids=lambda path: path.stem)
def test_the_examples_have_the_steps_that_are_looked_for(example: Path) -> None:
    assert {bay.charger.steps_a for bay in load_station(example).bays} == {EXAMPLE_STEPS_A}


def test_a_directory_in_memory_is_recognised_by_its_mount(tmp_path: Path) -> None:
    """Also before it is there, and not by a name that only begins alike; the last mount on a point counts."""
    (tmp_path / "run" / "a disk").mkdir(parents=True)
    (tmp_path / "mnt").mkdir()
    mounts = tmp_path / "mounts"
    mounts.write_text(MOUNTS.format(top=tmp_path), encoding="utf-8")
    assert in_memory(tmp_path / "run" / "not" / "yet", mounts) == f"tmpfs on {tmp_path}/run"
    assert in_memory(tmp_path / "run" / "a disk" / "journal", mounts) == ""
    assert in_memory(tmp_path / "mnt", mounts) == f"tmpfs on {tmp_path}/mnt"
    for on_disk in (tmp_path / "runway", Path("/"), Path("relative")):
        assert in_memory(on_disk, mounts) == ""
    assert in_memory(tmp_path / "run", tmp_path / "none") == "", "unknown"


@pytest.mark.skipif(in_memory(Path("/dev/shm")) == "", reason="no file system in memory on /dev/shm")
def test_a_journal_in_memory_is_warned_of(tmp_path: Path) -> None:
    station = tmp_path / "station.yaml"
    text = (Path(__file__).parent / "odd" / "wiring-right.yaml").read_text(encoding="utf-8")
    station.write_text(text.replace("/var/lib/orchestrator/journal", "/dev/shm/not/yet"), encoding="utf-8")
    (finding,) = check([station], LINT)
    assert finding.text.startswith("journal.directory: /dev/shm/not/yet is in memory (")
    assert "lost at each boot, with every latch and hold: write a directory on a disk" in finding.text


def test_what_the_unit_makes_or_somebody_can_make_is_no_trouble(tmp_path: Path) -> None:
    for fine in ("/run/orchestrator/a", "/var/lib/orchestrator/b/c", tmp_path, tmp_path / "not" / "yet", "/var/tmp/x"):
        assert unmakeable(Path(fine)) is None, fine
    (tmp_path / "file").touch()
    assert unmakeable(tmp_path / "file" / "x") is None, "an error says it"
    assert unmakeable(Path("/run/of-nobody/a")) == Path("/run")
    assert unmakeable(Path("/of-nobody/a")) == Path("/")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_directory_that_others_own_is(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    assert unmakeable(tmp_path / "x") == tmp_path
