"""`orchestrator sessions show ID --html`: one charge as a web page that needs nothing else."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.record.curve import HEAD, member
from orchestrator.record.lines import encoded
from orchestrator.record.picture import MOST, svg
from orchestrator.record.points import Point, points_of
from tests.record.made import begin, end, id_of

ROWS = (
    "0.0,CHARGING,5,20,97,48,14,20,48.5,14,0\r\n"
    "10.0,CHARGING,5,21,97,49,14,,48.6,14,0.1\r\n"
    "20.0,SUSPENDED,,21,97,48,0,21,48.6,0,0.1\r\n"
    "30.0,CHARGING,5,22,97,49,14,22,48.7,14,0.2\r\n"
)
#: What a page would load from elsewhere.
OUTSIDE = re.compile(r"https?:|src=|href=|@import|url\(")


@pytest.fixture(name="journal")
def _journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A journal with one charge, its curve, and an event in its middle."""
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    (tmp_path / "sessions" / "curves").mkdir(parents=True)
    rule = {"id": "x", "key": "current.<b>", "place": "p.yaml:3", "s": 60.0, "ah": 0.2}
    records = [begin(1), {**end(1, 1, 0.2), "rules": [rule]}]
    (tmp_path / "sessions" / "2026-11.jsonl").write_bytes(b"".join(map(encoded, records)))
    curve = tmp_path / "sessions" / "curves" / f"{id_of(1)}.csv.gz"
    curve.write_bytes(member(HEAD + ROWS) + b"\x1f\x8b torn")
    stop = {"id": "stopped_by", "params": {"who": "kim"}}
    lines = (
        {"t": at_s, "wall": f"2026-11-28T{time}:00.000Z", "bay": bay, "kind": "request", "request": "stop",
         "by": "kim", "reason": "", "cause": stop, "accepted": True}
        for at_s, time, bay in (
            (0, "06:59", "bay-1"), (1, "07:01", "bay-1"), (2, "07:02", "bay-2"), (3, "07:11", "bay-1"),
        )
    )  # fmt: skip
    (tmp_path / "events.jsonl").write_text("".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines))
    return tmp_path


def page(journal: Path) -> str:
    file = journal / "charge.html"
    assert main(["sessions", "show", id_of(1)[-4:], "--html", str(file), "--journal", str(journal)]) == 0
    return file.read_text(encoding="utf-8")


def test_it_has_the_curve_the_rules_and_the_events(journal: Path) -> None:
    shown = page(journal)
    assert shown.count("<polyline") == 7  # the battery's temperature was not known for a moment
    assert "current.&lt;b&gt; (p.yaml:3)" in shown
    assert re.findall(r"<td>(2026-11-28 \S+)</td>", shown) == ["2026-11-28 16:01:00"]
    assert '<meta name="viewport"' in shown
    assert not OUTSIDE.search(shown)


def test_what_is_opened_is_closed(journal: Path) -> None:
    class Balanced(HTMLParser):
        def __init__(self) -> None:
            super().__init__()
            self.open: list[str] = []

        def handle_starttag(self, tag: str, attrs: object) -> None:
            self.open += [] if tag in ("meta", "line", "rect", "polyline") else [tag]

        def handle_endtag(self, tag: str) -> None:
            if tag not in ("line", "rect", "polyline"):
                assert self.open.pop() == tag

    parser = Balanced()
    parser.feed(page(journal))
    assert parser.open == []


def test_it_is_korean_for_koreans(journal: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LC_ALL", "ko_KR.UTF-8")
    shown = page(journal)
    assert '<html lang="ko">' in shown
    assert "온도(°C)" in shown


def test_without_curve_and_journal_it_is_a_page_all_the_same(journal: Path) -> None:
    (journal / "events.jsonl").unlink()
    (journal / "sessions" / "curves" / f"{id_of(1)}.csv.gz").unlink()
    shown = page(journal)
    assert "<svg" not in shown
    assert "Events" not in shown
    assert "battery B-1, typed by an operator" in shown


def test_a_damaged_record_is_said(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    damaged = {**end(2, 0), "rules": [7]}
    (journal / "sessions" / "2026-11.jsonl").write_bytes(encoded(damaged))
    assert main(["sessions", "show", id_of(2), "--journal", str(journal)]) == 1
    assert f"the record of charge {id_of(2)} is damaged" in capsys.readouterr().err


@pytest.mark.parametrize(
    "data", [b"", b"\x1f\x8b", b"no gzip", member("x,y\r\n1,2\r\n"), member(HEAD + "nan,a,b\r\nq\r\n")]
)
def test_a_curve_that_is_none_has_no_points(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "curves").mkdir()
    (tmp_path / "curves" / "X.csv.gz").write_bytes(data)
    assert points_of(tmp_path, "X") == []
    assert svg(points_of(tmp_path, "X"), "en") == ""


def test_a_long_curve_is_drawn_with_its_peaks() -> None:
    points = [Point(float(at), "CHARGING", {"soc_pct": 99.0 if at == 7777 else 50.0}) for at in range(20_000)]
    drawn = svg(points, "en")
    assert "99.0" in drawn
    (line,) = re.findall('<polyline points="([^"]*)"', drawn)
    assert len(line.split()) <= MOST
    assert len({place.split(",")[1] for place in line.split()}) == 2
