"""Which battery is in a bay, with the real command line: told by its BMU, or typed by an operator."""

import pytest

from orchestrator.sim.client import PlantProcess
from tests.waiting import wait_until
from tests.whole.recipe import Station, only_started
from tests.whole.station import Service

WITHIN_S = 15.0
#: Below where the policy of these tests starts to charge a battery, above where it charges a full one again.
WAKES_AT_PCT = 96.0


def identity(service: Service) -> tuple[str, str]:
    told = service.status("bay-1")["bay-1"]["identity"]
    return told["id"], told["source"]


@pytest.mark.station(plant_args=("--serial", "4711"), ready=only_started)
def test_a_bmu_that_tells_its_serial_number(station: Station) -> None:
    _, service = station
    wait_until(lambda: identity(service) == ("4711", "serial_number"), WITHIN_S, "the serial number")
    answer = service.cli("identify", "bay-1", "--battery", "4711")
    assert (answer.returncode, answer.stdout) == (0, "bay-1: battery 4711, its serial number\n")
    answer = service.cli("identify", "bay-1", "--battery", "B-0042")
    assert answer.returncode == 0
    assert answer.stdout == (
        "bay-1: battery 4711, its serial number, although an operator typed B-0042: look which battery it is, "
        "then identify it again\n"
    )
    assert "bay-1: battery 4711, its serial number\n" in service.log()


def test_a_bmu_that_tells_none(station: Station) -> None:
    _, service = station
    assert identity(service) == ("can0:0x10", "assumed")
    answer = service.cli("identify", "bay-1", "--battery", "B-0042")
    assert (answer.returncode, answer.stdout) == (0, "bay-1: battery B-0042, typed by an operator\n")
    service.kill_all()
    service.start()
    wait_until(lambda: identity(service) == ("B-0042", "typed"), WITHIN_S, "what was typed")
    for bay, battery, why in (
        ("bay-1", "B\n42", "is no id of a battery"), ("bay-9", "B-0042", "no bay 'bay-9' here"),
    ):  # fmt: skip
        refused = service.cli("identify", bay, "--battery", battery)
        assert refused.returncode == 1
        assert why in refused.stderr
    assert identity(service) == ("B-0042", "typed")


def until_full(plant: PlantProcess, service: Service) -> None:
    service.start().wait("FULL", timeout_s=60)


@pytest.mark.station(plant_args=("--pack", "demo", "--soc", "93", "--speed", "4"), ready=until_full)
def test_a_full_pack_whose_bmu_sleeps_is_not_charged_again(station: Station) -> None:
    """Its BMU wakes at a SOC at which another battery would be charged."""
    plant, service = station
    for _ in range(3):
        soc_pct = service.status("bay-1")["bay-1"]["battery"]["soc_pct"]
        plant.inject("battery_exchanged", value=WAKES_AT_PCT - soc_pct)
        service.wait("OFFLINE")
        service.wait("FULL")
        plant.inject("soc_jump", value=0.0)
    wait_until(lambda: service.path_of("bay-1").count("FULL") == 4, what="the journal")
    assert service.path_of("bay-1")[-7:] == ["FULL", *["OFFLINE", "FULL"] * 3]
