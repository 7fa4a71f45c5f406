"""Explores every situation that a bay can reach, on all cores: every property must hold, and every charge must end."""

import gc
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from orchestrator.config.load import load_policy, load_station
from orchestrator.config.policy import Policy
from orchestrator.config.station import BatteryConfig, BayConfig, ChargerConfig, Limits, Station
from orchestrator.core.rules import Rules
from orchestrator.errors import ConfigError
from orchestrator.model import ControlMode
from orchestrator.protocol.objects import ObjectMap
from orchestrator.workbench.processes import cores
from orchestrator.workbench.prove.endings import ENDINGS
from orchestrator.workbench.prove.explore import Each, Explorer, Walk
from orchestrator.workbench.prove.inputs import StationInputs
from orchestrator.workbench.prove.lasting import reaches, settles
from orchestrator.workbench.prove.properties import PROPERTIES
from orchestrator.workbench.prove.story import Counterexample

T = TypeVar("T")

#: The steps of a charger for a policy without a station: those of the shipped station files.
STEPS_A = (2.0, 5.0, 8.0, 11.0, 14.0)


@dataclass(frozen=True, slots=True)
class Proof:
    """The result of a proof."""

    memories: int  #: situations that differ in what a bay can reach from them
    steps: int  #: decisions that led there; those of the search for endings are not counted
    counterexamples: Sequence[Counterexample]  #: at most one per property
    properties: int = len(PROPERTIES) + len(ENDINGS) + 2  #: and: no exception, no livelock


def prove(rules: Rules, watch: Callable[[str], None], jobs: int | None = None) -> Proof:
    """Try every class of inputs cut by the bay's policy and limits, in every order.

    `jobs` is the number of processes; None: one per core. `watch` is called regularly with what has been done so far.
    """
    with cores(jobs, _begin, rules) as pool:
        explorer = Explorer(walk_of(rules), partial(_on, pool), watch)
        explorer.run()
        reaches(explorer)
        settles(explorer)
    return Proof(len(explorer.nodes), explorer.steps, tuple(explorer.found.values()))


def walk_of(rules: Rules) -> Walk:
    """A walk with all inputs and all properties."""
    return Walk(rules, StationInputs.of(rules), PROPERTIES)


def here(walk: Walk) -> Each:
    """An `Each` that runs in this process, with this walk."""

    def each(function: Callable[..., T], jobs: deque[Any]) -> Iterator[T]:
        while jobs:
            yield function(walk, *jobs.popleft())

    return each


def _on(pool: Executor, function: Callable[..., T], jobs: deque[Any]) -> Iterator[T]:
    """No process waits for the others while there are jobs."""
    under_way: deque[Future[T]] = deque()
    try:
        while jobs or under_way:
            while jobs:
                under_way.append(pool.submit(_with_the_walk, function, jobs.popleft()))
            yield under_way.popleft().result()
    finally:  # whoever has found what it looked for does not wait for the rest
        for future in under_way:
            future.cancel()


_walk: Walk | None = None  # one per process, so that it reports nothing twice


def _begin(rules: Rules) -> None:
    global _walk  # noqa: PLW0603 - set once, when the process starts
    gc.disable()  # a decision leaves no cycles, and searching for some takes a fiftieth of the time
    _walk = walk_of(rules)


def _with_the_walk(function: Callable[..., T], job: tuple[Any, ...]) -> T:
    return function(_walk, *job)


def bay_of(policy: Policy) -> BayConfig:
    """A bay for a policy without a station: its limits are exactly as wide as the policy's, and all steps allowed."""
    return BayConfig(
        name=policy.policy,
        charger=ChargerConfig(port="explored", control=ControlMode.MANUAL, steps_a=STEPS_A),
        battery=BatteryConfig(can="explored", node_id=0x10, map=ObjectMap(map="explored", objects=())),
        limits=Limits(
            voltage_v=policy.pack.voltage_v.high, current_a=STEPS_A[-1], temperature_c=policy.pack.temperature_c
        ),
        policy=policy,
        source=policy.source,
    )


def bays_in(file: str) -> Iterator[tuple[str, BayConfig]]:
    """The bays to prove in a policy or station file without errors, each with its title."""
    try:
        station = load_station(file)
    except ConfigError:
        with suppress(ConfigError):  # an object map or a scenario contains no policy
            yield file, bay_of(load_policy(file))
        return
    for bays in _alike(station):
        yield f"{file}, {', '.join(bay.name for bay in bays)}", bays[0]


def _alike(station: Station) -> Iterable[Sequence[BayConfig]]:
    """The bays, grouped by what affects decisions: within a group only name, port, bus or node differ."""
    groups: dict[object, list[BayConfig]] = {}
    for bay in station.bays:
        what = (bay.policy.source.file, bay.charger.control, bay.charger.steps_a, bay.limits)
        groups.setdefault(what, []).append(bay)
    return groups.values()
