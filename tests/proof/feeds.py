"""Bays on a supply in the whole service, in virtual time, with a meter on the feed, while lines are cut and people act.

python -m tests.proof.feeds               20 stations of six bays, 400 s each
python -m tests.proof.feeds --seed 7      one of them again
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from random import Random
from typing import Any
from unittest.mock import patch

from orchestrator.config.station import Station, SupplyConfig
from orchestrator.core import order
from orchestrator.core.draw import draw_w
from orchestrator.core.states import ENERGISED
from orchestrator.model import ControlMode, Request
from orchestrator.sim.presets import PACKS
from tests.proof.report import say
from tests.proof.virtual_rig import Nature
from tests.proof.virtual_service import World, station, world

BAYS, END_S = 6, 400.0
#: A charger may run when the service begins; until then it has been stopped.
BEGUN_S = 5.0
#: Turns and waits of seconds, so that much happens.
SOON: dict[str, Any] = {"TURN_S": 25.0, "RAISE_HOLD_S": 2.0, "RAISE_EVERY_S": 5.0}


class Storm:
    """One station: what befalls it, and the most that was drawn in each of its supplies."""

    def __init__(self, seed: int) -> None:
        self.chance = Random(seed)
        limit_w = self.chance.choice((700.0, 1500.0, 2500.0, 4000.0))
        controls = [self.chance.choice((ControlMode.MANUAL,) * 5 + (ControlMode.AUTOMATIC,)) for _ in range(BAYS)]
        bare = station(controls)
        names = tuple(bay.name for bay in bare.bays)
        supplies = {
            "hall": SupplyConfig(limit_w=limit_w, bays=names),
            "rack": SupplyConfig(limit_w=0.6 * limit_w, within="hall", bays=names[:3]),
        }
        self.station: Station = replace(bare, stagger_s=0.0, supplies=supplies)
        self.limits_w = (limit_w, 0.6 * limit_w)
        lines = [self.chance.choice(("real", "perfect")) for _ in names]
        natures = zip(controls, lines, strict=True)
        self.natures = [Nature(PACKS["48v"](), control, line, seed) for control, line in natures]
        self.most_w, self.over, self.charged = [0, 0], list[str](), set[str]()

    def play(self) -> None:
        """All of it. Raises whatever breaks the service."""
        with patch.multiple(order, **SOON), world(self.station, self.natures, end_s=END_S + 40) as on:
            begun_s = on.time.now_s + BEGUN_S
            on.on_step = lambda _: self._look(on) if on.time.now_s > begun_s else None
            on.time.call_later(20.0, lambda: self._befall(on))
            on.time.call_later(END_S, on.end)
            on.run()

    def _look(self, on: World) -> None:
        """The meter: every charger at the worst case of what it was told."""
        watts = []
        for bay, rig in zip(self.station.bays, on.rigs, strict=True):
            draws, charger = draw_w(bay), rig.bay.charger
            watts.append(draws[min(charger.current_step + 1, len(draws) - 1)] if charger.running else draws[0])
        for number, (drawn_w, limit_w) in enumerate(zip((sum(watts), sum(watts[:3])), self.limits_w, strict=True)):
            self.most_w[number] = max(self.most_w[number], drawn_w)
            if drawn_w > limit_w:
                self.over.append(f"t = {on.time.now_s:.2f} s: {drawn_w} W of {limit_w:g} W, {watts}")
        self.charged |= {bay.name for bay in on.bays if bay.decision is not None and bay.decision.state in ENERGISED}

    def _befall(self, on: World) -> None:
        number, which = self.chance.randrange(BAYS), self.chance.random()
        rig, later = on.rigs[number], on.time.call_later
        if which < 0.25:
            rig.tty.stalled = True
            later(self.chance.choice((0.3, 1.0, 3.0, 8.0)), lambda: setattr(rig.tty, "stalled", False))
        elif which < 0.4:
            on.ask(self.chance.choice((Request.STOP, Request.PAUSE)), number)
        elif which < 0.75:
            on.ask(Request.RESET, number)
            later(1.0, lambda: on.ask(Request.START, number))
        elif which < 0.85:
            rig.bay.pack.set_soc(self.chance.choice((20.0, 50.0, 70.0, 95.0)))
        else:
            rig.bay.charger.ignores_stop = True
            later(self.chance.choice((1.0, 4.0, 9.0)), lambda: setattr(rig.bay.charger, "ignores_stop", False))
        later(self.chance.expovariate(1 / 3.0), lambda: self._befall(on))


def main(argv: Sequence[str] | None = None) -> int:
    """Play; 1 if a limit was exceeded."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--stations", type=int, default=20, help="how many (default: %(default)s)")
    parser.add_argument("--seed", type=int, help="only this one")
    arguments = parser.parse_args(argv)
    seeds = range(arguments.stations) if arguments.seed is None else (arguments.seed,)
    over = 0
    for seed in seeds:
        storm = Storm(seed)
        storm.play()
        limits = " and ".join(
            f"{most} of {limit:g} W" for most, limit in zip(storm.most_w, storm.limits_w, strict=True)
        )
        say(f"seed {seed}: at most {limits}; {len(storm.charged)} of {BAYS} bays charged")
        say("\n".join(f"  {line}" for line in storm.over[:3])) if storm.over else None
        over += bool(storm.over)
    say(f"{len(seeds)} stations: {over} over a limit")
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
