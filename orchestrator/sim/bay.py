"""The physics of one bay: a charger and a pack on one pair of cables. Pure: time is an argument."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.pack import Pack, Readout

#: Model time advances in steps of at most this, so that pulses and the constant-voltage phase are modelled correctly.
MAX_STEP_S = 0.1


@dataclass(slots=True)
class SimulatedBay:
    """A charger and a pack; `falsify` changes what the BMU reports, by field of the readout."""

    charger: SimulatedCharger
    pack: Pack
    connected: bool = True  #: the battery is in the bay
    falsify: dict[str, Callable[[float], float]] = field(default_factory=dict)

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass for both."""
        while dt_s > 0:
            step_s = min(dt_s, MAX_STEP_S)
            self.pack.advance(step_s, self.charger.current_a)
            self.charger.advance(step_s, self.pack if self.connected else None)
            # The pack sees the new current at once: charger and BMU measure the same cable.
            self.pack.current_a = self.charger.current_a
            dt_s -= step_s

    def readout(self) -> Readout:
        """What the BMU reports, falsified or not."""
        truth = self.pack.readout()
        if not self.falsify:
            return truth
        lies: dict[str, Any] = {name: change(getattr(truth, name)) for name, change in self.falsify.items()}
        return replace(truth, **lies)
