"""The physics of a scenario: a charger, and the battery in the bay. Pure: time is an argument.

Charger and pack are those of the emulators. Here, however, hours pass in a few hundred pieces: a piece is as long as
the current allows, and at constant voltage, where the current falls, its value in the middle of the piece counts (the
midpoint method), so that the size of the pieces does not affect the result.
"""

from copy import copy

from orchestrator.config.scenario import BatteryModel, Cell, Scenario, Visit
from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.chemistry import LFP, NMC, Chemistry, interpolate
from orchestrator.sim.pack import Pack

CHEMISTRIES: dict[Cell, Chemistry] = {Cell.NMC: NMC, Cell.LFP: LFP}
#: The longest piece: at constant current, and at constant voltage.
STEADY_S, TAPERING_S = 10.0, 4.0
#: Below this ratio of possible to demanded current, the constant voltage may begin to limit it within a piece.
NEARLY_TAPERING = 1.5


def pack_of(model: BatteryModel) -> Pack:
    """The battery described in the scenario, with its resistance increased by ageing."""
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
        self.charger = SimulatedCharger(
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
        self._weather = tuple((row.at_h * 3600, row.ambient_c) for row in scenario.weather)
        self._packs = {name: pack_of(model) for name, model in scenario.batteries.items()}

    def copy(self) -> "Plant":
        """An independent copy in the same state; batteries outside the bay are shared."""
        twin = copy(self)
        twin.charger = copy(self.charger)
        twin.pack = copy(self.pack)
        return twin

    @property
    def ambient_c(self) -> float:
        """The present ambient temperature."""
        return self._ambient_c(self.t_s)

    def _ambient_c(self, t_s: float) -> float:
        return interpolate(self._weather, t_s)

    def arrive(self, visit: Visit) -> None:
        """A battery is inserted."""
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
        """The battery is removed; it keeps its charge until it comes back."""
        if self.pack is not None:
            self._packs[visit.battery] = self.pack
        self.pack = None

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` pass."""
        while dt_s > 0:
            tapers = self.pack is not None and self._tapers(self.charger, self.pack)
            piece_s = min(dt_s, TAPERING_S if tapers else STEADY_S)
            self.t_s += piece_s
            if self.pack is None:
                self.charger.advance(piece_s, None)
            else:
                self._charge(piece_s, self.charger, self.pack, midpoint=tapers)
            dt_s -= piece_s

    def _tapers(self, charger: SimulatedCharger, pack: Pack) -> bool:
        demand_a = charger.demand_a
        return demand_a > 0 and charger.room_a(pack) < demand_a * NEARLY_TAPERING

    def _charge(self, dt_s: float, charger: SimulatedCharger, pack: Pack, *, midpoint: bool) -> None:
        pack.ambient_c = self._ambient_c(self.t_s - dt_s / 2)
        current_a = self._middle_a(dt_s / 2, charger, pack) if midpoint else charger.current_a
        pack.advance(dt_s, current_a)
        charger.advance(dt_s, pack)
        pack.current_a = charger.current_a  # charger and BMU measure the same cable
        ah = current_a * dt_s / 3600
        self.charged_ah += ah
        self.charged_wh += ah * charger.voltage_v

    def _middle_a(self, half_s: float, charger: SimulatedCharger, pack: Pack) -> float:
        """The current in the middle of a piece; the pack is restored afterwards."""
        before = pack.charge_ah, pack.polarisation_v, pack.temperature_c
        pack.advance(half_s, charger.current_a)
        middle_a = charger.output_a(half_s, charger.demand_a, charger.room_a(pack))
        pack.charge_ah, pack.polarisation_v, pack.temperature_c = before
        return middle_a
