"""Decides whether a BMU is watched closely: its bay asks for it, or current flows into the pack, whatever the cause."""

from orchestrator.devices.read_plan import ReadPlan
from orchestrator.model import Measurement

#: More than a resting pack shows: the offset and resolution of its current measurement.
FLOWS_A = 0.5


class Attention:
    """Follows the bay's request and the pack's current. Until the bay says otherwise, the BMU is watched closely."""

    __slots__ = ("_plan", "wanted")

    def __init__(self, plan: ReadPlan) -> None:
        self.wanted = True  #: set from any thread
        self._plan = plan

    def follow(self, amps: Measurement | None) -> None:
        """Read the fast objects every sweep, or rarely."""
        closely = self.wanted or (amps is not None and amps.value > FLOWS_A)
        if closely != self._plan.closely:
            self._plan.watch(closely=closely)
