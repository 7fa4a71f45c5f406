"""Every file in broken/ and, beside it, the exact findings expected."""

import re
from pathlib import Path

import pytest

from orchestrator.config.load import check, load_map, load_policy, load_station
from orchestrator.errors import ConfigError

HERE = Path(__file__).parent
BROKEN = sorted(path.name for path in (HERE / "broken").glob("*.yaml"))
GOOD = sorted(path.name for path in (HERE / "good").glob("*.yaml"))


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_gets_exactly_the_findings_beside_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(HERE / "broken")
    expected = Path(name).with_suffix(".txt").read_text(encoding="utf-8").splitlines()
    assert [str(finding) for finding in check([name])] == expected
    assert expected, "a broken file without a finding is not broken"


@pytest.mark.parametrize("name", BROKEN)
def test_no_broken_file_is_loaded(name: str) -> None:
    for load in (load_station, load_policy, load_map):
        with pytest.raises(ConfigError) as caught:
            load(HERE / "broken" / name)
        assert caught.value.findings


def test_every_expectation_has_its_file() -> None:
    assert sorted(path.stem for path in (HERE / "broken").glob("*.txt")) == sorted(Path(name).stem for name in BROKEN)


@pytest.mark.parametrize("name", GOOD)
def test_a_good_file_has_no_findings(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(HERE / "good")
    assert check([name]) == []


def test_what_is_to_be_written_for_an_old_finish_is_accepted_literally(tmp_path: Path) -> None:
    old = (HERE / "broken" / "policy-of-yesterday.yaml").read_text(encoding="utf-8")
    told = (HERE / "broken" / "policy-of-yesterday.txt").read_text(encoding="utf-8")
    (full,) = re.findall(r"write (full: \{.*\}), one key", told)
    lines = [
        line for line in old.splitlines() if not line.startswith(("  soc_pct: 100", "  taper:", "  charger_full:"))
    ]
    policy = tmp_path / "policy.yaml"
    policy.write_text("\n".join(lines).replace("finish:", f"finish:\n  {full}"), encoding="utf-8")
    assert not [finding.text for finding in check([str(policy)]) if "finish" in finding.text]


@pytest.mark.parametrize(
    ("station", "told"),
    [
        ("policy: p\n", "page.yaml:1:1: error: station: {station} has the key 'policy'; needed is a file with the key"),
        ("- 7\n", "{station}:1:1: error: "),
        ("bays: {\n", "{station}:2:1: error: "),
        ("station: hall\nbays: []\n", "{station}:1:1: error: "),
    ],
)
def test_a_northbound_file_whose_station_cannot_be_loaded_is_in_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, station: str, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("hall.yaml").write_text(station, encoding="utf-8")
    Path("page.yaml").write_text("station: hall.yaml\npage: {listen: 127.0.0.1:8080}\n", encoding="utf-8")
    findings = [str(finding) for finding in check(["page.yaml"])]
    assert any(finding.startswith(told.format(station="hall.yaml")) for finding in findings), findings
