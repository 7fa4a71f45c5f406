"""The charges on record, for Koreans: no word of the tables and pages is left in English."""

import re
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.record.lines import encoded
from tests.record.made import begin, checkpoint, end

#: What is the same in every language: units, names of these records, ids of causes, and the effects of faults.
SAME = re.compile(
    r"SOC|SOH|AH|KWH|Ah|Wh|BMU|ID|UTC|CSV|ms|mΩ|sha256 \w+|TRIP|STOP|--limit|orchestrator identify"
    r"|bay-1|depot|B-1|li-ion-48v|policies|yaml|full|charge_open|hot_trip|\b[A-Z0-9]{26}\b|\b[V A h]\b"
)
FAULT = {"id": "hot_trip", "effect": "TRIP", "times": 2, "cause": {"id": "hot_trip", "params": {}}}
LONG = {"cause": {"id": "operator_pause", "params": {}}, "utc": "2026-11-28T08:00:00Z", "unix_s": 1.0, "mono_s": 1.0}


@pytest.fixture(name="journal")
def _journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("LC_ALL", raising=False)
    monkeypatch.delenv("LC_MESSAGES", raising=False)
    monkeypatch.setenv("LANG", "ko_KR.UTF-8")
    (tmp_path / "sessions").mkdir()
    pause = {**LONG, "offset_min": 540, "boot": "b", "lasted_s": 4000.0}
    rule = {"id": "x", "key": "", "place": "", "s": 4000.0, "ah": 1.0}
    whole = {**end(1, 9, 10.0), "faults": [FAULT], "pauses": [pause], "rules": [rule]}
    records = [whole, begin(2), checkpoint(2, 1, 5.0)]
    (tmp_path / "sessions" / "2026-11.jsonl").write_bytes(b"".join(map(encoded, records)))
    return tmp_path


@pytest.mark.parametrize("words", ["sessions", "sessions show 1", "battery", "battery B-1", "report"])
def test_no_word_is_english(words: str, journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if words.startswith("sessions show"):
        words = f"sessions show {end(1, 9)['id']}"
    assert main([*words.split(), "--journal", str(journal)]) == 0
    said = capsys.readouterr().out
    assert re.search("[가-힣]", said)
    assert re.findall(r"[A-Za-z_]{2,}|\b(?:h|d|s)\b", SAME.sub("", said)) == []
