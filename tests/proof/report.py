"""What the long forms print."""

import sys


def say(text: object) -> None:
    """A line, at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()
