"""The running service charges a deeply discharged pack to full, over every kind of serial line."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from orchestrator.sim.client import PlantProcess
from orchestrator.sim.line import LINES
from tests.waiting import wait_until
from tests.whole.station import Service, whole_station

#: Faults a bad line may raise, and rightly an 8 % jump of SOC in a second; all others would be false alarms.
ALLOWED = {"noisy_line", "soc_jump"}


@pytest.fixture(name="stations", scope="module")
def _stations(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, tuple[PlantProcess, Service]]]:
    """One station per line, all charging at once; their packs run four times as fast as real ones."""
    with ExitStack() as stack:
        stations = {
            line: stack.enter_context(
                whole_station(tmp_path_factory.mktemp(line), 1, "--pack", "demo", "--line", line, "--speed", "4")
            )
            for line in LINES
        }
        for _, service in stations.values():
            service.start()
        yield stations


@pytest.mark.parametrize("line", LINES)
def test_a_charge_from_the_first_pulse_to_full(stations: dict[str, tuple[PlantProcess, Service]], line: str) -> None:
    plant, service = stations[line]
    service.wait("FULL", timeout_s=60)
    truth = plant.state()
    assert truth["soc_pct"] > 95
    assert (truth["operation"], truth["current_a"]) == (0, 0)
    wait_until(lambda: "FULL" in service.path_of("bay-1"), what="the journal")
    assert service.path_of("bay-1")[-6:] == [
        "QUALIFYING",
        "PRECHARGE_PULSE",
        "PRECHARGE_CONTINUOUS",
        "CHARGING",
        "STOPPING",
        "FULL",
    ]
    assert {fault["id"] for fault in service.journal("bay-1", "fault")} <= ALLOWED
    begin, end = service.journal("bay-1", "session")
    assert (begin["event"], end["event"]) == ("begin", "end")
    assert end["result"].startswith("full: ")
    assert end["step_changes"] >= 2


@pytest.mark.parametrize("line", ["perfect"])
def test_every_step_names_the_rule_that_bound_it(stations: dict[str, tuple[PlantProcess, Service]], line: str) -> None:
    _, service = stations[line]
    service.wait("FULL", timeout_s=60)
    wait_until(lambda: "FULL" in service.path_of("bay-1"), what="the journal")
    rules = [line["step"]["rule"] for line in service.journal("bay-1", "decision") if line["step"]]
    assert rules[0] == "precharge is always on the lowest step"
    bound = [rule for rule in rules if rule.startswith("SOC")]
    assert len(bound) == 2
    assert all("policy.yaml:2" in rule for rule in bound)
