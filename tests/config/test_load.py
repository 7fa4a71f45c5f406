"""How files are found, named in messages, read once and told apart."""

import os
import re
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestrator.config import shipped
from orchestrator.config.load import check, load_map, load_policy, load_scenario, load_station
from orchestrator.config.policy import Thresholds
from orchestrator.config.ports import wiring
from orchestrator.config.station import Rs485
from orchestrator.config.yaml.tree import MAX_BYTES
from orchestrator.errors import ConfigError
from orchestrator.keys import Range
from orchestrator.model import ControlMode

GOOD = Path(__file__).parent / "good"
POLICY, STATION, MAP = ((GOOD / f"{name}.yaml").read_text() for name in ("policy", "station", "map"))


@pytest.fixture(autouse=True)
def _in_a_directory_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def _write(path: str, text: str) -> Path:
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    return file


def _findings(error: pytest.ExceptionInfo[ConfigError]) -> list[str]:
    return str(error.value).splitlines()


def test_a_station_becomes_one_frozen_object() -> None:
    station = load_station(GOOD / "station.yaml")
    assert station.station == "depot-3"
    assert station.can == {"can0": {"interface": "socketcan", "channel": "can0", "bitrate": 250000}}
    assert [bay.name for bay in station.bays] == ["bay-1", "bay-2"]
    bay = station.bays[0]
    assert bay.charger.port == "/dev/ttyS1"
    assert bay.charger.control is ControlMode.MANUAL
    assert bay.charger.steps_a == (2.0, 5.0, 8.0, 11.0, 14.0)
    assert bay.charger.rs485 is Rs485.OFF
    assert (bay.battery.node_id, bay.battery.tpdo_s, bay.battery.heartbeat_s) == (0x10, None, 0.5)
    assert bay.limits.temperature_c == Range(0.0, 45.0)
    assert bay.battery.map.map == "tabos"
    assert bay.policy.policy == "li-ion-48v"


def test_paths_are_relative_to_the_station_file() -> None:
    _write("s/policies/mine.yaml", POLICY)
    _write("s/maps/mine.yaml", MAP)
    text = STATION.replace("policy: li-ion-48v", "policy: ../policies/mine.yaml").replace(
        "map: tabos", "map: ../maps/mine.yaml"
    )
    station = load_station(_write("s/stations/x.yaml", text.replace("/dev/ttyS1", "./charger-1")))
    assert station.control.socket == Path("s/stations/run/orchestrator.sock")
    assert station.journal.directory == Path("s/stations/run/journal")
    assert station.bays[0].charger.port == "s/stations/charger-1"
    assert station.bays[0].policy.source.file == "s/policies/mine.yaml"
    assert station.bays[0].battery.map.source.file == "s/maps/mine.yaml"


def test_what_several_bays_name_is_read_once() -> None:
    first, second = load_station(GOOD / "station.yaml").bays
    assert first.policy is second.policy
    assert first.battery.map is second.battery.map


def test_lines_lead_back_to_the_files() -> None:
    station = load_station(_write("x.yaml", STATION))
    first, second = station.bays
    assert station.source.at("bays[1].limits.current_a") == "x.yaml:13"
    assert second.source.at("limits.current_a") == "x.yaml:13"
    assert second.source.at("name") == "x.yaml:10"
    assert first.source.at("battery.heartbeat_s") == "x.yaml:7", "not written: its parent's line"
    policy = load_policy(_write("p.yaml", POLICY))
    assert policy.source.at("current.soc_pct.rows[1]") == "p.yaml:28"
    assert policy.source.at("current.soc_pct.rows[1].max_a") == "p.yaml:28"
    assert policy.source.at("pack.temperature_c") == "p.yaml:7"
    assert policy.source.at("faults.volts_differ_v") == "p.yaml:33"
    assert policy.source.at("nothing.like.it") == "p.yaml"


