"""Moments, to the millisecond."""

from math import floor

#: In milliseconds: products of floats may lie this much below a whole number, after thirty years without a reboot.
_EPSILON = 1e-4


def moment(t_s: float) -> float:
    """The millisecond that `t_s` is in, rounded down: an age between two of them is wrong by less than one.

    What decisions are made from is recorded exactly, and the digits beyond milliseconds are noise that nobody needs but
    every journal would have to keep: they cannot be compressed.
    """
    return floor(t_s * 1000 + _EPSILON) / 1000
