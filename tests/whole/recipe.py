"""What the whole station of a test is like when it begins."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from orchestrator.errors import ServiceError
from orchestrator.sim.client import PlantProcess
from tests.waiting import wait_until
from tests.whole.station import LOOK_S, RUN, Document, Service, whole_station

Station = tuple[PlantProcess, Service]
#: A charge begins within this, even if a very busy machine has interrupted it and its backoff has to pass.
CHARGE_S = 60.0
#: A guardian whose controller is gone has stopped the chargers, verified, and ended within this.
END_S = 10.0


def unchanged(document: Document) -> None:
    """The station file as it is."""


def charge(plant: PlantProcess, service: Service) -> None:
    """Started, with all bays charging and their currents up."""
    service.start()
    until_all_charge(plant, service)


def until_all_charge(plant: PlantProcess, service: Service) -> None:
    """Wait for the charges, or look whether they are still going on."""
    bays = [(number, f"bay-{number}") for number in range(1, len(plant.bays) + 1)]

    def charging() -> bool:
        shown = service.status()
        return all(shown[name]["state"] == "CHARGING" and plant.state(bay)["current_a"] > 13 for bay, name in bays)

    wait_until(charging, CHARGE_S, "a charge in every bay", LOOK_S)


def only_started(plant: PlantProcess, service: Service) -> None:
    """Started, with no bay charging yet."""
    service.start()


def only_the_plant(plant: PlantProcess, service: Service) -> None:
    """Started by the test itself."""


@dataclass(frozen=True)
class Recipe:
    """What a station is like when its test begins."""

    bays: int = 1
    plant_args: tuple[str, ...] = ()
    change: Callable[[Document], None] = unchanged
    run: Sequence[str] = RUN
    ready: Callable[[PlantProcess, Service], None] = charge


def ends(service: Service) -> bool:
    """Whether it is at its end: its guardian may still be verifying the stops."""
    try:
        wait_until(lambda: service.has_ended, END_S, "the end")
    except AssertionError:
        return False
    return True


@contextmanager
def made(recipe: Recipe, directory: Path) -> Iterator[Station]:
    """The station, ready for its test; made anew if a busy machine has starved its service before that."""
    with ExitStack() as stack:
        for own in (directory / "first", directory / "again"):
            own.mkdir()
            station = stack.enter_context(
                whole_station(own, recipe.bays, *recipe.plant_args, change=recipe.change, run=recipe.run)
            )
            try:
                recipe.ready(*station)
                break
            except (AssertionError, ServiceError):
                if own.name == "again" or not ends(station[1]):
                    raise
                stack.close()
        yield station
