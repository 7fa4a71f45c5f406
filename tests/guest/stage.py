"""A station in mid-charge on a kernel CAN interface, and ways to disturb it."""

import fcntl
import json
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.sim.client import PlantProcess
from tests.guest.figures import FIGURES, Figure
from tests.waiting import wait_until
from tests.whole.station import Service, station_document

SIOCSIFFLAGS, IFF_UP = 0x8914, 0x1  #: linux/sockios.h, linux/if.h
RUN = ("-m", "orchestrator", "run")
#: The guest has one slow processor.
CHARGING_S = 60.0
#: Polling more often slows down what is polled.
LOOK_S = 0.1
#: 10 s without the fault, 10 s of backoff, then the bay qualifies again.
AGAIN_S = 60.0
#: A pack cold enough for the lowest current step; a warm one charges on the highest.
COLD_C = 5.0
TOP_STEP, LOWEST_STEP = 4, 0


def ip(*words: str) -> None:
    """The technician's tool for interfaces."""
    subprocess.run(["ip", *words], check=True, timeout=60)


def switch(name: str, *, up: bool) -> None:
    """`ip link set NAME up|down` without the 0.3 s a program needs to start in the guest."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sh14x", name.encode(), IFF_UP if up else 0)
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, request)


@contextmanager
def vcan(name: str) -> Iterator[str]:
    """A virtual CAN interface that is up."""
    ip("link", "add", name, "type", "vcan")
    try:
        switch(name, up=True)
        yield name
    finally:
        ip("link", "delete", name)


@dataclass(frozen=True)
class Scene:
    """One bay: emulators and the service."""

    plant: PlantProcess
    service: Service

    def until(self, condition: Callable[[dict[str, Any]], object], what: str, timeout_s: float = 10.0) -> None:
        """Wait until it is true of the real charger and pack."""
        wait_until(lambda: condition(self.plant.state()), timeout_s, what, LOOK_S)

    def charges(self) -> None:
        """Wait for a steady charge with a warm pack."""
        self.service.wait("CHARGING", timeout_s=CHARGING_S)
        self.until(lambda truth: truth["current_a"] > 13, "a steady charge", CHARGING_S)
        assert self.plant.state()["current_limit"] == TOP_STEP

    def stopped_by(self, happen: Callable[[], object]) -> float:
        """Trigger it and wait for the charger's standby; returns the seconds until its first stop byte."""
        self.plant.inject("heal")  # watch for the first stop from here on
        happened_s = time.monotonic()
        happen()
        self.until(lambda truth: truth["first_stop_s"], "a stop")
        self.until(lambda truth: truth["operation"] == 0, "the charger's standby")
        return float(self.plant.state()["first_stop_s"]) - happened_s

    def charges_again(self, mend: Callable[[], object] | None = None) -> float:
        """Repair the break (None: it heals itself) and wait for the next charge; returns the seconds until then.

        The next charge must use fresh readings only: the pack is made cold before the repair, so a command
        based on an old temperature would show.
        """
        guardian, seen = self.service.guardian, len(self.service.path_of("bay-1"))
        if mend is not None:
            self.plant.inject("under_temperature", value=COLD_C)
            self.until(lambda truth: truth["temperature_c"] < COLD_C + 1, "a cold pack")
        mended_s = time.monotonic()
        if mend is not None:
            mend()
        self.service.wait("CHARGING", timeout_s=AGAIN_S)
        again_s = time.monotonic() - mended_s
        self.until(lambda truth: truth["current_a"] > 1, "a current")
        if mend is not None:
            assert self.plant.state()["current_limit"] == LOWEST_STEP
            assert self.steps_ordered(mended_s) == {LOWEST_STEP}
        assert "QUALIFYING" in self.service.path_of("bay-1")[seen:]
        assert self.service.guardian == guardian
        return again_s

    def steps_ordered(self, since_s: float) -> set[int]:
        """The current steps decided since then, from the journal."""
        decisions = self.service.journal("bay-1", "decision")
        return {line["step"]["index"] for line in decisions if line["step"] and line["t"] >= since_s}


def note(what: str, stop_s: float, again_s: float | None = None, *, held: bool = False) -> None:
    """Put it into the table of figures."""
    FIGURES.append(Figure(what, stop_s, again_s, held))


@contextmanager
def station(
    directory: Path,
    ours: dict[str, Any],
    theirs: dict[str, Any] | None = None,
    *args: str,
    run: Sequence[str] = RUN,
) -> Iterator[Scene]:
    """The emulators and the service, each on its own CAN settings where they differ; `run` starts the service."""
    service = Service(directory, station_document(directory, [ours], 1), run)
    with PlantProcess(directory, "--can", json.dumps(theirs or ours), *args) as plant:
        try:
            yield Scene(plant, service.start())
        except BaseException:
            print(service.log())
            raise
        finally:
            service.close()


def socketcan(channel: str) -> dict[str, Any]:
    """How a station file names an interface of the kernel."""
    return {"interface": "socketcan", "channel": channel, "bitrate": 250000}
