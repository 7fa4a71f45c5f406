"""Honest devices with their flaws: a late and coarse BMU, a charger that pulses and tapers, a poor line."""

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import pytest

from orchestrator.config.load import load_policy
from orchestrator.config.station import BayConfig
from orchestrator.model import ControlMode, Measurement, State
from orchestrator.sim.chemistry import LFP
from orchestrator.sim.pack import Pack, Readout
from tests.core.site import BMU_SILENT_S, FAST, SLOW, TICK_S, Site
from tests.core.world import bay

#: The resolution of a coarse BMU's values.
COARSE = {"voltage_v": 0.1, "current_a": 0.1, "soc_pct": 1.0, "temperature_c": 1.0}
LATE = ("voltage_v", "current_a")


class LateSite(Site):
    """Its BMU reports what was true `late_s` ago, in coarse figures."""

    def __init__(self, pack: Pack, the_bay: BayConfig, late_s: float, loss: float = 0.0) -> None:
        super().__init__(pack, the_bay, loss=loss)
        self.late_s = late_s
        self.past: deque[tuple[float, Readout]] = deque()

    def _bus(self) -> None:
        truth = self.plant.readout()
        self.past.append((self.now_s, truth))
        while len(self.past) > 1 and self.past[1][0] <= self.now_s - self.late_s:
            self.past.popleft()
        slow = round(self.now_s / TICK_S) % 10 == 0
        heard = {name: self._heard(name, self.past[0][1] if name in LATE else truth)
                 for name in (FAST + SLOW if slow else FAST)}  # fmt: skip
        self.values = replace(self.values, **heard)
        status = self.values.status
        self.battery_link = replace(
            self.battery_link, online=status is not None and self.now_s - status.t_s < BMU_SILENT_S
        )

    def _heard(self, name: str, readout: Readout) -> Measurement:
        value, unit = float(getattr(readout, name)), COARSE.get(name)
        return Measurement(round(value / unit) * unit if unit else value, self.now_s)


def small(**changes: float) -> Pack:
    """A pack that is full within minutes without getting warm."""
    return replace(Pack(capacity_ah=1.0, deep_ah=0.05, heat_j_per_k=60000.0), **changes)  # type: ignore[arg-type]  # its fields by name


def nmc() -> LateSite:
    return LateSite(small(), bay(), 0.0)


def aged() -> LateSite:
    return LateSite(small(polarisation_ohm=0.05, soh_pct=85.0), bay(), 0.0)


def automatic() -> LateSite:
    return LateSite(small(), bay(control=ControlMode.AUTOMATIC), 0.0)


def lfp() -> LateSite:
    policy = load_policy("lfp-48v")
    site = LateSite(replace(small(), chemistry=LFP, cells=policy.pack.cells_in_series), bay(policy), 0.0)
    site.charger.cv_v = policy.pack.voltage_v.high - 0.6
    return site


def long_life() -> LateSite:
    return LateSite(small(), bay(load_policy("long-life-48v")), 0.0)


@pytest.mark.parametrize("late_s", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("begin", [nmc, aged, automatic, lfp, long_life], ids=lambda begin: begin.__name__)
def test_a_whole_charge_without_a_fault(begin: Callable[[], LateSite], late_s: float) -> None:
    site = begin()
    site.late_s = late_s
    site.pack.set_soc(20)
    site.until(State.FULL, 900)
    assert site.raised == {}


@pytest.mark.parametrize("pulse_a", [1.0, 2.0])
@pytest.mark.parametrize("late_s", [0.1, 0.3, 0.5, 0.7, 1.0])
def test_pulses_that_the_bmu_tells_late_are_no_disagreement(late_s: float, pulse_a: float) -> None:
    """Half a second late, the two disagree half of the time."""
    site = LateSite(small(deep_ah=0.2), bay(), late_s)
    site.charger.precharge_a = pulse_a
    site.pack.set_soc(-100)
    site.until(State.PRECHARGE_CONTINUOUS, 600)
    assert site.raised == {}


def test_pulses_that_the_bmu_does_not_see_are_one() -> None:
    site = LateSite(small(deep_ah=0.2), bay(), 0.5)
    site.charger.precharge_a = 2.0
    site.pack.set_soc(-100)
    site.plant.falsify["current_a"] = lambda _amps: 0.0
    site.until(State.STOPPING, 30)
    assert "pairing_not_proved" in site.raised


def test_a_lossy_line_and_a_step_that_goes_up_and_down() -> None:
    site = LateSite(replace(small(), capacity_ah=20.0), bay(), 1.0, loss=0.05)
    site.pack.temperature_c = site.pack.ambient_c = 11.0
    site.pack.set_soc(30)
    site.until(State.CHARGING, 30)
    for celsius in (9.0, 11.0, 9.0, 11.0):
        site.pack.driven_c = celsius
        site.run(75)
    assert not {"above_step", "limit_reverted", "over_current", "pairing_not_proved"} & set(site.raised)
    assert site.decision.state is State.CHARGING
