"""How long an intermittent condition has held: the time drains while it is false, it is not reset.

A condition that is true most of the time counts as true. If one clean sample reset its time, a charger and a BMU that
disagree for 2.75 s of every 3 s would never be found out.
"""

#: Time in which a condition is false takes off this share of itself.
DRAIN = 0.25


def drained(seconds: float, passed_s: float, *, holds: bool) -> float:
    """`seconds` after `passed_s` more, in which the condition held or did not."""
    return seconds + passed_s if holds else max(0.0, seconds - DRAIN * passed_s)
