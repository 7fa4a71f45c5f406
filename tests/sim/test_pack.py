"""The battery's model conserves charge, energy and heat, and has plausible numbers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.model import BatteryStatus
from orchestrator.sim.chemistry import LFP, NMC, Chemistry, interpolate
from orchestrator.sim.pack import Pack


@pytest.mark.parametrize(("chemistry", "empty_v"), [(NMC, 3.0), (LFP, 2.5)])
def test_the_curves_ascend_and_meet_at_empty(chemistry: Chemistry, empty_v: float) -> None:
    for curve in (chemistry.ocv, chemistry.deep):
        assert list(curve) == sorted(curve)
        assert [volts for _, volts in curve] == sorted(volts for _, volts in curve)
    assert chemistry.ocv[0] == (0.0, empty_v)
    assert chemistry.deep[-1] == (0.0, empty_v)


@pytest.mark.parametrize(("x", "y"), [(-1, 10), (0, 10), (1, 15), (2, 20), (3, 0), (9, 0)])
def test_interpolation_is_straight_between_points_and_flat_beyond(x: float, y: float) -> None:
    assert interpolate(((0, 10), (2, 20), (3, 0)), x) == y


@given(low=st.floats(-100, 105), high=st.floats(-100, 105))
def test_more_charge_is_never_less_voltage(low: float, high: float) -> None:
    a, b = Pack(), Pack()
    a.set_soc(min(low, high))
    b.set_soc(max(low, high))
    assert a.ocv_v <= b.ocv_v + 1e-9


@pytest.mark.parametrize(("pct", "volts"), [(-100, 33.02), (0, 39.0), (50, 48.1), (100, 54.47)])
def test_a_13s_pack_has_the_voltages_of_one(pct: float, volts: float) -> None:
    pack = Pack()
    pack.set_soc(pct)
    assert pack.ocv_v == pytest.approx(volts)


@given(amps=st.floats(-14, 14), seconds=st.floats(0.01, 3600), parts=st.integers(1, 20))
def test_charge_is_current_times_time_however_it_is_cut(amps: float, seconds: float, parts: int) -> None:
    pack = Pack()
    pack.set_soc(40)
    before_ah = pack.charge_ah
    for _ in range(parts):
        pack.advance(seconds / parts, amps)
    assert pack.charge_ah - before_ah == pytest.approx(amps * seconds / 3600)


@given(amps=st.floats(-14, 14), seconds=st.floats(1, 600))
def test_energy_in_is_energy_stored_plus_heat(amps: float, seconds: float) -> None:
    pack = Pack(cooling_w_per_k=1e-9)
    pack.set_soc(40)
    dt_s, into_j, stored_j = seconds / 200, 0.0, 0.0
    for _ in range(200):
        before_v = pack.ocv_v
        pack.advance(dt_s, amps)
        middle_v = (before_v + pack.ocv_v) / 2
        stored_j += middle_v * amps * dt_s
        into_j += (middle_v + amps * pack.resistance_ohm) * amps * dt_s
    heat_j = (pack.temperature_c - 20) * pack.heat_j_per_k
    assert into_j == pytest.approx(stored_j + heat_j, abs=0.05, rel=1e-3)


def test_polarisation_comes_and_goes_with_its_time_constant() -> None:
    pack = Pack(capacity_ah=1e6, polarisation_ohm=0.02, polarisation_s=60)
    pack.set_soc(50)
    pack.advance(60, 10)
    assert pack.voltage_v == pytest.approx(48.1 + 10 * 0.05 + 0.2 * (1 - 1 / 2.71828), abs=1e-3)
    pack.advance(600, 10)
    assert pack.voltage_v == pytest.approx(48.1 + 10 * 0.05 + 0.2, abs=1e-3)
    pack.advance(60, 0)
    assert pack.voltage_v == pytest.approx(48.1 + 0.2 / 2.71828, abs=1e-3)


def test_polarisation_is_as_much_charged_however_it_is_cut() -> None:
    whole, cut = (Pack(polarisation_ohm=0.02) for _ in range(2))
    whole.advance(90, 10)
    for _ in range(9):
        cut.advance(10, 10)
    assert whole.voltage_v == pytest.approx(cut.voltage_v)


@pytest.mark.parametrize(("celsius", "times"), [(25, 1.0), (0, 1.846), (45, 0.656)])
def test_resistance_grows_in_the_cold(celsius: float, times: float) -> None:
    pack = Pack(temperature_c=celsius, arrhenius_k=2000)
    assert pack.series_ohm == pytest.approx(0.05 * times, abs=1e-4)
    assert Pack(temperature_c=celsius).series_ohm == 0.05


def test_warming_is_the_same_however_it_is_cut() -> None:
    """As it warms, its resistance and so its heating fall: by 0.07 K in these five minutes."""
    whole, cut = (Pack(temperature_c=0, ambient_c=0, arrhenius_k=4000) for _ in range(2))
    whole.advance(300, 14)
    for _ in range(300):
        cut.advance(1, 14)
    assert whole.temperature_c == pytest.approx(cut.temperature_c, abs=0.005)


def test_a_warm_pack_cools_towards_its_surroundings() -> None:
    pack = Pack(temperature_c=40)
    pack.advance(pack.heat_j_per_k / pack.cooling_w_per_k, 0)
    assert pack.temperature_c == pytest.approx(20 + 20 / 2.718, abs=0.01)


def test_a_driven_temperature_goes_there_and_stays_until_it_is_back() -> None:
    pack = Pack(driven_c=48.0)
    pack.advance(1, 0)
    assert pack.temperature_c == 23
    pack.advance(60, 14)
    assert pack.temperature_c == 48
    pack.driven_c = pack.ambient_c
    pack.advance(60, 0)
    pack.advance(1, 0)
    assert pack.temperature_c == 20
    assert not pack.driven_c


def test_what_is_told_of_it_fits_together() -> None:
    pack = Pack(capacity_ah=20, soh_pct=90)
    pack.set_soc(50)
    pack.advance(0, 9)
    told = pack.readout()
    assert (told.soc_pct, told.soh_pct, told.remaining_ah) == (50, 90, 9)
    assert (told.time_to_full_min, told.time_to_empty_min) == (60, None)
    assert told.voltage_v == pytest.approx(48.1 + 9 * 0.05)
    assert told.available_wh == pytest.approx(9 * 48.1)
    pack.advance(0, -9)
    assert (pack.readout().time_to_full_min, pack.readout().time_to_empty_min) == (None, 60)
    pack.advance(0, 0)
    assert (pack.readout().time_to_full_min, pack.readout().time_to_empty_min) == (None, None)


def test_the_deep_discharge_is_told_as_empty() -> None:
    pack = Pack()
    pack.set_soc(-80)
    assert (pack.readout().soc_pct, pack.readout().remaining_ah) == (0, 0)


@pytest.mark.parametrize(
    ("soc", "celsius", "status"),
    [
        (50, 20, 0),
        (104, 20, 1 << BatteryStatus.OVER_VOLTAGE),
        (-90, 20, 1 << BatteryStatus.LOW_VOLTAGE),
        (50, 61, 1 << BatteryStatus.HIGH_TEMPERATURE),
        (-90, -21, 1 << BatteryStatus.LOW_TEMPERATURE | 1 << BatteryStatus.LOW_VOLTAGE),
    ],
)
def test_status_bits(soc: float, celsius: float, status: int) -> None:
    pack = Pack(temperature_c=celsius)
    pack.set_soc(soc)
    assert pack.readout().status == status


def test_a_leaky_pack_does_not_rise() -> None:
    pack = Pack(leaky=True)
    pack.set_soc(-50)
    before_v = pack.ocv_v
    pack.advance(600, 1)
    assert pack.ocv_v == before_v
