"""The soak's real part: the demo's two processes on a poor line and a poor bus, for as long as one likes.

Batteries come, are charged and leave; now and then something breaks in mid-charge, is found out, mended and reset.
The emulated station says what is true, the service's own journal what it made of it.

To be run on a quiet machine: what goes through a pty goes through a thread of the kernel that no priority reaches. If
that has to wait for half a second, the service stops, its guardian ends it, and it is started anew, which is counted.
"""

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from random import Random
from typing import Any

from orchestrator.core.states import ENERGISED
from orchestrator.demo.stage import Stage
from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.model import State
from orchestrator.sim.faults import FAULTS
from tests.proof.truth import MARGIN_S, SILENT_S, VERIFY_S
from tests.waiting import wait_until

LOOK_S = 0.1
SAMPLE_S = 10.0
#: What needs longer to show itself, or to be believed, than SILENT_S.
LATER_S = {
    "stale_reading": 0.5, "implausible_soc": 1.0, "volts_disagree": 3.0, "amps_disagree": 5.0, "over_temperature": 7.0,
    "under_temperature": 6.0, "command_ignored": 5.0, "battery_removed": 1.0,
}  # fmt: skip
#: Nothing to stop for in the middle of these charges: a temperature that stays is not seen, a charger's values that
#: stay only after a minute, what shows in a precharge or at rest neither, and of a SOC that jumps people are warned.
UNSEEN = ("heal", "frozen_charger", "frozen_temperature", "precharge_no_rise", "rogue_run", "soc_jump")
#: A deeply discharged toy is full within a minute, and a charge that was refused is tried again after a backoff.
BEGIN_S, FULL_S, BACKOFF_S = 25.0, 150.0, 330.0
#: What was mended is believed after this; what follows an injection, a departure or a mending is due to it.
MENDED_S, DUE_S = 6.0, 5.0
STANDS_A = 0.5
#: What one step has to say is written down within this, its change of state first.
STEP_S = 0.01
#: A bay of a service that does not answer.
NOBODY: dict[str, Any] = {"state": "", "reason": "", "alarm": "none", "command": {"order": {"action": ""}}}


@dataclass(slots=True)
class Sample:
    """One process at one time."""

    pid: int
    t_s: float
    mib: float
    descriptors: int
    threads: int


@dataclass(slots=True)
class Real:
    """What came of it."""

    charges: int = 0
    departures: int = 0
    requests: int = 0
    faults: int = 0
    stops_s: dict[str, list[float]] = field(default_factory=dict)  #: fault → from its moment to the first stop byte
    missed: list[str] = field(default_factory=list)
    false_stops: list[str] = field(default_factory=list)
    false_latches: list[str] = field(default_factory=list)
    restarts: list[str] = field(default_factory=list)  #: of the service, after its guardian had ended it
    odd: list[str] = field(default_factory=list)  #: whatever else should not have been
    samples: dict[str, list[Sample]] = field(default_factory=lambda: {"guardian": [], "controller": []})
    status: int = -1  #: the service's exit status


