"""Every file in broken/ and, beside it, the exact findings expected."""

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
