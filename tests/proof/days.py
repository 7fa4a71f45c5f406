"""Days of a bay's life in virtual time, on a line and a bus losing 1 % of all frames and damaging 0.1 %.

From morning to evening, batteries arrive, charge, stay for a while and leave, some in mid-charge; a few times a day
something breaks, is repaired, and the bay is reset and started. At night the last battery rests. The true state is
checked against the service as in every other script (`play.py`); events it does not explain are counted here.
"""

import gc
import os
import time
from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from orchestrator.core.states import ENERGISED
from orchestrator.model import Decision, State
from orchestrator.sim.can_noise import BUSES
from tests.proof.play import Player, stage
from tests.proof.report import say
from tests.proof.script import ARRIVES, INJECTIONS, MENDS, REQUESTS, STRENGTHS, BaySetup, Happening, Script
from tests.proof.virtual_service import World

DAY_S, HOUR_S, MINUTE_S = 86400.0, 3600.0, 60.0
#: The station's day; the rest is night.
OPENS_S, CLOSES_S = 6 * HOUR_S, 21 * HOUR_S
#: Interval of the checks; every budget is longer.
LOOK_S = 0.5
#: Read interval of the BMU: the longest of the other proofs, six times the default, so that 30 days take less
#: than a night. A lost frame makes values older than with the default, so false stops are more likely.
SWEEP_S = 0.3
#: Events this soon after a fault is removed, or a battery arrives, are due to it; and after one that warmed or
#: cooled the pack: its rate of warming is judged over three minutes.
DUE_S, WARMTH_DUE_S = 10.0, 200.0
#: This long after a repair, somebody resets and starts the bay.
RESET_S, START_S = 20.0, 25.0

Due = tuple[float, float, str]  #: from, to, because of


def script_of(seed: int, days: int) -> Script:
    """A life, reproducible from its seed."""
    dice = Random(seed)
    happenings: list[Happening] = []
    for day in range(days):
        t_s = day * DAY_S + dice.uniform(OPENS_S, OPENS_S + HOUR_S)
        while t_s < day * DAY_S + CLOSES_S:
            t_s = _stay(dice, t_s, happenings)
    setup = BaySetup(soc_pct=60.0, line="poor", seed=seed)
    ordered = tuple(sorted(happenings, key=lambda one: one.t_s))
    return Script(seed, (setup,), ordered, days * DAY_S, days * DAY_S - MINUTE_S, sweep_s=SWEEP_S)


def _stay(dice: Random, t_s: float, happenings: list[Happening]) -> float:
    """The present battery leaves and the next one arrives; returns when that one leaves."""
    happenings.append(Happening(t_s, 0, "battery_removed"))
    t_s += dice.uniform(0.5, 40) * MINUTE_S
    happenings.append(Happening(t_s, 0, ARRIVES, dice.choice((-50.0, 5.0, 20.0, 35.0, 60.0, 85.0))))
    stays_s = dice.choice((dice.uniform(10, 60), *4 * (dice.uniform(110, 240),))) * MINUTE_S
    if dice.random() < 0.6:
        _break(dice, t_s + dice.uniform(0.1, 0.5) * stays_s, happenings)
    if dice.random() < 0.2:
        pause_s = t_s + dice.uniform(0.0, 0.4) * stays_s
        happenings.append(Happening(pause_s, 0, "pause"))
        happenings.append(Happening(pause_s + dice.uniform(0.01, 0.1) * stays_s, 0, "start"))
    return t_s + stays_s


def _break(dice: Random, t_s: float, happenings: list[Happening]) -> None:
    """Something breaks and is repaired within three minutes, before the battery leaves; reset and start follow."""
    name = dice.choice(INJECTIONS)
    happenings.append(Happening(t_s, 0, name, dice.choice((None, *STRENGTHS.get(name, ())))))
    mended_s = t_s + dice.uniform(0.1, 3) * MINUTE_S
    happenings.append(Happening(mended_s, 0, "heal"))
    happenings.append(Happening(mended_s + RESET_S, 0, "reset"))
    happenings.append(Happening(mended_s + START_S, 0, "start"))


