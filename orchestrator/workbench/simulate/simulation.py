"""Plays one policy on one scenario: the product's own `decide()`, the emulators' charger and pack, and jumping time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from operator import itemgetter

from orchestrator.config.policy import Policy
from orchestrator.config.scenario import Ask, Scenario, SensorFault, Visit
from orchestrator.config.station import BatteryConfig, BayConfig, ChargerConfig
from orchestrator.core.decide import decide
from orchestrator.core.history.battery import WARMTH_EVERY_S
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.errors import OrchestratorError
from orchestrator.model import ControlMode, Decision, Request, State
from orchestrator.protocol.objects import ObjectMap
from orchestrator.workbench.simulate.devices import TICK_S, Devices
from orchestrator.workbench.simulate.leap import Outline, brought_up, outline
from orchestrator.workbench.simulate.plant import Plant
from orchestrator.workbench.simulate.trail import Trail

#: The longest leap, in ticks: two minutes, so that a curve through the moments is smooth.
MAX_LEAP = round(120 / TICK_S)
#: `watch` is called after this many decisions.
WATCH_EVERY = 100

Happening = Callable[[], None]


class UnsuitableError(OrchestratorError):
    """The policy does not suit the scenario's batteries."""


@dataclass(frozen=True, slots=True)
class Run:
    """The result of a simulation."""

    policy: Policy
    scenario: Scenario
    trail: Trail
    charged_ah: float
    charged_wh: float
    steps: int  #: how often `decide()` was called, including undone leaps


def simulate(
    policy: Policy, scenario: Scenario, *, stretch: bool = True, watch: Callable[[float], None] | None = None
) -> Run:
    """Play the scenario to its end.

    Without `stretch` every tick is decided. `watch` is called regularly with the share that is done (0 … 1). Raises
    UnsuitableError.
    """
    return Simulation(policy, scenario, MAX_LEAP if stretch else 1).run(watch or (lambda _: None))


def rules_of(policy: Policy, scenario: Scenario) -> Rules:
    """The rules of a bay with the scenario's charger and limits. Raises UnsuitableError."""
    for name, battery in scenario.batteries.items():
        if battery.cells_in_series != policy.pack.cells_in_series:
            raise UnsuitableError(
                f"policy {policy.policy} is for {policy.pack.cells_in_series} cells in series "
                f"({policy.source.at('pack.cells_in_series')}), {name} has {battery.cells_in_series} "
                f"({scenario.source.at(f'batteries.{name}.cells_in_series')})"
            )
    return Rules.of(
        BayConfig(
            name=scenario.scenario,
            charger=ChargerConfig(port="simulated", control=ControlMode.MANUAL, steps_a=scenario.charger.steps_a),
            battery=BatteryConfig(can="simulated", node_id=0x10, map=ObjectMap(map="simulated", objects=())),
            limits=scenario.limits,
            policy=policy,
            source=scenario.source,
        )
    )


