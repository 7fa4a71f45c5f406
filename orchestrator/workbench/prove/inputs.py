"""The inputs of a bay: everything that a charger and a battery can show at the moment of a decision.

A battery's classes (`batteries.py`) are cut at the policy's own thresholds: just below, at, and just above each bound.
A charger's (`chargers.py`) are its possible reactions and reports. Each decision takes any of both, so a story can
leave any of them at any time.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from orchestrator.core.memory import Memory
from orchestrator.core.parts import changed
from orchestrator.core.rules import Rules
from orchestrator.core.states import AT_WORK
from orchestrator.model import (
    BatteryLink,
    BatteryReading,
    Cause,
    ChargerLink,
    ChargerReading,
    Request,
    Snapshot,
    State,
)
from orchestrator.workbench.prove.batteries import Shown, batteries
from orchestrator.workbench.prove.chargers import CHARGERS, Charger, Said, obedient
from orchestrator.workbench.prove.story import TICK_S, Move

#: If two timers differ by no more than this factor, one jump past the longer covers both.
ALIKE = 1.1
#: As in `batteries.py`.
READING = ChargerReading(0.0, 0.0, 0.0, None, None, None, None, None, None)
LINK, SNAPSHOT = ChargerLink(), Snapshot()


@dataclass(slots=True)
class _Moment:
    """What was made for one moment of a memory: most moves lead to the same few, and making it anew takes long."""

    now_s: float = 0.0
    memory: Memory | None = None
    said: dict[str, Said] = field(default_factory=dict)  #: by battery
    shown: dict[tuple[str, float], tuple[BatteryReading, BatteryLink]] = field(default_factory=dict)  #: and by current

    def become(self, now_s: float, memory: Memory) -> None:
        """Forget what was made for another moment."""
        if memory is not self.memory or now_s != self.now_s:
            self.now_s, self.memory, self.said, self.shown = now_s, memory, {}, {}


@dataclass(frozen=True, slots=True)
class StationInputs:
    """The inputs of one bay: its charger's classes, its policy's battery classes, the jumps over timers."""

    rules: Rules
    jumps_s: tuple[float, ...] = ()
    chargers: Mapping[str, Charger] = field(default_factory=lambda: CHARGERS)
    batteries: Mapping[str, Shown] = field(default_factory=dict)
    _moment: _Moment = field(default_factory=_Moment, init=False, compare=False, repr=False)

    @classmethod
    def of(cls, rules: Rules) -> "StationInputs":
        """All classes cut by the bay's policy and station file."""
        return cls(rules, jumps(rules), CHARGERS, batteries(rules))

    def moves(self, state: State) -> Iterator[Move]:
        """Each class in the next moment and after each jump, and every request in simple surroundings."""
        constants = [(charger, battery) for charger, battery in self.constants() if self.tells(battery, state)]
        for dt_s in (TICK_S, *self.jumps_s):
            for charger, battery in constants:
                yield Move(dt_s, charger, battery)
        for request in Request:
            for charger in ("obeys", "runs, whatever it is told", "silent", "stands by, whatever it is told"):
                for battery in ("healthy", "absent", "full"):
                    if charger in self.chargers and battery in self.batteries:
                        yield Move(TICK_S, charger, battery, request)
        yield Move(TICK_S, "obeys", "healthy", internal="seen by the checker")
        yield Move(TICK_S, "obeys", "healthy", ending=Cause.of("signal", name="SIGTERM"))
        for charger in ("obeys", "runs, whatever it is told", "silent"):
            if charger in self.chargers:
                yield Move(TICK_S, charger, "healthy", restart=True)

    def pairs(self, state: State) -> Iterator[Move]:
        """Every other charger with every other battery in the next moment."""
        chargers = [charger for charger in self.chargers if charger != "obeys"]
        batteries = [battery for battery in self.batteries if battery != "healthy" and self.tells(battery, state)]
        return (Move(TICK_S, charger, battery) for charger in chargers for battery in batteries)

    def constants(self) -> Iterator[tuple[str, str]]:
        """Each charger with a healthy battery, each battery with an obedient charger."""
        yield from ((charger, "healthy") for charger in self.chargers)
        yield from (("obeys", battery) for battery in self.batteries if battery != "healthy")

    def tells(self, battery: str, state: State) -> bool:
        """Whether it is a separate class in this state: at rest, the policy's tables are not used."""
        return state in AT_WORK or not self.batteries[battery].at_work

    def snapshot(self, move: Move, now_s: float, memory: Memory) -> Snapshot:
        """The input of the decision."""
        moment = self._moment
        moment.become(now_s, memory)
        obeys = moment.said.get(move.battery)
        if obeys is None:
            obeys = moment.said[move.battery] = obedient(self.rules, self.batteries[move.battery], now_s, memory)
        said = Said(obeys.reading.copy(), obeys.link.copy())
        self.chargers[move.charger](said, now_s)
        amps = said.reading.pop("current_a")
        said.reading.pop("full_a")
        age_s = said.reading.pop("age_s")
        reading = None if said.silent else changed(READING, t_s=now_s - age_s, current_a=amps, **said.reading)
        what = move.battery, 0.0 if reading is None else amps
        shown = moment.shown.get(what)
        if shown is None:
            shown = moment.shown[what] = self.batteries[move.battery].at(now_s, memory, what[1])
        return changed(
            SNAPSHOT, charger=reading, charger_link=changed(LINK, **said.link), battery=shown[0], battery_link=shown[1],
            request=move.request, internal=move.internal, ending=move.ending,
        )  # fmt: skip


def jumps(rules: Rules) -> tuple[float, ...]:
    """Jumps just beyond every timer of core and policy, so that no timer is waited out tick by tick."""
    policy = rules.policy
    timers = [2.0, 3.0, 5.0, 10.0, 70.0, 310.0, 3600.0]
    timers.append(rules.max_hours * 3600)
    if rules.taper is not None:
        timers.append(rules.taper.for_s)
    if policy.finish.hold_min:
        timers.append(policy.finish.hold_min * 60)
    if policy.finish.full_every_days is not None:
        timers.append(policy.finish.full_every_days * 86400)
    if policy.precharge is not None:
        rule = policy.precharge
        timers += [m * 60 for m in (rule.pulse.max_min, rule.continuous.max_min, rule.rise.within_min)]
    apart = [timer for timer in timers if not any(timer < other < timer * ALIKE for other in timers)]
    return tuple(sorted({timer + 0.1 for timer in apart}))
