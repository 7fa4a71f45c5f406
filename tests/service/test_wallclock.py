"""What the core says in seconds of the monotonic clock, told as the time of day."""

from collections.abc import Iterator
from time import tzset

import pytest

from orchestrator.model import Cause
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import say

#: 2026-03-01 21:02:14 in Seoul, 100 s after this machine was switched on.
CLOCK = WallClock(now_s=100.0, wall_s=1_772_366_534.0)


@pytest.fixture(autouse=True)
def seoul(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "Asia/Seoul")
    tzset()
    yield
    monkeypatch.undo()
    tzset()


@pytest.mark.parametrize(
    ("t_s", "coming", "told"),
    [
        (100.0, False, "21:02:14"), (40.0, False, "21:01:14"), (100.0 - 22 * 3600, False, "2026-02-28 23:02"),
        (114.0, True, "21:02:28"), (220.0, True, "21:04:14"), (221.0, True, "21:05"), (3700.0, True, "22:03"),
        (3686.0, True, "22:02"), (100.0 + 4 * 3600, True, "2026-03-02 01:03"),
    ],
)  # fmt: skip
def test_the_time_of_day_with_the_day_where_it_is_another_one(t_s: float, *, coming: bool, told: str) -> None:
    assert CLOCK.time_of_day(t_s, coming=coming) == told


def test_every_moment_is_told_however_deep() -> None:
    locked = Cause.of("reset_locked", until_t_s=3700.0, times=3)
    cause = Cause.of(
        "x", key="k", place="p:1", advice="a", raised_t_s=100, whats=(Cause.of("y", then=locked), 3), n=None
    )
    told = CLOCK.told(cause)
    assert told == Cause.of(
        "x", key="k", place="p:1", advice="a", raised_at="21:02:14",
        whats=(Cause.of("y", then=Cause.of("reset_locked", until_at="22:03", times=3)), 3), n=None,
    )  # fmt: skip
    assert CLOCK.told(told) == told
    assert CLOCK.told(None) is None


def test_what_is_no_time_stays() -> None:
    for value in (float("nan"), float("inf"), "soon", None):
        cause = Cause.of("x", until_t_s=value)
        told = CLOCK.told(cause)
        assert told is not None
        assert [name for name, _ in told.params] == ["until_t_s"]


def test_without_a_clock_a_moment_is_told_in_seconds() -> None:
    gone = Cause.of("start_now", gone=Cause.of("gone", gone_t_s=3723.4), bay="bay-1")
    assert say(gone) == "gone since 3723 s: orchestrator start bay-1"
    assert say(CLOCK.told(gone)) == "gone since 22:02:37: orchestrator start bay-1"