def test_what_may_be_left_out_has_its_default() -> None:
    cut = POLICY[: POLICY.index("faults:")]
    cut = cut[: cut.index("precharge:")] + cut[cut.index("current:") :]
    cut = cut.replace("taper: {below_a: 1.0, above_v: 53.6, for_s: 120}", "taper: null")
    policy = load_policy(_write("p.yaml", cut))
    assert policy.faults == Thresholds()
    assert policy.precharge is None
    assert policy.finish.full.taper is None
    assert policy.finish.hold_min == 0
    assert policy.pack.capacity_ah is None
    assert policy.current.soh_pct is None


def test_a_policy_is_found_by_name_by_text_and_by_path() -> None:
    _write("here/mine.yaml", POLICY)
    assert load_policy("lfp-48v").pack.cells_in_series == 16
    assert load_policy("mine.yaml", Path("here")).policy == "test-48v"
    assert load_policy(Path("mine.yaml"), Path("here")).source.file == "here/mine.yaml"
    assert load_policy("here/mine.yaml").source.file == "here/mine.yaml"


def test_a_wrong_name_lists_the_shipped_ones() -> None:
    with pytest.raises(ConfigError) as error:
        load_policy("li-ion-48")
    (finding,) = _findings(error)
    assert finding.startswith("li-ion-48:1:1: error: no policy of this name is shipped; did you mean li-ion-48v?")
    assert "lfp-48v, li-ion-24v, li-ion-48v, long-life-48v" in finding
    with pytest.raises(ConfigError, match="no object map of this name is shipped"):
        load_map("nothing-near")


def test_a_wrong_path_names_what_lies_beside() -> None:
    _write("here/depot.yaml", STATION)
    with pytest.raises(ConfigError) as error:
        load_station("here/depo.yaml")
    assert _findings(error) == [
        "here/depo.yaml:1:1: error: cannot be read: No such file or directory; did you mean depot.yaml?"
    ]
    with pytest.raises(ConfigError, match="there is no directory nowhere"):
        load_policy("nowhere/x.yaml")
    with pytest.raises(ConfigError, match="for the shipped policy write lfp-48v"):
        load_policy("here/lfp-48v.yaml")


def test_a_name_that_no_file_system_takes_is_a_finding() -> None:
    with pytest.raises(ConfigError, match="File name too long"):
        load_policy("x" * 5000 + ".yaml")


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))


#: Things other than a file that may be found at a path; each of them really exists here.
NO_FILES: dict[str, Callable[[Path], object]] = {
    "a directory": Path.mkdir,
    "a pipe (FIFO)": os.mkfifo,
    "a socket": _socket,
    "a device": lambda path: path.symlink_to("/dev/zero"),
}


@pytest.mark.parametrize("kind", NO_FILES)
def test_what_is_no_file_is_told_for_what_it_is_and_never_waited_for(kind: str) -> None:
    name = "depot.yaml"
    NO_FILES[kind](Path(name))
    said = f"{name}:1:1: error: cannot be read: this is {kind}; expected is a YAML file: a station, a policy, "
    assert [str(finding)[: len(said)] for finding in check([name])] == [said]
    for load in (load_station, load_policy, load_map, load_scenario):
        with pytest.raises(ConfigError) as error:
            load(name)
        assert _findings(error)[0].startswith(said)
    with pytest.raises(OSError, match=f"this is {re.escape(kind)}; expected is a station file"):
        wiring(Path(name))


def test_what_is_no_file_is_told_where_a_station_names_it() -> None:
    os.mkfifo("pipe.yaml")
    _write("depot.yaml", STATION.replace("policy: li-ion-48v", "policy: pipe.yaml"))
    assert any(
        "pipe.yaml:1:1: error: cannot be read: this is a pipe (FIFO)" in str(one) for one in check(["depot.yaml"])
    )


