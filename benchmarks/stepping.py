"""The cost of one decision of the core (`decide()`): recorded situations of a live bay, decided repeatedly.

Processor time of the thread, so the machine's other load does not count. Floors: the look-up of a transition in a dict,
and `transitions` firing one.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import thread_time_ns

from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series
from orchestrator.core.decide import decide
from orchestrator.core.machine import TABLE, Trigger, fire
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import Request, Snapshot, State
from tests.core.world import World, bay

GOAL = Goal(median=100.0, p99=100.0)
BATCH = 20  #: the floors are so fast that reading the clock would dominate
LEADS = {(source, trigger): target or source for trigger, sources, target in TABLE for source in sources}


@dataclass(frozen=True, slots=True)
class Moment:
    """The arguments of one decision."""

    now_s: float
    snapshot: Snapshot
    memory: Memory


class Recorder(World):
    """A world that records the arguments of each decision."""

    def __init__(self, **battery: float) -> None:
        super().__init__(bay(), **battery)
        self.moments: list[Moment] = []

    def snapshot(self, request: Request | None, internal: str) -> Snapshot:
        """Called right before each decision."""
        snapshot = super().snapshot(request, internal)
        self.moments.append(Moment(self.now_s, snapshot, self.memory))
        return snapshot


def idle() -> Recorder:
    """No battery to be charged."""
    world = Recorder(soc_pct=99.0)
    world.until(State.IDLE)
    return world


def charging() -> Recorder:
    """On the highest step."""
    world = Recorder()
    world.until(State.CHARGING)
    world.run(10)
    return world


def faulty() -> Recorder:
    """Tripped: hot, status bits, an implausible value and a silent charger at once."""
    world = charging()
    world.values |= {"temperature_c": 60.0, "status": 0x51, "voltage_v": 56.5}
    world.run(10)
    world.charger_answers = False
    world.run(5)
    return world


def measure(effort: Effort) -> Iterator[Result]:
    """Each situation against the floors."""
    seconds, rounds = 60.0, effort.choose(30, 3)
    trigger = Series("transitions, one trigger", _times(_fire, 300 * rounds))
    look_up = Series("dict look-up", _times(_look_up, 300 * rounds))
    situations = {"idle": idle, "charging": charging, "with faults": faulty}
    for name, situation in situations.items():
        world = situation()
        world.moments.clear()
        world.run(seconds, dt_s=0.05)
        samples = [took for _ in range(rounds) for took in _steps(world.moments, world.rules)]
        beside = look_up if name == "idle" else trigger
        yield Result(f"step(), {name}", "µs", Series("ours", samples), beside, GOAL, processor_time=True)


def _steps(moments: list[Moment], rules: Rules) -> Iterator[float]:
    for moment in moments:
        now_s, snapshot, memory = moment.now_s, moment.snapshot, moment.memory
        begin_ns = thread_time_ns()
        decide(now_s, snapshot, memory, rules)
        yield (thread_time_ns() - begin_ns) / 1000


def _times(function: Callable[[], object], runs: int) -> list[float]:
    samples = []
    for _ in range(runs):
        begin_ns = thread_time_ns()
        for _ in range(BATCH):
            function()
        samples.append((thread_time_ns() - begin_ns) / 1000 / BATCH)
    return samples


def _fire() -> State:
    return fire(State.CHARGING, Trigger.STOP)


def _look_up() -> State:
    return LEADS[State.CHARGING, Trigger.STOP]
