"""A station whose language is Korean: what goes wrong, and what is asked in vain, is said in Korean everywhere."""

import json
import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from orchestrator.service.journal_files import files_of, lines_of
from orchestrator.show import own_language
from tests.waiting import wait_until
from tests.whole.station import Document, whole_station

#: What happens in each bay, and the id of a cause that its status then has.
HAPPENS = (("port_gone", "port_missing"), ("bmu_silent", "bmu_unreachable"), ("sdo_abort", "sdo_abort"))
#: A word as a sentence has it; three in a row are English.
ENGLISH = re.compile(r"(?:(?<![\w./-])[A-Za-z]?[a-z]+[,;:]? ){2}[a-z]+(?![\w./-])")
#: What stands in a command or a path is the same in every language.
SAME = ("orchestrator start bay", "orchestrator reset bay")


def korean(document: Document) -> None:
    document["language"] = "ko"


def english(value: Any) -> Iterator[str]:
    """The English sentences in a document; in the parameters of a cause are data."""
    if isinstance(value, dict):
        for name, one in value.items():
            yield from english(one) if name not in ("params", "config") else ()
    elif isinstance(value, list):
        yield from (found for one in value for found in english(one))
    elif isinstance(value, str) and (found := ENGLISH.search(value)) and not found[0].startswith(SAME):
        yield value


def causes(value: Any) -> Iterator[str]:
    """The ids of all causes in a document."""
    if isinstance(value, dict):
        if isinstance(value.get("id"), str) and "params" in value:
            yield value["id"]
        yield from (found for one in value.values() for found in causes(one))
    elif isinstance(value, list):
        yield from (found for one in value for found in causes(one))


def test_a_korean_station_says_nothing_in_english(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LC_ALL", "LC_MESSAGES"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("LANG", "ko_KR.UTF-8")
    assert own_language() == "ko"
    with whole_station(tmp_path, len(HAPPENS) + 1, change=korean) as (plant, service):
        service.start().wait("CHARGING", [f"bay-{bay + 1}" for bay in range(len(HAPPENS) + 1)], timeout_s=60)
        for bay, (fault, _) in enumerate(HAPPENS, 1):
            plant.inject(fault, bay)
        for bay, (_, id_) in enumerate(HAPPENS, 1):
            wait_until(lambda name=f"bay-{bay}", id_=id_: id_ in causes(service.bay(name)), 20, id_)  # type: ignore[misc]
        journal = service.directory / "run" / "journal"
        (journal / "persisted.json.new").symlink_to("/dev/full")
        said = [service.cli("stop", "bay-4"), service.cli("start", "bay-4"), service.cli("reset", "bay-3")]
        said += [service.cli("start", "bay-9"), service.cli("reset", "--port", "/dev/none"), service.cli("status")]
        assert [done.returncode for done in said] == [1, 1, 1, 1, 1, 0]
        assert list(english([text for done in said for text in (done.stdout, done.stderr)])) == []
        document = json.loads(service.cli("status", "--json").stdout)
        assert document["persisted"]["cause"]["params"]["problem"]["id"] == "disk_failed"
        assert list(english(document)) == []
        service.signal(signal.SIGHUP)
        service.signal(signal.SIGTERM)
        assert service.ended() == 1
        assert list(english(service.log().splitlines())) == []
        lines = [json.loads(text or b"") for path in files_of([journal]) for _, text in lines_of(path)]
        assert {"transition", "fault", "snapshot"} <= {line["kind"] for line in lines}
        assert list(english(lines)) == []


def test_an_english_sentence_would_be_found() -> None:
    assert list(english({"text": ["포트: no such port here"]})) == ["포트: no such port here"]
    assert (
        list(english({"params": {"error": "no such port here"}, "text": "계속하려면: orchestrator start bay-1"})) == []
    )
