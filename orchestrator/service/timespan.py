"""The times that a person names on a command line: `2h`, `7d`, a date, a local time."""

import re

from orchestrator.errors import UsageError
from orchestrator.record.utc import unix_s, utc

#: What a time ago is counted in.
AGO_S = {"min": 60.0, "h": 3600.0, "d": 86_400.0}


def moment(option: str, text: str, now_s: float) -> str:
    """The time as the journal writes it; "" for "". A date and time without a zone is local. `now_s` is Unix time."""
    if not text:
        return ""
    if (ago := re.fullmatch(r"(\d{1,6})\s*(min|h|d)", text)) is not None:
        return utc(max(now_s - int(ago[1]) * AGO_S[ago[2]], 0.0))
    try:
        return utc(unix_s(text))
    except (ValueError, OverflowError, OSError):
        raise UsageError(f"{option} {text}: expected 90min, 2h, 7d, 2026-11-28 or 2026-11-28T06:00") from None
