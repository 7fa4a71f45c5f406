"""The share of failed exchanges on a line, over a minute."""

from orchestrator.devices.line_quality import LEAST, LineQuality

POLL_S = 0.2


def poll(quality: LineQuality, begin_s: float, seconds: float, *, every: int = 0) -> float:
    """Poll for that long, every `every`th poll failing; returns the end time."""
    for number in range(1, round(seconds / POLL_S) + 1):
        quality.count(begin_s + number * POLL_S, bad=bool(every) and number % every == 0)
    return begin_s + seconds


def test_a_good_line_has_nothing() -> None:
    quality = LineQuality()
    assert quality.bad_pct == 0.0
    poll(quality, 0.0, 120.0)
    assert quality.bad_pct == 0.0


def test_one_in_ten_is_ten_percent_and_is_forgotten_after_a_minute() -> None:
    quality = LineQuality()
    now_s = poll(quality, 0.0, 120.0, every=10)
    assert abs(quality.bad_pct - 10.0) < 0.5
    now_s = poll(quality, now_s, 30.0)
    assert abs(quality.bad_pct - 5.0) < 0.5
    poll(quality, now_s, 31.0)
    assert quality.bad_pct == 0.0


def test_a_few_exchanges_say_nothing() -> None:
    quality = LineQuality()
    for number in range(LEAST - 1):
        quality.count(number * POLL_S, bad=True)
    assert quality.bad_pct == 0.0
    quality.count(LEAST * POLL_S, bad=True)
    assert quality.bad_pct == 100.0
