"""The instant that a person means by a time of day, here and now. Pure, but for the time zone of the machine."""

import re
from collections.abc import Iterator
from datetime import datetime, timedelta
from time import localtime, strftime

from orchestrator.errors import RequestError
from orchestrator.model import Cause
from orchestrator.record.stamp import NEVER_SET_S

#: Nobody plans a charge further ahead.
MOST_DAYS = 366
TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d{2})")


def instant(text: object, now_s: float) -> tuple[float, Cause | None]:
    """Its Unix time, and which instant that is where daylight saving leaves a doubt.

    "22:00" is the next time that the clock here shows it; else a date and a time, with an offset from UTC or without.
    RequestError for anything else, for what is past, and for what is too far ahead.
    """
    shown = f"{text!s:.40}"
    if now_s < NEVER_SET_S:
        raise RequestError(Cause("clock_never_set"))
    try:
        found = min((one for one in _meant(shown, now_s) if one[0] > now_s), default=None, key=lambda one: one[0])
    except (ValueError, OverflowError, OSError):
        raise RequestError(Cause.of("at_wrong", text=shown)) from None
    if found is None:
        raise RequestError(Cause.of("at_past", text=shown))
    if found[0] > now_s + MOST_DAYS * 86400:
        raise RequestError(Cause.of("at_too_far", text=shown, days=MOST_DAYS))
    return found


def _meant(text: str, now_s: float) -> Iterator[tuple[float, Cause | None]]:
    """Each instant that can be meant; ValueError if it is no time."""
    if (clock := TIME_OF_DAY.fullmatch(text)) is not None:
        today = datetime.fromtimestamp(now_s).replace(  # noqa: DTZ006 - the time here, which a person types
            hour=int(clock[1]), minute=int(clock[2]), second=0, microsecond=0
        )
        yield from _instants(today)
        yield from _instants(today + timedelta(days=1))
        return
    then = datetime.fromisoformat(text)
    if ":" not in text:
        raise ValueError("a date without a time")
    if then.tzinfo is not None:
        yield then.timestamp(), None
    else:
        yield from _instants(then)


def _instants(here: datetime) -> Iterator[tuple[float, Cause | None]]:
    """One instant; two where the clock is set back over this time; the next one where it is set forward over it."""
    first_s, second_s = (here.replace(fold=fold).timestamp() for fold in (0, 1))
    if first_s == second_s:
        yield first_s, None
    elif first_s < second_s:
        yield first_s, Cause.of("at_twice", offset=_offset(first_s))
        yield second_s, Cause.of("at_twice", offset=_offset(second_s))
    else:
        yield first_s, Cause.of("at_skipped", typed_at=here.strftime("%H:%M"))


def _offset(unix_s: float) -> str:
    return strftime("UTC%z", localtime(unix_s))
