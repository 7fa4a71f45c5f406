"""The physics of a scenario: a charger, and the battery that is in the bay. Pure: time is an argument.

The charger and the pack are those of the emulators. What is special here is that hours pass in a few hundred pieces: a
piece is as long as the current allows, and where the constant voltage lets it fall, the current of its middle counts
(the midpoint method), so that the size of the pieces does not show in the result.
"""

from copy import copy
from itertools import pairwise

from orchestrator.config.scenario import BatteryModel, Cell, Scenario, Visit
from orchestrator.sim.charger import Charger
from orchestrator.sim.chemistry import LFP, NMC, Chemistry
from orchestrator.sim.pack import Pack

CHEMISTRIES: dict[Cell, Chemistry] = {Cell.NMC: NMC, Cell.LFP: LFP}
#: The longest piece: with a constant current, and while the constant voltage limits it.
STEADY_S, TAPERING_S = 10.0, 2.0
#: From here on the constant voltage may come to limit the current within a piece.
NEARLY_TAPERING = 1.5


def pack_of(model: BatteryModel) -> Pack:
    """The battery as the scenario describes it; its resistance is that of its age."""
    aged = 1 + model.ageing_per_pct * (100 - model.soh_pct)
    return Pack(
        chemistry=CHEMISTRIES[model.cells],
        cells=model.cells_in_series,
        capacity_ah=model.capacity_ah,
        soh_pct=model.soh_pct,
        deep_ah=model.deep_ah,
        resistance_ohm=model.resistance_ohm * aged,
        arrhenius_k=model.arrhenius_k,
        polarisation_ohm=model.polarisation_ohm * aged,
        polarisation_s=model.polarisation_s,
        heat_j_per_k=model.heat_j_per_k,
        cooling_w_per_k=model.cooling_w_per_k,
    )


class Plant:
    """`advance` lets time pass; batteries come and go by `arrive` and `leave`."""

    def __init__(self, scenario: Scenario) -> None:
        model = scenario.charger
        self.charger = Charger(
            steps_a=model.steps_a,
            cv_v=model.cv_v,
            precharge_a=model.precharge_a,
            cutoff_a=model.cutoff_a,
            lead_ohm=model.lead_ohm,
        )
        self.pack: Pack | None = None
        self.t_s = 0.0
        self.charged_ah = 0.0  #: into all batteries so far
        self.charged_wh = 0.0
        self._weather = [(row.at_h * 3600, row.ambient_c) for row in scenario.weather]
        self._packs = {name: pack_of(model) for name, model in scenario.batteries.items()}

    def copy(self) -> "Plant":
        """Another plant in the same state; batteries that are not in the bay are shared."""
        twin = copy(self)
        twin.charger = copy(self.charger)
        twin.pack = copy(self.pack)
        return twin

    @property
    def ambient_c(self) -> float:
        """The temperature around the bay, now."""
        weather = self._weather
        for (from_s, from_c), (to_s, to_c) in pairwise(weather):
            if self.t_s < to_s:
                return from_c + (to_c - from_c) * (self.t_s - from_s) / (to_s - from_s)
        return weather[-1][1]

    def arrive(self, visit: Visit) -> None:
        """Somebody puts a battery in."""
        pack = self._packs[visit.battery]
        pack.ambient_c = self.ambient_c
        pack.temperature_c = pack.ambient_c if visit.temperature_c is None else visit.temperature_c
        pack.polarisation_v = pack.current_a = 0.0
        if visit.soc_pct is not None:
            pack.set_soc(visit.soc_pct)
        elif visit.used_pct is not None:
            pack.set_soc(max(pack.soc * 100 - visit.used_pct, 0.0))
        self.pack = pack

    def leave(self, visit: Visit) -> None:
        """Somebody takes the battery out; it keeps its charge until it comes back."""
        if self.pack is not None:
            self._packs[visit.battery] = self.pack
        self.pack = None

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass."""
        while dt_s > 0:
            piece_s = min(dt_s, self._piece_s())
            self._pass(piece_s)
            dt_s -= piece_s

    def _piece_s(self) -> float:
        charger, pack = self.charger, self.pack
        demand_a = charger.demand_a
        tapers = pack is not None and demand_a > 0 and charger.room_a(pack) < demand_a * NEARLY_TAPERING
        return TAPERING_S if tapers else STEADY_S

    def _pass(self, dt_s: float) -> None:
        charger, pack = self.charger, self.pack
        self.t_s += dt_s
        if pack is None:
            charger.advance(dt_s, None)
            return
        pack.ambient_c = self.ambient_c
        current_a = self._middle_a(dt_s, charger, pack)
        before_v = pack.ocv_v
        pack.advance(dt_s, current_a)
        charger.advance(dt_s, pack)
        pack.current_a = charger.current_a  # charger and BMU are measured on one cable
        ah = current_a * dt_s / 3600
        self.charged_ah += ah
        self.charged_wh += ah * ((before_v + pack.ocv_v) / 2 + current_a * pack.series_ohm)

    def _middle_a(self, dt_s: float, charger: Charger, pack: Pack) -> float:
        """The current in the middle of the piece."""
        if charger.current_a == charger.demand_a and charger.room_a(pack) > charger.demand_a * NEARLY_TAPERING:
            return charger.current_a
        before = pack.charge_ah, pack.polarisation_v, pack.temperature_c
        pack.advance(dt_s / 2, charger.current_a)
        middle_a = charger.output_a(dt_s / 2, pack)
        pack.charge_ah, pack.polarisation_v, pack.temperature_c = before
        return middle_a
