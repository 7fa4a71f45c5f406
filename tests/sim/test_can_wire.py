"""A failing bus is left alone for a while and then served again; the wire neither spins nor dies."""

import os

import can
import pytest

from orchestrator.sim.background import Background
from orchestrator.sim.can_wire import CanWire
from tests.waiting import wait_until


class FailingBus(can.BusABC):
    """Every other receive fails, as on a bus going down and up; always readable."""

    def __init__(self, *, has_fd: bool) -> None:
        super().__init__(channel="failing")
        self.calls = 0
        self.refuses = False
        self._ends = os.pipe() if has_fd else None
        if self._ends:
            os.write(self._ends[1], b"x")

    def fileno(self) -> int:
        if self._ends is None:
            raise NotImplementedError
        return self._ends[0]

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self.calls += 1
        if self.calls % 2:
            raise can.CanOperationError("down")
        return can.Message(arbitration_id=0x123, data=b"hi", is_extended_id=False)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("down")


@pytest.mark.parametrize("has_fd", [True, False])
def test_a_failing_bus_is_served_on(has_fd: bool) -> None:
    bus = FailingBus(has_fd=has_fd)
    heard: list[bytes] = []
    with Background() as background:
        wire = background.call(lambda: CanWire(background.loop, bus))
        background.call(lambda: wire.subscribe(0x123, "test", lambda _, data: heard.append(data)))
        wait_until(lambda: len(heard) >= 2)
        background.call(lambda: wire.send(0x123, b"lost"))
        background.call(wire.close)
        assert set(heard) == {b"hi"}
        if has_fd:
            assert bus.calls < 50, "it is not read again at once for ever"
    bus.shutdown()