class Simulation:
    """A bay in simulated time; `run` plays it once."""

    def __init__(self, policy: Policy, scenario: Scenario, max_leap: int) -> None:
        self._policy, self._scenario, self._max_leap = policy, scenario, max_leap
        self._rules = rules_of(policy, scenario)
        self._plant, self._devices = Plant(scenario), Devices()
        self._memory, self._decision = Memory(), Decision(State.STARTING, Memory().cause)
        self._outline: Outline = ()
        self._request: Request | None = None
        self._tick = 0
        self._steps = 0
        self._trail = Trail()

    def run(self, watch: Callable[[float], None]) -> Run:
        """Play the scenario to its end, once. `watch` as in `simulate`."""
        end = _tick(self._scenario.hours)
        for begin, happening in sorted(self._happenings(end), key=itemgetter(0)):
            self._until(begin, lambda tick: watch(tick / end))
            happening()
        self._trail.close(self._plant.t_s)
        return Run(
            self._policy, self._scenario, self._trail, self._plant.charged_ah, self._plant.charged_wh, self._steps
        )

    # --- what happens to the bay -----------------------------------------------------------------------------------

    def _happenings(self, end: int) -> Iterator[tuple[int, Happening]]:
        """(tick, action) for everything that happens in the scenario before its end, and for the end."""
        for tick, happening in self._planned():
            if tick < end:
                yield tick, happening
        yield end, lambda: None

    def _planned(self) -> Iterator[tuple[int, Happening]]:
        scenario = self._scenario
        for visit in scenario.visits:
            yield _tick(visit.from_h), partial(self._arrive, visit)
            if visit.to_h is not None:
                yield _tick(visit.to_h), partial(self._leave, visit)
        for fault in scenario.sensors:
            yield _tick(fault.from_h), partial(self._break, fault)
            if fault.to_h is not None:
                yield _tick(fault.to_h), partial(self._mend, fault)
        for ask in scenario.operator:
            yield _tick(ask.at_h), partial(self._ask, ask)

    def _arrive(self, visit: Visit) -> None:
        self._plant.arrive(visit)

    def _leave(self, visit: Visit) -> None:
        self._plant.leave(visit)

    def _break(self, fault: SensorFault) -> None:
        self._devices.faults = (*self._devices.faults, fault)

    def _mend(self, fault: SensorFault) -> None:
        self._devices.faults = tuple(one for one in self._devices.faults if one is not fault)

    def _ask(self, ask: Ask) -> None:
        self._request = ask.request

    # --- time ------------------------------------------------------------------------------------------------------

    def _until(self, end: int, watch: Callable[[int], None]) -> None:
        """Advance to the tick `end` in leaps, which grow while nothing happens and halve before something does."""
        leap, news = 1, 0  # by the tick `news` something will have happened; 0: nothing is known
        while self._tick < end:
            ticks = (news - self._tick) // 2 if news > self._tick else leap
            ticks = 1 if self._restless else max(1, min(ticks, end - self._tick))
            if self._leap(ticks):
                leap = min(2 * leap, self._max_leap)
            elif ticks > 1:
                news = self._tick + ticks
            else:
                leap, news = 1, 0
            if self._steps % WATCH_EVERY == 0:
                watch(self._tick)

    @property
    def _restless(self) -> bool:
        """Whether every tick counts: a command is under way, or the current is pulsing."""
        return self._request is not None or self._decision.command is not None or self._plant.charger.pulsing

    def _leap(self, ticks: int) -> bool:
        """Leap by this many ticks; True if nothing happened. Otherwise undo it, unless it was a single tick."""
        plant, devices, memory = self._plant, self._devices, self._memory
        if ticks > 1:
            plant, devices = plant.copy(), devices.copy()
            memory = self._skip(ticks - 1, plant, devices)
        now_s = (self._tick + ticks) * TICK_S
        devices.obey(self._decision.command, plant.charger, now_s - TICK_S / 2)
        plant.advance(TICK_S)
        decision, memory = decide(now_s, devices.snapshot(plant, now_s, self._request), memory, self._rules)
        self._steps += 1
        new = outline(decision, memory)
        nothing_happened = new == self._outline
        if nothing_happened or ticks == 1:
            self._tick += ticks
            self._plant, self._devices, self._request = plant, devices, None
            self._decision, self._memory, self._outline = decision, memory, new
            self._trail.add(plant, decision)
        return nothing_happened

    def _skip(self, ticks: int, plant: Plant, devices: Devices) -> Memory:
        """Advance the plant by this many ticks without decisions; returns the memory that they would have left."""
        memory, warmth = self._memory, self._memory.battery.warmth
        end_s = (self._tick + ticks) * TICK_S
        before_ah, before_wh = plant.charged_ah, plant.charged_wh
        temperatures = []
        due_s = warmth[-1][0] + WARMTH_EVERY_S if warmth else end_s
        while plant.t_s < end_s:
            at_s = min(max(due_s, plant.t_s + TICK_S), end_s)
            plant.advance(at_s - plant.t_s)
            due_s = at_s + WARMTH_EVERY_S
            told_c = devices.told_c(plant.pack, at_s)
            if told_c is not None:
                temperatures.append((at_s, told_c))
        return brought_up(memory, end_s, temperatures, plant.charged_ah - before_ah, plant.charged_wh - before_wh)


def _tick(at_h: float) -> int:
    return round(at_h * 3600 / TICK_S)
