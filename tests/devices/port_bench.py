"""A running charger port and the reports from it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from orchestrator.config.station import ChargerConfig, Limits
from orchestrator.devices.charger import ChargerPort
from orchestrator.devices.charger_line import ChargerLine
from orchestrator.interlock import Grant
from orchestrator.keys import Range
from orchestrator.link.serial import SerialLine
from orchestrator.model import STOP, Action, ChargerLink, ChargerReading, Command, ControlMode
from tests.core.said import say
from tests.devices.fake_charger import FakeCharger
from tests.waiting import wait_until

LIMITS = Limits(voltage_v=58.4, current_a=15.0, temperature_c=Range(0.0, 45.0))
SET_STEP_2 = Command(Action.SET_LIMIT, 1)
#: Allowance for a busy machine.
SLACK_S = 0.1


def good(seconds: float = 60.0) -> Grant:
    return Grant(time.monotonic() + seconds, 50.0, 20.0, 1)


class Bench:
    """One running port."""

    def __init__(self, path: str, control: ControlMode, open_line: Callable[[], ChargerLine] | None = None) -> None:
        self.seen: list[tuple[ChargerReading | None, ChargerLink]] = []
        self.upset: Exception | None = None
        config = ChargerConfig(port=path, control=control, steps_a=(2.0, 5.0, 8.0, 11.0, 14.0))
        self.port = ChargerPort(
            config,
            LIMITS,
            open_line=open_line or (lambda: SerialLine.open(path)),
            clock=time.monotonic,
            on_change=self._changed,
        )

    def _changed(self) -> None:
        self.seen.append(self.port.view)
        if self.upset:
            raise self.upset

    @property
    def link(self) -> ChargerLink:
        return self.port.view[1]

    @property
    def reading(self) -> ChargerReading:
        reading = self.port.view[0]
        assert reading is not None
        return reading

    def wait_online(self, command: Command | None = STOP) -> None:
        """Online, with this standing command: a port just opened starts with its own."""
        wait_until(lambda: self.link.online, what="online")
        self.port.command(command, good())

    def wait_problem(self, text: str) -> None:
        wait_until(lambda: text in say(self.link.problem), what=f"the problem {text!r}")
        assert not self.link.online

    def wait_step(self, step: int) -> None:
        wait_until(lambda: self.reading.current_step == step, what=f"step {step}")

    def wait_age(self, age_s: float) -> None:
        asked_s = self.reading.t_s
        wait_until(lambda: time.monotonic() >= asked_s + age_s)

    def wait_readings(self, count: int, *, since: int = 0) -> None:
        """The number of distinct readings reported, in total or since a given report."""
        wait_until(lambda: len({reading.t_s for reading, _ in self.seen[since:] if reading}) >= count)


@contextmanager
def running(
    path: str, control: ControlMode = ControlMode.MANUAL, open_line: Callable[[], ChargerLine] | None = None
) -> Iterator[Bench]:
    bench = Bench(path, control, open_line)
    bench.port.start()
    try:
        yield bench
    finally:
        bench.port.close()


def wait_frames(charger: FakeCharger, count: int) -> list[bytes]:
    wait_until(lambda: len(charger.frames) >= count, what=f"{count} frames")
    return [frame for _, frame in charger.frames[:count]]
