"""Names that people type on a command line and see in every log line."""

import re

_NAME = re.compile(r"\w[\w.-]{0,63}")


def name_problem(name: str) -> str:
    """Why this is not a valid name; "" if it is."""
    if _NAME.fullmatch(name):
        return ""
    meant = re.sub(r"[^\w.]+", "-", name).strip("-.")[:64]
    return f"{name[:80]!r} cannot be typed on a command line: use letters, digits, '-', '_' and '.', at most 64" + (
        f", e.g. {meant}" if meant else ""
    )
