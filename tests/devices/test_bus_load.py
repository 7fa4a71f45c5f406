"""Whether a bus is fast enough for its BMUs, reported before it costs a charge."""

from dataclasses import replace

import pytest

from orchestrator.devices.bus_load import slow_buses
from orchestrator.keys import Source
from orchestrator.model import ControlMode
from tests.proof.virtual_service import station


@pytest.mark.parametrize(
    ("bays", "bitrate", "slow"),
    [(1, 250_000, False), (32, 250_000, False), (64, 250_000, True), (64, 1_000_000, False), (64, None, False)],
)
def test_a_bus_on_which_values_come_too_seldom_is_named(bays: int, bitrate: int | None, *, slow: bool) -> None:
    settings = {"interface": "virtual"} | ({"bitrate": bitrate} if bitrate else {})
    the_station = replace(
        station([ControlMode.MANUAL] * bays), can={"can0": settings}, source=Source("s.yaml", {"can.can0": 3})
    )
    said = list(slow_buses(the_station))
    assert len(said) == slow
    for line in said:
        assert line.startswith(f"s.yaml:3: warning: {bays} BMUs on 250 kbit/s: ")
        assert "or more buses" in line