def due(script: Script) -> list[Due]:
    """Times when something is or has just been wrong."""
    spans: list[Due] = []
    began_s, names = 0.0, ["the beginning"]
    for one in script.happenings:
        if one.name in REQUESTS:
            continue
        if one.name in MENDS:
            due_s = WARMTH_DUE_S if any("temperature" in name for name in names) else DUE_S
            spans.append((began_s, one.t_s + due_s, " and ".join(names)))
            names = []
        else:
            began_s = began_s if names else one.t_s
            names.append(one.name)
    return spans


@dataclass(slots=True)
class Lived:
    """The results."""

    days: int
    charges: int = 0
    stays: int = 0
    faults: int = 0
    violations: list[str] = field(default_factory=list)
    false_stops: list[str] = field(default_factory=list)
    false_latches: list[str] = field(default_factory=list)
    latched: Counter[tuple[str, str]] = field(default_factory=Counter)  #: because of, the fault that latched
    mib: list[float] = field(default_factory=list)  #: of this process, at the end of each day
    objects: list[int] = field(default_factory=list)  #: Python's, likewise
    cpu_s: float = 0.0
    status: int = 0


class Days:
    """A life in a world."""

    def __init__(self, script: Script, on: World, *, tell: bool) -> None:
        self._script, self._world, self._tell = script, on, tell
        self._began_s = on.time.now_s
        self._due = due(script)
        self._state = State.STARTING
        days = round(script.end_s / DAY_S)
        names = [one.name for one in script.happenings]
        self.lived = Lived(days, stays=names.count(ARRIVES), faults=names.count("heal"))
        self._player = Player(script, on, LOOK_S)
        self._watch = on.on_step
        on.on_step = self._stepped
        for day in range(1, days + 1):
            on.time.call_at(self._began_s + day * DAY_S - 1.0, self._midnight, day)

    def run(self) -> Lived:
        cpu_s = time.process_time()
        played = self._player.run()
        lived = self.lived
        lived.violations, lived.status, lived.cpu_s = played.violations, played.status, time.process_time() - cpu_s
        return lived

    def _stepped(self, runner: Any) -> None:
        self._watch(runner)
        decision: Decision = runner.decision
        if decision.state is State.FULL and self._state is not State.FULL:
            self.lived.charges += 1
        lines = self._world.journal.lines
        for _, line in lines:
            if line["event"] == "raised" and line["effect"] in ("PAUSE", "STOP", "TRIP"):
                self._raised(line)
        lines.clear()
        self._state = decision.state

    def _raised(self, line: dict[str, str]) -> None:
        """A fault that stops: is anything wrong?"""
        t_s = self._world.time.now_s - self._began_s
        because = self._because(t_s)
        latches = line["effect"] == "TRIP"
        if because and latches:
            self.lived.latched[because, line["id"]] += 1
        if because:
            return
        said = f"day {t_s / DAY_S:.4f}, {line['id']}: {line['text']}"
        if latches:
            self.lived.false_latches.append(said)
        if self._state in ENERGISED:
            self.lived.false_stops.append(said)
        if self._tell:
            say(f"life {self._script.seed}, in {self._state}: {said}")

    def _because(self, t_s: float) -> str:
        at = bisect_right(self._due, (t_s, 0.0, "")) - 1
        return self._due[at][2] if at >= 0 and t_s <= self._due[at][1] else ""

    def _midnight(self, day: int) -> None:
        gc.collect()
        lived = self.lived
        lived.mib.append(_rss_mib())
        lived.objects.append(len(gc.get_objects()))
        if self._tell:
            say(
                f"life {self._script.seed}, day {day:2}: {lived.charges:3} charges, "
                f"{len(self._player.played.violations)} missed or wrong, {len(lived.false_stops)} false stops, "
                f"{len(lived.false_latches)} false latches; {lived.mib[-1]:.1f} MiB, {lived.objects[-1]} objects"
            )


def _rss_mib() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def live(seed: int, days: int, *, tell: bool = True) -> Lived:
    """That many consecutive days, in this process."""
    script = script_of(seed, days)
    with stage(script, BUSES["poor"]) as made:
        return Days(script, made, tell=tell).run()