class Life:
    """One bay's life on a stage."""

    def __init__(self, stage: Stage, end_s: float, seed: int) -> None:
        self._stage, self._plant, self._end_s = stage, stage.plant, end_s
        self._dice = Random(seed)
        self._faults: list[str] = []
        self._sampled_s = 0.0
        self._began_s = time.monotonic()
        self.real = Real()
        self.due: list[tuple[float, float]] = []  #: between these times whatever happens is due to what was done

    def live(self) -> None:
        while time.monotonic() < self._end_s:
            self._stay()

    def _stay(self) -> None:
        """A battery comes, is charged, or not, and goes."""
        self._arrive()
        if self._until(self._charging, BEGIN_S):
            dice = self._dice.random()
            if dice < 0.5 and self._until(lambda: self._plant.state()["current_a"] > 5, 30.0):
                self._break(self._next_fault())
            elif dice < 0.6:
                self._pause()
            if dice < 0.9 and self._until(self._charging, 1.0) and self._until(self._full, FULL_S):
                self.real.charges += 1
        else:
            self._wait_for_leave_to_charge()
        self._leave()

    def _wait_for_leave_to_charge(self) -> None:
        bay = self._bay()
        self._mend()
        if not self._until(lambda: self._charging() or self._full(), BACKOFF_S):
            self.real.odd.append(
                f"{self._t_s():.0f} s: no charge within {BACKOFF_S:g} s: {bay['state']}, {bay['reason']}"
            )

    def _arrive(self) -> None:
        began_s = time.monotonic()
        self._plant.inject("heal")
        self._plant.set(soc_pct=self._dice.choice((-100.0, -100.0, 5.0, 30.0, 50.0)), temperature_c=20.0)
        self._plant.inject("bmu_reboot")
        self._until_passed(2.0)
        self.due.append((began_s, time.monotonic() + DUE_S))

    def _leave(self) -> None:
        began_s = time.monotonic()
        self._plant.inject("battery_removed")
        self._until_passed(self._dice.uniform(4.0, 12.0))
        self.due.append((began_s, time.monotonic() + DUE_S))
        self.real.departures += 1

    def _pause(self) -> None:
        began_s = time.monotonic()
        self._ask("pause")
        if not self._until(self._stands, VERIFY_S):
            self.real.missed.append(f"{self._t_s():.0f} s: pause: {self._plant.state()}")
        self._until_passed(self._dice.uniform(1.0, 8.0))
        self._ask("start")
        self.due.append((began_s, time.monotonic()))
        self._until(self._charging, BEGIN_S)

    # --- faults -------------------------------------------------------------------------------------------------------

    def _next_fault(self) -> str:
        """Each of them before any of them again."""
        if not self._faults:
            self._faults = [name for name in FAULTS if name not in UNSEEN]
            self._dice.shuffle(self._faults)
        return self._faults.pop()

    def _break(self, name: str) -> None:
        self.real.faults += 1
        injected_s = self._plant.inject(name)
        if name == "ignore_stop":
            self._ask("stop")
        within_s = SILENT_S + LATER_S.get(name, 0.0) + VERIFY_S + MARGIN_S
        if not self._until(lambda: self._stands() or self._named(), within_s):
            self.real.missed.append(f"{self._t_s():.0f} s: {name}: {self._plant.state()}")
        self._until_passed(self._dice.uniform(2.0, 8.0))
        first_s = self._plant.state()["first_stop_s"]  # late: a charger that stands by itself is told a moment after
        stops_s = self.real.stops_s.setdefault(name, [])
        if first_s is not None:
            stops_s.append(first_s - injected_s)
        self._mend()
        self.due.append((injected_s, time.monotonic() + DUE_S))
        self._until(self._charging, BEGIN_S)

    def _mend(self) -> None:
        """What a person does: take the cause away, reset, start."""
        self._plant.inject("heal")
        self._until_passed(MENDED_S)
        self._ask("reset")
        self._ask("start")

    def _ask(self, verb: str) -> None:
        self.real.requests += 1
        with suppress(ServiceError):  # it is just being started, and looked at soon
            ask(self._stage.directory / "run" / "orchestrator.sock", {"verb": verb, "bays": None})

    # --- looking ------------------------------------------------------------------------------------------------------

    def _charging(self) -> bool:
        return str(self._bay()["state"]) in ENERGISED

    def _full(self) -> bool:
        return str(self._bay()["state"]) == State.FULL

    def _stands(self) -> bool:
        truth = self._plant.state()
        return int(truth["operation"]) == 0 and abs(truth["current_a"]) < STANDS_A

    def _named(self) -> bool:
        bay = self._bay()
        cut_off = bay["state"] in ("OFFLINE", "TRIPPED") and bay["command"]["order"]["action"] == "stop"
        return bay["alarm"] == "danger" or cut_off

    def _bay(self) -> dict[str, Any]:
        if self._stage.service.poll() is not None:
            self._restart()
        return self._stage.bay() or NOBODY

    def _restart(self) -> None:
        """As systemd does: on a machine that lets nobody run for half a second, the guardian ends the controller."""
        began_s = time.monotonic()
        last = self._stage.log.read_text(encoding="utf-8").splitlines()[-1]
        self.real.restarts.append(f"{self._t_s():.0f} s: status {self._stage.service.returncode}: {last}")
        if not self._stands():
            self.real.missed.append(f"{self._t_s():.0f} s: the service has ended and the charger runs")
        self._stage.restart()
        self._mend()
        self.due.append((began_s, time.monotonic() + DUE_S))

    def _until_passed(self, seconds: float) -> None:
        self._until(lambda: False, seconds)

    def _until(self, condition: Callable[[], bool], within_s: float) -> bool:
        deadline_s, came = time.monotonic() + within_s, False

        def over() -> bool:
            nonlocal came
            now_s, came = time.monotonic(), condition()
            if now_s - self._sampled_s >= SAMPLE_S:
                self._sample(now_s)
            return came or now_s > deadline_s

        wait_until(over, inf, every_s=LOOK_S)
        return came

    def _odd(self, text: str) -> None:
        self.real.odd.append(f"{self._t_s():.0f} s: {text}")

    def _t_s(self) -> float:
        return time.monotonic() - self._began_s

    def _sample(self, now_s: float) -> None:
        self._sampled_s = now_s
        guardian = self._stage.service.pid
        with suppress(OSError):  # it has just ended
            controllers = Path(f"/proc/{guardian}/task/{guardian}/children").read_text(encoding="utf-8").split()
            for name, pid in (("guardian", guardian), *(("controller", int(pid)) for pid in controllers)):
                self.real.samples[name].append(_sample_of(pid, now_s - self._began_s))


