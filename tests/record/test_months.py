"""Which files the records are in, and which have been kept long enough, whatever the clock says."""

import pytest

from orchestrator.record.months import current, finished, newest, outdated

#: 2026-11-28.
NOW_S = 1_795_845_600.0
YEAR_S = 365.25 * 86_400


@pytest.mark.parametrize(
    ("unix_s", "names", "expected"),
    [
        (NOW_S, [], "2026-11.jsonl"),
        (NOW_S, ["2026-10.jsonl"], "2026-11.jsonl"),
        (NOW_S, ["2026-12.jsonl"], "2026-11.jsonl"),
        (5.0, ["2026-10.jsonl", "2026-11.jsonl", "curves"], "2026-11.jsonl"),  # a clock that was never set
        (5.0, ["2026-10.jsonl.gz"], "2026-10.jsonl"),
        (5.0, [], "1970-01.jsonl"),
        (1e18, ["2026-11.jsonl"], "2026-11.jsonl"),  # a year that no calendar has
        (1e18, [], "1970-01.jsonl"),
    ],
)
def test_the_file_is_that_of_the_month(unix_s: float, names: list[str], expected: str) -> None:
    assert current(unix_s, names) == expected


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["2026-09.jsonl", "2026-10.jsonl", "2026-11.jsonl"], ["2026-10.jsonl", "2026-11.jsonl"]),
        (["2026-11.jsonl"], ["2026-11.jsonl"]),
        (
            ["2026-09.jsonl.gz", "2026-10.jsonl", "2026-10.jsonl.gz"],
            ["2026-09.jsonl.gz", "2026-10.jsonl", "2026-10.jsonl.gz"],
        ),
        ([], []),
        (
            ["2026-09.jsonl", "2026-10.jsonl", "2026-11.jsonl", "2031-01.jsonl"],
            ["2026-09.jsonl", "2026-10.jsonl", "2026-11.jsonl", "2031-01.jsonl"],  # the clock has gone back
        ),
    ],
)
def test_the_newest_two_are_read_or_all_if_the_clock_has_gone_back(names: list[str], expected: list[str]) -> None:
    assert newest(NOW_S, names) == expected


MONTHS = [f"{year}-{month:02}.jsonl" for year in range(2020, 2027) for month in range(1, 13)][:-1]  # … 2026-11


@pytest.mark.parametrize(
    ("unix_s", "names", "expected"),
    [
        (NOW_S, MONTHS, [name for name in MONTHS if name < "2021-11"]),
        (NOW_S, MONTHS[-61:], []),
        (NOW_S + 3 * YEAR_S, [*MONTHS[-61:], "2029-11.jsonl"], ["2021-11.jsonl"]),  # a jump costs a month at most
        (5.0, MONTHS, []),
        (NOW_S, ["1999-01.jsonl"], []),  # the only one
        (NOW_S, [*MONTHS[-2:], "notes.txt", "2001-01.jsonl.bak"], []),
    ],
)
def test_whole_months_go_after_five_years(unix_s: float, names: list[str], expected: list[str]) -> None:
    assert outdated(unix_s, names, 5.0) == expected


def test_months_that_are_over_are_compressed() -> None:
    names = ["2026-08.jsonl", "2026-08.jsonl.gz", "2026-09.jsonl", "2026-10.jsonl", "2026-11.jsonl"]
    assert finished(names) == ["2026-09.jsonl"]  # what was added to August when the clock was wrong stays beside it
    assert finished(names[-2:]) == []
