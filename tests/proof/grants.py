"""Never over: chargers on lines that delay, lose and are cut, under the allocation; judged by what they really draw.

python -m tests.proof.grants              ten million random events for 128 bays, and every state of three bays
python -m tests.proof.grants --seed 7     one run again

The model knows nothing of the ledger. A charger obeys the last command that reached it, for ever, and its current
follows later; a command is applied at once, late or never; a status is heard at once or late, after newer grants.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from random import Random

from orchestrator.core import allocate as allocation
from orchestrator.core import ledger
from orchestrator.core.order import RAISE_EVERY_S, TURN_S
from orchestrator.core.supply import Held, Load, Priority, Supplies, Supply, Want
from tests.proof.report import say

DRAW_W = (12, 210, 430, 700, 980, 1500)
TOP = len(DRAW_W) - 1


@dataclass(slots=True)
class Charger:
    """One charger with its line, and what the controller knows of it."""

    setting: int = 0  #: what it was told last
    flow: int = 0  #: what flows: it follows the setting
    wire: int | None = None  #: a command on the wire; it arrives before any later status leaves, or never
    late: ledger.Seen | None = None  #: a status that is heard late
    cut: bool = False

    def told(self, level: int, chance: Random) -> None:
        """A command goes out, behind the one that is on the wire."""
        self.arrives(chance)
        if not self.cut:
            self.wire = level

    def arrives(self, chance: Random) -> None:
        """What is on the wire has its effect, or is lost."""
        if self.wire is not None and (not self.cut or chance.random() < 0.5):
            self.setting = self.wire
        self.wire = None

    def follows(self) -> None:
        self.flow = self.setting

    def says(self, now_s: float, chance: Random) -> ledger.Seen:
        """A status: verified is what both its step and its current show."""
        self.arrives(chance)
        self.flow = max(self.flow, self.setting)  # up at once, for the worst
        return ledger.Seen(max(self.setting, self.flow), now_s)


@dataclass(slots=True)
class World:
    """A station under the allocation. After every event, nothing may be drawn that was not promised."""

    supplies: Supplies
    chance: Random
    now_s: float = 1000.0
    chargers: list[Charger] = field(default_factory=list)
    wants: list[Want] = field(default_factory=list)
    held: list[Held] = field(default_factory=list)
    allowed_w: list[int] = field(default_factory=list)  #: the limits, or what was promised before one was lowered
    events: int = 0
    raised: int = 0

    def __post_init__(self) -> None:
        self.chargers = [Charger() for _ in self.supplies.loads]
        self.wants = [self._want() for _ in self.supplies.loads]
        self.allowed_w = list(self.supplies.limits_w)
        self.restart()

    def _want(self) -> Want:
        chance = self.chance
        top = chance.choice((0, 1, 3, TOP, TOP))
        laxity_s = chance.choice((float("inf"), chance.uniform(-3600, 36000)))
        return Want(top, chance.choice((*Priority, Priority.NORMAL)), laxity_s, keeps=chance.random() < 0.2)

    def restart(self) -> None:
        """A new controller, which knows nothing. What is on the wire stays there."""
        self.held = [ledger.unproved(TOP) for _ in self.chargers]
        for one in self.chargers:
            one.late = None

    def draws(self) -> list[int]:
        """What flows in each supply, on the plant's own meter."""
        used = [0] * len(self.supplies.limits_w)
        for load, path, one in zip(self.supplies.loads, self.supplies.paths, self.chargers, strict=True):
            for number in path:
                used[number] += load.draw_w[max(one.flow, one.setting)]
        return used

    def allocate(self) -> None:
        """The grants, and what the bays make of them: a command each, at or below its grant."""
        before_w = ledger.used_w(self.supplies, self.held)
        grants = allocation.allocate(self.supplies, self.wants, self.held, self.now_s)
        for bay, (one, grant) in enumerate(zip(self.chargers, grants, strict=True)):
            was = self.held[bay]
            assert grant.level == grant.held.granted <= grant.held.counted <= TOP, f"bay {bay}: {grant}"
            assert grant.held.counted >= was.counted, f"bay {bay}: freed without a status"
            if grant.level > was.granted:
                self.raised += 1
                assert was.known, f"bay {bay}: raised without being known"
                assert self.now_s - was.rose_s >= RAISE_EVERY_S, f"bay {bay}: raised twice in a minute"
                assert grant.level == was.granted + 1, f"bay {bay}: raised by more than one"
            if grant.level != was.granted or self.chance.random() < 0.02:
                one.told(self.chance.choice((grant.level, grant.level, max(grant.level - 1, 0))), self.chance)
        self.held = [grant.held for grant in grants]
        after_w = ledger.used_w(self.supplies, self.held)
        for before, after, limit in zip(before_w, after_w, self.supplies.limits_w, strict=True):
            assert after <= max(before, limit), f"{after} W promised of {limit} W, before {before} W"

    def event(self) -> None:
        """Anything may happen to one charger."""
        bay = self.chance.randrange(len(self.chargers))
        one, which = self.chargers[bay], self.chance.random()
        if which < 0.45:  # a status, heard at once
            if not one.cut:
                self.hear(bay, one.says(self.now_s, self.chance))
        elif which < 0.55:  # … or late
            if one.late is not None:
                self.hear(bay, one.late)
            one.late = None if one.cut else one.says(self.now_s, self.chance)
        elif which < 0.80:
            one.follows()
        elif which < 0.90:
            one.arrives(self.chance)
        elif which < 0.95:
            self.wants[bay] = self._want()
        elif which < 0.97:
            one.cut = not one.cut and self.chance.random() < 0.1
        elif one.cut:
            self.hear(bay, None)

    def hear(self, bay: int, seen: ledger.Seen | None) -> None:
        self.held[bay] = ledger.observed(self.held[bay], TOP, seen)

    def limit(self, supplies: Supplies) -> None:
        """Other limits. What was promised before may flow until it is taken back."""
        self.supplies = supplies
        self.allowed_w = list(map(max, self.allowed_w, ledger.used_w(supplies, self.held)))

    def check(self) -> None:
        """No more flows than is allowed; every charger is within what it counts with."""
        counted_w, limits_w = ledger.used_w(self.supplies, self.held), self.supplies.limits_w
        for number, drawn_w in enumerate(self.draws()):
            if counted_w[number] <= limits_w[number]:
                self.allowed_w[number] = limits_w[number]
            assert drawn_w <= self.allowed_w[number], f"{drawn_w} W drawn of {self.allowed_w[number]} W"
        for bay, (one, held) in enumerate(zip(self.chargers, self.held, strict=True)):
            most = max(one.flow, one.setting, one.wire or 0)
            assert most <= held.counted, f"bay {bay} may be at level {most} and counts with {held.counted}"


