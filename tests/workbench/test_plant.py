"""The physics are right, however coarse the time steps."""

import pytest

from orchestrator.config.scenario import Cell, Visit
from orchestrator.model import ChargeMode
from orchestrator.sim.charger import Push
from orchestrator.workbench.simulate.plant import Plant, pack_of
from tests.workbench.scenarios import battery, scenario


def charging(soc_pct: float = 30.0, **changes: float) -> Plant:
    """A plant with its charger on the highest step."""
    plant = Plant(scenario(batteries={"pack-1": battery(**changes)}))
    plant.arrive(Visit(battery="pack-1", from_h=0, soc_pct=soc_pct))
    plant.charger.push(Push.CURRENT_LIMIT, 4)
    plant.charger.push(Push.CHARGE_MODE, ChargeMode.CHARGE)
    plant.charger.push(Push.OPERATION, 1)
    plant.advance(1.0)
    return plant


@pytest.mark.parametrize("hours", [0.2, 0.45])
def test_the_size_of_the_pieces_does_not_show(hours: float) -> None:
    """At constant current, and deep in the taper, where it falls by a third in a minute."""
    coarse, fine = charging(), charging()
    for _ in range(round(hours * 60)):
        coarse.advance(60)
    for _ in range(round(hours * 3600 / 0.25)):
        fine.advance(0.25)
    assert coarse.pack is not None
    assert fine.pack is not None
    assert coarse.pack.soc == pytest.approx(fine.pack.soc, abs=2e-5)
    assert coarse.charger.current_a == pytest.approx(fine.charger.current_a, rel=2e-3)
    assert coarse.pack.temperature_c == pytest.approx(fine.pack.temperature_c, abs=2e-3)
    assert coarse.charged_wh == pytest.approx(fine.charged_wh, rel=1e-3)


def test_the_constant_voltage_is_never_exceeded() -> None:
    plant = charging(80.0)
    while not plant.charger.full:
        plant.advance(30)
        assert plant.charger.voltage_v <= plant.charger.cv_v + 1e-9


def test_what_flows_is_what_the_pack_gets() -> None:
    plant = charging()
    assert plant.pack is not None
    before_ah = plant.pack.charge_ah - plant.charged_ah
    plant.advance(1200)
    assert plant.pack.charge_ah - before_ah == pytest.approx(plant.charged_ah)


def test_an_aged_pack_holds_less_and_resists_more() -> None:
    new, aged = pack_of(battery()), pack_of(battery(soh_pct=80))
    assert aged.usable_ah == pytest.approx(0.8 * new.usable_ah)
    assert aged.resistance_ohm == pytest.approx(2 * new.resistance_ohm)
    assert aged.polarisation_ohm == pytest.approx(2 * new.polarisation_ohm)


def test_the_cells_are_those_of_the_scenario() -> None:
    packs = [pack_of(battery(cells=cells)) for cells in (Cell.NMC, Cell.LFP)]
    for pack in packs:
        pack.set_soc(50)
    assert [round(pack.ocv_v / 13, 2) for pack in packs] == [3.70, 3.29]


def test_a_copy_goes_its_own_way() -> None:
    plant = charging()
    twin = plant.copy()
    twin.advance(600)
    assert plant.pack is not None
    assert twin.pack is not None
    assert twin.pack.soc > plant.pack.soc
    assert twin.charged_ah > plant.charged_ah
    assert twin.t_s == plant.t_s + 600
