"""The soak's real part: the demo's two processes on a poor line and a poor bus, for any length of time.

Batteries arrive, charge and leave; now and then something breaks in mid-charge, is detected, repaired and reset. The
emulated station gives the true state, the service's own journal its response.

Run it on a quiet machine: a pty's data passes through a kernel thread that no priority affects. If that thread waits
for half a second, the service stops, its guardian ends it, and the restart is counted.
"""

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
from orchestrator.service.journal_files import files_of, records_of
from orchestrator.sim.faults import FAULTS
from tests.proof.truth import MARGIN_S, SILENT_S, VERIFY_S
from tests.waiting import wait_until

LOOK_S = 0.1
SAMPLE_S = 10.0
#: Faults that need longer than SILENT_S to show or to be believed.
LATER_S = {
    "stale_reading": 0.5, "implausible_soc": 1.0, "volts_disagree": 3.0, "amps_disagree": 5.0, "over_temperature": 10.0,
    "under_temperature": 8.5, "command_ignored": 5.0, "battery_removed": 1.0,
}  # fmt: skip
#: Faults that stop no charge here: a stuck temperature is not detected, stuck charger values
#: only after a minute, others show in a precharge or at rest only, and a jump of the SOC is just a warning.
UNSEEN = ("heal", "frozen_charger", "frozen_temperature", "precharge_no_rise", "rogue_run", "soc_jump")
#: A deeply discharged toy pack is full within a minute, and a refused charge is tried again after a backoff.
BEGIN_S, FULL_S, BACKOFF_S = 25.0, 150.0, 330.0
#: A repair is believed after this; events this soon after an injection, a removal or a repair are due to it.
MENDED_S, DUE_S = 6.0, 5.0
STANDS_A = 0.5
#: The records of one decision are written within this, its transition first.
STEP_S = 0.01
#: A bay of a service that does not answer.
NOBODY: dict[str, Any] = {"state": "", "reason": "", "alarm": "none", "command": {"order": {"action": ""}}}


@dataclass(slots=True)
class Sample:
    """A process at one time."""

    pid: int
    t_s: float
    mib: float
    descriptors: int
    threads: int


@dataclass(slots=True)
class Real:
    """The results."""

    charges: int = 0
    departures: int = 0
    requests: int = 0
    faults: int = 0
    stops_s: dict[str, list[float]] = field(default_factory=dict)  #: fault → from its moment to the first stop byte
    missed: list[str] = field(default_factory=list)
    false_stops: list[str] = field(default_factory=list)
    false_latches: list[str] = field(default_factory=list)
    restarts: list[str] = field(default_factory=list)  #: of the service, after its guardian ended it
    odd: list[str] = field(default_factory=list)  #: any other unexpected event
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
        self.due: list[tuple[float, float]] = []  #: events between these times are due to our own actions

    def live(self) -> None:
        while time.monotonic() < self._end_s:
            self._stay()

    def _stay(self) -> None:
        """A battery arrives, charges or not, and leaves."""
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
        """Each of them once before any repeats."""
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
        first_s = self._plant.state()["first_stop_s"]  # late: a charger in standby by itself is told a moment later
        stops_s = self.real.stops_s.setdefault(name, [])
        if first_s is not None:
            stops_s.append(first_s - injected_s)
        self._mend()
        self.due.append((injected_s, time.monotonic() + DUE_S))
        self._until(self._charging, BEGIN_S)

    def _mend(self) -> None:
        """A person's actions: remove the cause, reset, start."""
        self._plant.inject("heal")
        self._until_passed(MENDED_S)
        self._ask("reset")
        self._ask("start")

    def _ask(self, verb: str) -> None:
        self.real.requests += 1
        with suppress(ServiceError):  # it is just being started; check again soon
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
        """Like systemd: if the machine stalls for half a second, the guardian ends the controller."""
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
    """Let it live for that long, and judge the service by its journal."""
    with suppress(PermissionError):  # otherwise the machine's other load is measured too
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    with Stage("--line", "poor", "--bus", "poor") as stage:
        life = Life(stage, time.monotonic() + 60 * minutes, seed)
        life.live()
        real = life.real
        real.status = stage.end()
        judge(real, stage.directory / "run" / "journal", life.due)
    return real


def judge(real: Real, journal: Path, due: list[tuple[float, float]]) -> None:
    """A fault that stops or latches while nothing is wrong is false."""
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
    for _, _, line in records_of(files_of(journal.glob("events*.jsonl*")), lambda _: True):
        if isinstance(line, dict):
            yield line
