"""The running service next to others on its bus: a BMU with a main loop, a second master, a forger."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import can
import pytest
from durand.scheduler import get_scheduler, set_scheduler  # type: ignore[import-untyped]  # it has no annotations

from orchestrator.sim.background import Background
from orchestrator.sim.can_wire import CanWire
from orchestrator.sim.client import PlantProcess
from orchestrator.sim.forger import Forger, Lie, When
from orchestrator.sim.second_master import SecondMaster
from tests.waiting import wait_until
from tests.whole.recipe import Station, only_the_plant
from tests.whole.station import Document, Service

#: Faults that only report somebody else's presence.
SAID = {"other_master", "heartbeat_set", "soc_jump"}
NODE_ID = 0x10


@contextmanager
def stranger(document: Document, make: Callable[[Any, CanWire], Any]) -> Iterator[Any]:
    """Another party on the station's bus, in this process."""
    before = get_scheduler()
    keys = document["can"]["can0"]
    with can.Bus(**keys) as bus, Background() as background:
        wire, party = background.call(lambda: _made(background, bus, make))
        try:
            yield party
        finally:
            background.call(party.close)
            background.call(wire.close)
            set_scheduler(before)


def _made(background: Background, bus: can.BusABC, make: Callable[[Any, CanWire], Any]) -> tuple[CanWire, Any]:
    wire = CanWire(background.loop, bus)
    return wire, make(background.loop, wire)


def reads_everything(loop: Any, wire: CanWire) -> SecondMaster:
    master = SecondMaster(loop, wire, NODE_ID)
    master.keep_reading()
    return master


@pytest.mark.station(plant_args=("--pack", "demo", "--speed", "4", "--bmu", "mainloop"), ready=only_the_plant)
def test_a_whole_charge_beside_a_master_that_reads_everything(station: Station) -> None:
    plant, service = station
    document = json.loads(service.file.read_text(encoding="utf-8"))
    with stranger(document, reads_everything) as master:
        service.start()
        service.wait("FULL", timeout_s=60)
        assert plant.state()["soc_pct"] > 95
        assert master.seen.values > 100
        assert master.seen.aborts > 0  # it does not wait for the end of its own longer transfers
        wait_until(lambda: len(service.journal("bay-1", "session")) == 2, what="the session's end in the journal")
    assert {fault["id"] for fault in service.journal("bay-1", "fault")} <= SAID
    assert [event["event"] for event in service.journal("bay-1", "session")] == ["begin", "end"]


def until_it_charges(plant: PlantProcess, service: Service) -> None:
    service.start().wait("CHARGING", timeout_s=30)


@pytest.mark.station(plant_args=("--pack", "demo", "--soc", "30", "--bmu", "mainloop"), ready=until_it_charges)
def test_a_forged_temperature_stops_the_charge(station: Station) -> None:
    plant, service = station
    document = json.loads(service.file.read_text(encoding="utf-8"))
    with stranger(document, lambda loop, wire: Forger(loop, wire, NODE_ID, Lie(when=When.AFTER, word=310))):
        service.wait({"SUSPENDED", "TRIPPED"}, timeout_s=5)
        assert plant.state()["operation"] == 0
    faults = {fault["id"]: fault for fault in service.journal("bay-1", "fault")}
    assert "two answers to one request" in faults["temperature_invalid"]["text"]
