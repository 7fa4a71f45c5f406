"""How long a condition has held, when it comes and goes: the time drains while it is away, it is not reset.

A condition that is there most of the time is there. If one clean sample reset its time, a charger and a BMU that
disagree for 2.75 s of every 3 s would never be found out.
"""

#: Time that a condition is away takes off this share of itself.
DRAIN = 0.25


def drained(seconds: float, passed_s: float, *, holds: bool) -> float:
    """`seconds` after `passed_s` more, in which the condition held or did not."""
    return seconds + passed_s if holds else max(0.0, seconds - DRAIN * passed_s)