def _sample_of(pid: int, t_s: float) -> Sample:
    process = Path(f"/proc/{pid}")
    pages = int((process / "statm").read_text(encoding="utf-8").split()[1])
    mib = round(pages * os.sysconf("SC_PAGE_SIZE") / 2**20, 2)
    return Sample(pid, t_s, mib, len(list((process / "fd").iterdir())), len(list((process / "task").iterdir())))


def live(minutes: float, seed: int = 1) -> Real:
    """Let it live for so long, and judge by the journal what the service made of it."""
    with suppress(PermissionError):  # else whatever else this machine does is measured as well
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    with Stage("--line", "poor", "--bus", "poor") as stage:
        life = Life(stage, time.monotonic() + 60 * minutes, seed)
        life.live()
        real = life.real
        real.status = stage.end()
        judge(real, stage.directory / "run" / "journal", life.due)
    return real


def judge(real: Real, journal: Path, due: list[tuple[float, float]]) -> None:
    """A fault that stops or latches while nothing was wrong is a false one."""
    state, before, changed_s = "", "", 0.0
    for line in _lines(journal):
        if line["kind"] == "transition":
            before, state, changed_s = state, line["to"], line["t"]
        if line["kind"] != "fault" or line["event"] != "raised" or line["effect"] not in ("PAUSE", "STOP", "TRIP"):
            continue
        if any(from_s <= line["t"] <= to_s for from_s, to_s in due):
            continue
        said = f"{line['wall']}: {line['id']}: {line['text']}"
        if line["effect"] == "TRIP":
            real.false_latches.append(said)
        if (before if line["t"] - changed_s < STEP_S else state) in ENERGISED:
            real.false_stops.append(said)


def _lines(journal: Path) -> Iterator[dict[str, Any]]:
    for path in sorted(journal.glob("events*.jsonl*")):
        for line in path.read_text(encoding="utf-8").splitlines():
            yield json.loads(line)