def test_a_file_that_this_user_may_not_read_is_told_with_the_user() -> None:
    """Root can read everything, so another user tries, with a file in a directory open to everyone."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        Path(folder, "secret.yaml").touch(0o000)
        assert _said_of_a_secret(folder) == "; expected is a policy that this user may read\n"


def _said_of_a_secret(folder: str) -> str:
    code = "import os, sys; from pathlib import Path; from orchestrator.config.plainfile import read_plain\n"
    code += "os.setuid(int(sys.argv[1]))\n" if os.getuid() == 0 else ""
    code += "try: read_plain(Path('secret.yaml'), 9, 'a policy')\nexcept OSError as error: print(error.strerror)"
    user = "65534" if os.getuid() == 0 else str(os.getuid())
    argv = [sys.executable, "-c", code, user]
    said = subprocess.run(argv, cwd=folder, capture_output=True, text=True, check=True).stdout
    return said.removeprefix(f"permission denied for user {user}")


def test_a_huge_file_is_not_read_to_its_end() -> None:
    with Path("huge.yaml").open("wb") as file:
        file.truncate(1 << 40)  # sparse: it takes no disk space
    said = f"huge.yaml:1:1: error: the file has more than {MAX_BYTES} bytes: this is not one of our files"
    assert [str(finding) for finding in check(["huge.yaml"])] == [said]
    assert wiring(Path("huge.yaml")).damaged


def test_a_file_of_another_kind_is_not_read_as_this_one() -> None:
    _write("map.yaml", MAP)
    with pytest.raises(ConfigError) as error:
        load_policy(Path("map.yaml"))
    assert _findings(error) == [
        "map.yaml:1:1: error: map.yaml has the key 'map'; needed is a file with the key 'policy'"
    ]


def test_check_reports_each_file_once_under_the_name_it_was_given() -> None:
    _write("policies/mine.yaml", POLICY.replace("soh_min_pct: 60", "soh_min_pct: 600"))
    _write("stations/x.yaml", STATION.replace("policy: li-ion-48v", "policy: ../policies/mine.yaml"))
    expected = ["policies/mine.yaml:8:16: error: pack.soh_min_pct: 600 % is too high, allowed: 1 … 100 %"]
    assert [str(finding) for finding in check(["stations/x.yaml"])] == expected
    assert [str(finding) for finding in check(["stations/x.yaml", "stations/../policies/mine.yaml"])] == [
        expected[0].replace("policies/", "stations/../policies/")
    ]
    with pytest.raises(ConfigError) as error:
        load_station("stations/x.yaml")
    assert _findings(error) == expected


def test_check_takes_no_files_as_well() -> None:
    assert check([]) == []


def test_a_port_may_not_come_twice_by_another_name() -> None:
    _write("tty", "")
    Path("by-path").symlink_to("tty")
    text = STATION.replace("/dev/ttyS1", "./tty").replace("/dev/ttyS2", "./by-path")
    assert [str(finding) for finding in check([_write("x.yaml", text)])] == [
        "x.yaml:11:21: error: bays[1].charger.port: bays[0] (bay-1) is on this port already; "
        "each charger needs its own port (its address is fixed)"
    ]


def test_no_more_bays_than_one_gateway_serves() -> None:
    head, tail = STATION[: STATION.index("  - name: bay-1")], STATION[STATION.index("control: {") :]
    bay = STATION[len(head) : STATION.index("  - name: bay-2")]

    def station(count: int) -> Path:
        bays = "".join(
            bay.replace("bay-1", f"bay-{i}")
            .replace("ttyS1", f"tty{i}")
            .replace("0x10", str(i % 127 + 1))
            .replace("can: can0", f"can: can{i // 127}")
            for i in range(count)
        )
        second = "  can1: {interface: socketcan, channel: can1, bitrate: 250000}\n"
        return _write("many.yaml", head.replace("bays:", f"{second}bays:") + bays + tail)

    assert check([station(128)]) == []
    assert [finding.text for finding in check([station(129)])] == ["bays: 129 bays; one gateway serves at most 128"]


def test_an_installed_package_finds_its_own_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wheel has the shipped files inside the package; a bare checkout has them at the top level."""
    for inside in (True, False):
        package = Path("site" if inside else "checkout", "orchestrator").absolute()
        package.mkdir(parents=True)
        root = package / "_shipped" if inside else package.parent
        _write(str(root / "policies/only.yaml"), POLICY)
        monkeypatch.setattr(shipped, "_PACKAGE", package)
        shipped.shipped_dir.cache_clear()
        assert shipped.shipped_dir() == root
        assert load_policy("only").source.file == "policies/only.yaml"
    shipped.shipped_dir.cache_clear()