def hall(bays: int, limit_w: int) -> Supplies:
    """A feed with racks of eight, and one rack within another."""
    racks = max(1, bays // 8)
    supplies = [Supply("hall", limit_w)]
    supplies += [Supply(f"rack-{n}", limit_w // 3, "rack-0" if n == 1 else "hall") for n in range(racks)]
    return Supplies.of(supplies, [Load(f"bay-{n}", f"rack-{n % racks}", DRAW_W) for n in range(bays)])


def play(seed: int, bays: int, events: int, each: int) -> World:
    """Random events; the allocation after every `each` of them on average, and a look at the meter."""
    chance = Random(seed)
    file = hall(bays, bays * chance.choice((60, 150, 400, 900, 1600)))
    world = World(file, chance)
    while world.events < events:
        for _ in range(chance.randrange(2 * each)):
            world.event()
            world.events += 1
        world.now_s += chance.choice((0.0, 0.1, 1.0, 15.0, 70.0, 400.0))
        if (which := chance.random()) < 0.02:
            world.limit(file.limited({one.name: one.limit_w * chance.randrange(2, 20) // 10 for one in file.supplies}))
        elif which < 0.03:
            world.restart()
        world.check()
        world.allocate()
        world.check()
    return world


# --- every state of three bays ----------------------------------------------------------------------------------------


def states() -> Iterator[Held]:
    """Everything that a bay can have: any grant, any level not disproved above it, in hand or not."""
    long_s = 1000.0 - 2 * TURN_S
    for counted in range(TOP + 1):
        for granted in range(counted + 1):
            placed = {"turn_s": long_s} if granted else {}
            yield Held(counted, granted, known=True, rose_s=long_s, room_s=long_s, **placed)
            if counted == TOP:
                yield Held(counted, granted, known=False, rose_s=long_s, room_s=long_s, **placed)


def three(
    tops: Sequence[tuple[int, int, int]], limits_w: Sequence[int], *, ordered: bool = False
) -> Iterator[tuple[Supplies, tuple[Want, ...], tuple[Held, ...]]]:
    """Three bays in every combination of their states; `ordered`: each once, whichever bay it is."""
    numbered = tuple(enumerate(states()))
    loads = [Load(name, supply, DRAW_W) for name, supply in (("a", "rack"), ("b", "rack"), ("c", "hall"))]
    for limit_w in limits_w:
        supplies = Supplies.of((Supply("hall", limit_w), Supply("rack", limit_w * 2 // 3, "hall")), loads)
        for wanted in tops:
            wants = tuple(Want(top) for top in wanted)
            for (i, a), (j, b), (k, c) in product(numbered, repeat=3):
                if not ordered or i <= j <= k:
                    yield supplies, wants, (a, b, c)


def one_allocation(supplies: Supplies, wants: tuple[Want, ...], held: tuple[Held, ...]) -> None:
    """What must hold of one allocation, whatever was before."""
    before_w = ledger.used_w(supplies, held)
    grants = allocation.allocate(supplies, wants, held, 1000.0)
    after = [grant.held for grant in grants]
    for before, now, limit in zip(before_w, ledger.used_w(supplies, after), supplies.limits_w, strict=True):
        assert now <= max(before, limit), f"{held}: {now} W of {limit} W"
    for was, want, grant in zip(held, wants, grants, strict=True):
        assert grant.level == grant.held.granted <= min(grant.held.counted, want.top), f"{held}: {grant}"
        assert grant.held.counted == max(was.counted, grant.level), f"{held}: {grant}"
        assert was.known or not grant.level, f"{held}: {grant}"
        assert (grant.cause is None) == (was.known and grant.level == want.top), f"{held}: {grant}"
    lost = [replace(one, granted=0, counted=TOP, known=False) for one in after]
    assert not any(one.level for one in allocation.allocate(supplies, wants, lost, 1001.0))


def main(argv: Sequence[str] | None = None) -> int:
    """The long forms; 1 if anything was found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--events", type=int, default=10_000_000, help="how many (default: %(default)s)")
    parser.add_argument("--seed", type=int, help="only this one")
    arguments = parser.parse_args(argv)
    began_s, events, raised, seed = time.monotonic(), 0, 0, arguments.seed or 0
    try:
        while events < arguments.events:
            world = play(seed, 128, 100_000, 60)
            events, raised, seed = events + world.events, raised + world.raised, seed + 1
            if arguments.seed is not None:
                break
        say(f"{events:,} events, {raised:,} levels raised, {time.monotonic() - began_s:.0f} s: 0 W over")
        if arguments.seed is None:
            count = 0
            for one in three([(a, b, c) for a, b, c in product((0, 1, TOP), repeat=3)], (150, 1000, 2200, 3100)):
                one_allocation(*one)
                count += 1
            say(f"{count:,} states of three bays, {time.monotonic() - began_s:.0f} s: 0 W over")
    except AssertionError as error:
        say(f"seed {seed}: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
