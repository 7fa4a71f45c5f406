"""Closing parts that may hang: in parallel, within one time limit."""

import time
from threading import Event

from orchestrator.service.closing import close_all


def test_what_hangs_costs_the_others_nothing_and_has_an_end() -> None:
    never, closed = Event(), list[int]()
    began_s = time.monotonic()
    assert not close_all([never.wait, never.wait, lambda: closed.append(1), lambda: closed.append(2)], 0.3)
    assert 0.3 <= time.monotonic() - began_s < 1
    assert sorted(closed) == [1, 2]
    never.set()


def test_what_does_not_hang_costs_no_time() -> None:
    began_s = time.monotonic()
    assert close_all([lambda: None] * 50, 5.0)
    assert time.monotonic() - began_s < 1
