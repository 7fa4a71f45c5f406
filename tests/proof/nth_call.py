"""Fail the Nth call: every call below the service during a whole charge fails in turn, with each of its errors.

    python -m tests.proof.nth_call                     all of them, on all processors
    python -m tests.proof.nth_call --every 10          every tenth
    python -m tests.proof.nth_call --only 'write:EIO:once:512'    one of them again

A charge here takes a deeply discharged toy pack from the first pulse to full, in virtual time, with the real pyserial
and the real `link/can.py`. A call fails once, or it and all calls of its line for 3 s. Whatever happens, the invariants
of `play.py` hold and the charge ends in a verified stop.
"""

import argparse
import errno
import multiprocessing
import os
import select
import struct
import sys
import termios
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import can
import serial

from orchestrator.core.states import SETTLED
from orchestrator.model import ControlMode, Decision, State
from orchestrator.sim.presets import PACKS
from tests.proof.play import POLICIES, Player
from tests.proof.report import say
from tests.proof.script import BaySetup, Script
from tests.proof.virtual_rig import Nature
from tests.proof.virtual_service import World, station, world

#: States of a link before it is first heard.
FIRST = ("port_not_opened", "port_opened", "bmu_not_asked")
#: Twice the time of an undisturbed charge, plus a backoff.
END_S = 75.0
#: A failure shows within this.
SEEN_S = 1.0
#: A failure that lasts.
LASTS_S = 3.0

Fault = Callable[[], Any]  #: raises, or returns the call's replacement result


def _raises(make: Callable[[], BaseException]) -> Fault:
    def fail() -> None:
        raise make()

    return fail


def _os(number: int) -> Fault:
    return _raises(lambda: OSError(number, os.strerror(number)))


def _message(**fields: Any) -> Fault:
    return lambda: can.Message(is_error_frame=True, is_extended_id=False, **fields)


GONE = {"EIO": _os(errno.EIO), "ENXIO": _os(errno.ENXIO), "ENODEV": _os(errno.ENODEV)}
ODD = {"TypeError": _raises(lambda: TypeError("closed under us")), "SerialException": _raises(serial.SerialException)}
TERMIOS = {"termios.error": _raises(lambda: termios.error(5, "EIO"))}
DOWN = {
    "CanOperationError": _raises(lambda: can.CanOperationError("Network is down", 100)),
    "ENETDOWN": _os(100),
    **GONE,
}

#: Call → its possible failures.
ERRORS: dict[str, dict[str, Fault]] = {
    "open": {name: _os(getattr(errno, name)) for name in ("ENOENT", "EACCES", "EBUSY", "EIO", "EMFILE")},
    "pipe": {"EMFILE": _os(errno.EMFILE)},
    "flock": {"EAGAIN": _os(errno.EAGAIN), "ENOLCK": _os(errno.ENOLCK)},
    "ioctl": {"EIO": GONE["EIO"], "ENOTTY": _os(errno.ENOTTY)},
    "tcgetattr": TERMIOS,
    "tcsetattr": TERMIOS,
    "tcflow": TERMIOS,
    "tcflush": TERMIOS,
    "poll": {"ENOMEM": _os(errno.ENOMEM), "POLLHUP": lambda: select.POLLHUP, "ValueError": _raises(ValueError)},
    "read": {**GONE, **ODD, "EAGAIN": _os(errno.EAGAIN), "nothing": lambda: b"", "noise": lambda: b"\xaf\xfa\x90\xff"},
    "write": {**GONE, **ODD, "EAGAIN": _os(errno.EAGAIN), "short": lambda: 3},
    "close": {"EIO": GONE["EIO"]},
    "can open": {"ENODEV": GONE["ENODEV"], "CanInitializationError": _raises(lambda: can.CanInitializationError("no"))},
    "can recv": {
        **DOWN, "struct.error": _raises(lambda: struct.error("short")), "ValueError": _raises(ValueError),
        "bus-off": _message(arbitration_id=0x40, data=bytes(8)),
        "error-passive": _message(arbitration_id=0x04, data=bytes((0, 0x20, 0, 0, 0, 0, 0, 0))),
    },
    "can send": {
        **DOWN, "ENOBUFS": _os(errno.ENOBUFS),
        "buffer full": _raises(lambda: can.CanOperationError("Transmit buffer full")),
        "CanTimeoutError": _raises(can.CanTimeoutError),
    },
    "can shutdown": {"OSError": GONE["EIO"]},
}  # fmt: skip


#: No kernel reports "readable" and then "nothing to read" for seconds.
ONCE = {("poll", "POLLHUP"), ("read", "EAGAIN")}


