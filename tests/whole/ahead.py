"""Stations that are made ready while the tests before theirs run: most of a test would be waiting for its charge."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
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
#: As many stations are made ready beside the one under test: more of them would slow each other down.
AHEAD = 1
#: Where more programs than this wait for each processor, a station is begun when its test begins.
BUSY = 2.5


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


@dataclass(frozen=True)
class Made:
    """A station, and what takes it down."""

    station: Station
    stack: ExitStack


class Ahead:
    """The stations of a module's tests, by the tests' names, in their order."""

    def __init__(self, recipes: Mapping[str, Recipe], directory: Callable[[], Path], pool: ThreadPoolExecutor) -> None:
        self._recipes, self._directory, self._pool = recipes, directory, pool
        self._names = list(recipes)
        self._begun: dict[str, Future[Made]] = {}

    @contextmanager
    def take(self, name: str) -> Iterator[Station]:
        """The station of this test; those of the next ones are begun."""
        at, was_ahead = self._names.index(name), name in self._begun
        self._begin(name)
        for near in self._names[at + 1 : at + 1 + AHEAD]:
            self.begin(near)
        if was_ahead and self._is_lost(name):
            del self._begun[name]
            self._begin(name)
        made = self._begun[name].result()
        with made.stack:
            if self._recipes[name].ready is charge:
                until_all_charge(*made.station)
            yield made.station

    def begin(self, name: str) -> None:
        """Begin with this test's station, if the machine has time for it."""
        if os.getloadavg()[0] < BUSY * len(os.sched_getaffinity(0)):
            self._begin(name)

    def _begin(self, name: str) -> None:
        if name not in self._begun:
            self._begun[name] = self._pool.submit(self._make, self._recipes[name], self._directory())

    def _is_lost(self, name: str) -> bool:
        """Whether a busy machine has starved it before it was its test's turn."""
        begun = self._begun[name]
        if isinstance(begun.exception(), AssertionError | ServiceError):
            return True
        made = begun.result()
        if made.station[1].has_ended:
            made.stack.close()
        return made.station[1].has_ended

    def close(self) -> None:
        """Take down those that no test has taken."""
        for one in self._begun.values():
            if not one.cancel() and one.exception() is None:
                one.result().stack.close()

    @staticmethod
    def _make(recipe: Recipe, directory: Path) -> Made:
        with ExitStack() as stack:
            plant, service = stack.enter_context(
                whole_station(directory, recipe.bays, *recipe.plant_args, change=recipe.change, run=recipe.run)
            )
            recipe.ready(plant, service)
            return Made((plant, service), stack.pop_all())


@contextmanager
def stations_ahead(recipes: Mapping[str, Recipe], directory: Callable[[], Path]) -> Iterator[Ahead]:
    """The threads live as long as the stations: the kernel kills a process when the thread that started it ends."""
    with ThreadPoolExecutor(1 + AHEAD) as pool:
        ahead = Ahead(recipes, directory, pool)
        try:
            yield ahead
        finally:
            ahead.close()
