"""A wall-clock time as a record has it, for people and programs."""

from datetime import UTC, datetime


def utc(unix_s: float) -> str:
    """RFC 3339, to the millisecond; "" for a time that no calendar has."""
    try:
        return datetime.fromtimestamp(unix_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    except (OverflowError, OSError, ValueError):
        return ""


def month(unix_s: float) -> str:
    """The month in UTC: "2026-11"; "" for a time that no calendar has."""
    return utc(unix_s)[:7]


def unix_s(text: str) -> float:
    """The inverse of `utc`; a time without a zone is local. ValueError for anything else."""
    return datetime.fromisoformat(text).timestamp()