@dataclass(frozen=True, slots=True)
class Case:
    """How the call with this number fails."""

    call: str
    error: str
    lasting: bool
    number: int

    def __str__(self) -> str:
        return f"{self.call}:{self.error}:{'lasting' if self.lasting else 'once'}:{self.number}"

    @classmethod
    def parse(cls, text: str) -> "Case":
        call, error, how, number = text.split(":")
        return cls(call, error, how == "lasting", int(number))


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a charge."""

    full: bool
    interrupted: bool  #: a stop came before full
    recorded: bool  #: a link reported a problem, or a fault was raised
    calls: tuple[str, ...]
    violations: tuple[str, ...]

    @property
    def word(self) -> str:
        if self.violations:
            return "VIOLATION"
        if self.full:
            return "recovered" if self.interrupted else "went on, recorded" if self.recorded else "went on"
        return "stopped" if self.interrupted else "went on, recorded" if self.recorded else "went on"


class Charge:
    """One charge with one failing call."""

    def __init__(self, on: World, case: Case | None, *, brief: bool) -> None:
        self.world, self.case = on, case
        self.full = self.interrupted = self.recorded = False
        self.calls: list[str] = []
        self._until_s = 0.0
        self.brief = brief
        self.player = Player(Script(0, (BaySetup("demo", line="perfect"),), (), END_S, 0.0, sweep_s=0.3), on)
        self.player.out_of_reach = lambda: self.world.time.now_s < self._until_s
        self._watch = on.on_step
        on.on_step = self._stepped
        on.kernel.calls.on_call = self._called

    def run(self) -> Outcome:
        played = self.player.run()
        if self.world.rigs[0].bay.charger.running:
            played.violations.append("t = end, bay 0, end: the charger runs")
        elif self._until_s > self.world.time.now_s - LASTS_S:  # it failed to the very end and reports it
            played.violations = [line for line in played.violations if "NOT verified" not in line]
        return Outcome(self.full, self.interrupted, self.recorded, tuple(self.calls), tuple(played.violations))

    def _called(self, name: str) -> Any:
        self.calls.append(name)
        case, now_s = self.case, self.world.time.now_s
        if case is None:
            return None
        if len(self.calls) - 1 == case.number:
            self._until_s = now_s + LASTS_S
        elif not (case.lasting and name == case.call and now_s < self._until_s):
            return None
        return ERRORS[case.call][case.error]()

    def _stepped(self, runner: Any) -> None:
        self._watch(runner)
        decision, snapshot = runner.decision, runner._snapshot
        self.full = self.full or decision.state is State.FULL
        self.interrupted = self.interrupted or (bool(decision.faults) and not self.full)
        for link in (snapshot.charger_link, snapshot.battery_link):
            if link.problem is not None and link.problem.id not in FIRST:
                self.recorded = True
            self.recorded = self.recorded or link.bad_frames > 0 or bool(decision.faults)
        if self.full or (self.brief and self._until_s and self._settled(decision)):
            self.world.time.call_later(0.5, self.world.end)

    def _settled(self, decision: Decision) -> bool:
        """A stop was verified, or the charge continued for long enough."""
        if self.interrupted:
            return decision.state in SETTLED and decision.command is None
        return self.world.time.now_s > self._until_s + SEEN_S


def charge(case: Case | None, *, brief: bool = False) -> Outcome:
    """The whole charge; `brief`: until the failure's result shows."""
    the_station = station([ControlMode.MANUAL], [POLICIES["demo"]], sweep_s=0.3)
    with world(the_station, [Nature(PACKS["demo"](), line="perfect", speed=6)], end_s=END_S + 60) as made:
        return Charge(made, case, brief=brief).run()


def cases(every: int) -> Iterator[Case]:
    """Each call of an undisturbed charge (every `every`-th), with each of its errors, once and lasting."""
    seen: Counter[str] = Counter()
    for number, call in enumerate(charge(None).calls):
        seen[call] += 1
        for at, error in enumerate(ERRORS[call]):
            for lasting in (False, True)[: 1 if (call, error) in ONCE else 2]:
                if (seen[call] + at) % every == 0 or seen[call] <= 1:
                    yield Case(call, error, lasting, number)


def outcome(case: Case) -> tuple[Case, Outcome]:
    """Every tenth charge runs to its end, so that recoveries show too."""
    return case, charge(case, brief=case.number % 10 != 0)


def main(argv: Sequence[str] | None = None) -> int:
    """All of them, with a table; 1 if an invariant was broken."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--every", type=int, default=1, help="only every Nth of them")
    parser.add_argument("--only", type=Case.parse, help="CALL:ERROR:once|lasting:NUMBER")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args(argv)
    if arguments.only is not None:
        only = charge(arguments.only)
        say("\n".join((only.word, *only.violations)))
        return 1 if only.violations else 0
    began_s = time.monotonic()
    with multiprocessing.get_context("fork").Pool(arguments.workers) as pool:
        results = pool.map(outcome, list(cases(arguments.every)), chunksize=32)
    table = Counter((case.call, case.error, case.lasting, result.word) for case, result in results)
    for (call, error, lasting, word), times in sorted(table.items()):
        say(f"{call:13} {error:22} {'3 s ' if lasting else 'once'}  {word:18} {times:5}")
    wrong = [(case, result) for case, result in results if result.violations]
    took_s = time.monotonic() - began_s
    say(f"{len(results)} failures of {len(charge(None).calls)} calls in {took_s:.0f} s; {len(wrong)} violations")
    for case, result in wrong[:10]:
        say(f"{case}: {'; '.join(result.violations)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
