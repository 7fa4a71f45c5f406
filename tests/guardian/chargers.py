"""Emulated chargers on ptys for the stop of last resort: each runs until stopped."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from orchestrator.model import ChargeMode, Operation
from orchestrator.sim.background import Background
from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.charger_wire import ChargerWire
from orchestrator.sim.line import LINES
from tests.sim.wires import Port


class Bench:
    """One running charger, its port's name, and an open descriptor of it, like a guardian's."""

    def __init__(self, background: Background, link: Path, line: str) -> None:
        self._background = background
        self.charger = SimulatedCharger(voltage_v=50.0, current_a=14.0, mode=ChargeMode.CHARGE, run=True)
        self.wire = ChargerWire(background.loop, self.charger, line=LINES[line], link=link)
        self.name = str(link)
        self.fd = -1
        self.plug()

    def plug(self) -> None:
        """Plug the adapter in and open it."""
        self._background.call(self.wire.open)
        self.fd = Port(self.wire.path).fd

    def unplug(self) -> None:
        self._background.call(self.wire.close)

    @property
    def runs(self) -> bool:
        return self.charger.operation is Operation.RUNNING

    @property
    def stops(self) -> int:
        """Stop frames it understood."""
        return self.wire.counters.stops

    def duplicate(self) -> int:
        return os.dup(self.fd)


@contextmanager
def running_chargers(directory: Path, count: int = 1, line: str = "real") -> Iterator[list[Bench]]:
    with Background() as background:
        benches = [Bench(background, directory / f"charger-{number}", line) for number in range(1, count + 1)]
        assert all(bench.runs for bench in benches)
        try:
            yield benches
        finally:
            for bench in benches:
                bench.unplug()
                os.close(bench.fd)
