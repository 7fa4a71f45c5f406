"""The demo's pack in a charge by the rules of li-ion-48v: about a minute, with every stage visible."""

import pytest

from orchestrator.model import ChargeMode, Precharge
from orchestrator.sim.bay import SimulatedBay
from orchestrator.sim.charger import Push, SimulatedCharger
from orchestrator.sim.presets import demo

#: What the policy and the core do: pulse to 35.1 V, continuous to 39.0 V, each for 2 s more; step 4 until 90 %, then 2.
PULSE_V, PRECHARGE_V, DWELL_S = 35.1, 39.0, 2.0
TICK_S = 0.1


class Charge:
    """One charge and its observations."""

    def __init__(self) -> None:
        self.bay = SimulatedBay(SimulatedCharger(), demo())
        self.t_s = 0.0
        self.top_v = self.top_c = 0.0
        self.worst_apart_v = self.worst_jump_pct = 0.0
        self.bay.charger.push(Push.CURRENT_LIMIT, 0)
        self.bay.charger.push(Push.CHARGE_MODE, ChargeMode.PRECHARGE)
        self.bay.charger.push(Push.PRECHARGE, Precharge.PULSE)
        self.bay.charger.push(Push.OPERATION, 1)

    def until_v(self, volts: float) -> float:
        """Run until the pack has had this voltage for the dwell; returns how long it took."""
        began_s, reached_s = self.t_s, 0.0
        while reached_s < DWELL_S:
            self.tick()
            reached_s = reached_s + TICK_S if self.bay.pack.voltage_v >= volts else 0.0
        return self.t_s - began_s

    def until_soc(self, pct: float) -> float:
        began_s = self.t_s
        while round(self.bay.readout().soc_pct) < pct:
            self.tick()
        return self.t_s - began_s

    def tick(self) -> None:
        bay, soc = self.bay, self.bay.pack.soc
        bay.advance(TICK_S)
        self.t_s += TICK_S
        self.top_v = max(self.top_v, bay.charger.voltage_v, bay.pack.voltage_v)
        self.top_c = max(self.top_c, bay.pack.temperature_c)
        self.worst_apart_v = max(self.worst_apart_v, abs(bay.charger.voltage_v - bay.pack.voltage_v))
        self.worst_jump_pct = max(self.worst_jump_pct, (bay.pack.soc - soc) * 100 / TICK_S)
        assert self.t_s < 120


def test_a_whole_charge_takes_a_minute_and_shows_every_stage() -> None:
    charge = Charge()
    charger = charge.bay.charger
    assert charge.bay.pack.voltage_v == pytest.approx(33.0, abs=0.1)
    assert 6 <= charge.until_v(PULSE_V) <= 9
    charger.push(Push.PRECHARGE, Precharge.CONTINUOUS)
    assert 5.5 <= charge.until_v(PRECHARGE_V) <= 9
    charger.push(Push.CHARGE_MODE, ChargeMode.CHARGE)
    charger.push(Push.CURRENT_LIMIT, 4)
    assert 30 <= charge.until_soc(90) <= 40
    charger.push(Push.CURRENT_LIMIT, 2)
    assert 6 <= charge.until_soc(100) <= 15
    assert not charger.full, "the policy ends it, before the charger does"
    assert 50 <= charge.t_s <= 65


def test_nothing_in_it_looks_like_a_fault() -> None:
    charge = Charge()
    charge.until_v(PULSE_V)
    charge.bay.charger.push(Push.PRECHARGE, Precharge.CONTINUOUS)
    charge.until_v(PRECHARGE_V)
    charge.bay.charger.push(Push.CHARGE_MODE, ChargeMode.CHARGE)
    charge.bay.charger.push(Push.CURRENT_LIMIT, 4)
    charge.until_soc(100)
    assert charge.top_v <= 54.6 + 1e-9
    assert charge.top_c < 22, "less than 1 K/min over 3 min"
    assert charge.worst_apart_v < 0.5
    assert charge.worst_jump_pct < 3, "in a second; SOC is read once a second, 5 % would be a jump"
