"""Which bays a command line means."""

from json import dumps

import pytest

from orchestrator.lastresort.signing import MOST_BECAUSE
from orchestrator.service.chosen import Chosen, choose, is_plain, unknown
from orchestrator.service.client import MAX_REQUEST, parse_request
from orchestrator.service.request_verb import _parts
from orchestrator.text.catalogue import say

KNOWN = ("bay-01", "bay-02", "bay-10", "east[1]", "east1")


@pytest.mark.parametrize(
    ("words", "excepted", "bays", "missing"),
    [
        (None, [], KNOWN, ()),
        (["bay-02", "bay-01", "bay-02"], [], ("bay-01", "bay-02"), ()),
        (["bay-0*"], [], ("bay-01", "bay-02"), ()),
        (["bay-?0", "bay-01"], [], ("bay-01", "bay-10"), ()),
        (["bay-[!0]*"], [], ("bay-10",), ()),
        (["east[1]"], [], ("east[1]",), ()),
        (["east[12]"], [], ("east1",), ()),
        (["BAY-01"], [], (), ("BAY-01",)),
        (["bay-1*", "x*", "bay-9", "x*"], [], ("bay-10",), ("x*", "bay-9")),
        (None, ["bay-*"], ("east[1]", "east1"), ()),
        (["*"], ["east1", "bay-10"], ("bay-01", "bay-02", "east[1]"), ()),
        (None, ["bay-9", "east*"], ("bay-01", "bay-02", "bay-10"), ("bay-9",)),
        (["bay-01"], ["bay-01"], (), ()),
    ],
)
def test_names_and_patterns(
    words: list[str] | None, excepted: list[str], bays: tuple[str, ...], missing: tuple[str, ...]
) -> None:
    assert choose(words, excepted, KNOWN) == Chosen(bays, missing)


def test_a_name_alone_needs_no_list() -> None:
    assert is_plain(["bay-1", "베이.2", "x_y"])
    assert not any(is_plain(["bay-1", word]) for word in ("bay*", "b?y", "bay-[1]"))


def test_what_is_unknown_is_told_with_what_there_is() -> None:
    assert say(unknown(["x*"], ["a", "b"])) == "no bay 'x*' here: a, b"
    assert say(unknown(["x*", "c"], ["a", "b"])) == "no bays 'x*', 'c' here: a, b"
    assert say(unknown(["x*", "c"], ["a", "b"]), "ko") == "'x*', 'c' 베이가 없습니다: a, b"


def test_however_many_bays_are_named_each_request_is_one_that_the_service_takes() -> None:
    names = [f"{'베이' * 30}-{number}" for number in range(128)]
    base = {"verb": "stop", "because": "비" * MOST_BECAUSE}
    parts = list(_parts(names, base))
    assert [name for part in parts for name in part] == names
    assert len(parts) > 1
    for part in parts:
        line = dumps({**base, "bays": part}).encode() + b"\n"
        assert len(line) <= MAX_REQUEST and parse_request(line)["bays"] == part
    assert list(_parts(["bay-1", "bay-2"], {"verb": "stop"})) == [["bay-1", "bay-2"]]
