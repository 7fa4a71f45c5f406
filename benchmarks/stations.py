"""Stations for measurements: emulated bays in another process, and a controller for them, ours or the naive one."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

from orchestrator.sim.client import PlantProcess

#: After this the naive controller or the service is broken, not slow.
CHARGING_S = 60.0
END_S = 10.0
LOG_LINES = 10
#: Bus number n listens on this port + n; two benchmarks running at once do not meet.
FIRST_UDP_PORT = 20_000 + os.getpid() * 64 % 30_000

Wiring = Mapping[str, Any]  #: a bay as named by the plant: name, port, node_id, can (the bus's number)


def bus(number: int) -> dict[str, Any]:
    """A CAN bus across processes that does not leave this machine."""
    channel = f"239.74.163.{number + 2}"
    return {"interface": "udp_multicast", "channel": channel, "port": FIRST_UDP_PORT + number, "hop_limit": 0}


@dataclass(frozen=True, slots=True)
class Station:
    """The bays of one controller. Bay numbers are the plant's, from 1."""

    directory: Path
    numbers: tuple[int, ...]
    bays: tuple[Wiring, ...]
    bitrate: int | None = None

    def station_file(self) -> Path:
        """Written for our service, without state of an earlier run, whose latched faults it would keep."""
        shutil.rmtree(self.directory / "run", ignore_errors=True)
        used = sorted({bay["can"] for bay in self.bays})
        rate = {} if self.bitrate is None else {"bitrate": self.bitrate}
        lines = ["station: bench", "stagger_s: 0", "can:"]
        lines += [f"  can{number}: {json.dumps({**bus(number), **rate})}" for number in used]
        lines += ["bays:", *(line for bay in self.bays for line in _bay_lines(bay))]
        lines += ["control: {socket: run/orchestrator.sock}", "journal: {directory: run/journal}"]
        path = self.directory / "station.yaml"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path


def _bay_lines(bay: Wiring) -> Iterator[str]:
    yield f"  - name: {bay['name']}"
    yield f"    charger: {{port: {bay['port']}, control: manual, steps_a: [2.0, 5.0, 8.0, 11.0, 14.0]}}"
    yield f"    battery: {{can: can{bay['can']}, node_id: {bay['node_id']}, map: tabos}}"
    yield "    limits: {voltage_v: 58.4, current_a: 15.0, temperature_c: [0, 45]}"
    yield "    policy: li-ion-48v"


Side = Callable[[Station], list[str]]  #: how a controller for a station is started


def module(name: str, *arguments: str) -> list[str]:
    """The command line of a module of this package."""
    return [sys.executable, "-m", f"benchmarks.{name}", *arguments]


def ours(station: Station) -> list[str]:
    """The service: the guardian, which starts the controller."""
    return [sys.executable, "-m", "orchestrator", "run", str(station.station_file())]


def naive(station: Station) -> list[str]:
    """The script of `naive.py`."""
    return module("naive", json.dumps(wirings(station)))


def wirings(station: Station) -> list[dict[str, Any]]:
    """The bays in the form for `naive.py` and `bare.py`."""
    return [{"port": bay["port"], "node_id": bay["node_id"], "can": bus(bay["can"])} for bay in station.bays]


class Controller:
    """A started controller. Its standard output is `output` after `end()`."""

    def __init__(self, station: Station, side: Side) -> None:
        station.directory.mkdir(parents=True, exist_ok=True)
        argv = side(station)
        with (station.directory / "log").open("w") as log, (station.directory / "output").open("w") as output:
            self._process = subprocess.Popen(argv, stdout=output, stderr=log)
        self._directory = station.directory

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """It ended by itself, which it should not."""
        return self._process.poll() is not None

    @property
    def output(self) -> str:
        """Its standard output."""
        return (self._directory / "output").read_text(encoding="utf-8")

    @property
    def log(self) -> str:
        """Its messages to people."""
        return (self._directory / "log").read_text(encoding="utf-8")

    def tell_to_end(self) -> None:
        """SIGTERM; `end` waits."""
        self._process.send_signal(signal.SIGTERM)

    def end(self) -> None:
        """Wait for the end requested by `tell_to_end`."""
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class Controllers:
    """`with Controllers(stations, side) as running:` – started together, ended together."""

    def __init__(self, stations: Sequence[Station], side: Side) -> None:
        self._stations, self._side = stations, side
        self.running: list[Controller] = []

    def __enter__(self) -> Self:
        for station in self._stations:
            self.running.append(Controller(station, self._side))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for controller in self.running:
            controller.tell_to_end()
        for controller in self.running:
            controller.end()

    @property
    def pids(self) -> list[int]:
        """All processes: those started, and their children."""
        return [pid for controller in self.running for pid in (controller.pid, *_children(controller.pid))]

    def check(self) -> None:
        """RuntimeError if one of them has ended by itself, which invalidates the measurement."""
        if any(controller.has_ended for controller in self.running):
            raise RuntimeError(f"a controller has ended by itself:\n{self.log()}")

    def log(self) -> str:
        """The last output of each, for a failure's message."""
        return "\n".join("\n".join(controller.log.splitlines()[-LOG_LINES:]) for controller in self.running)


def _children(pid: int) -> list[int]:
    stats = [path.read_text(encoding="utf-8") for path in Path("/proc").glob("[0-9]*/stat")]
    return [int(stat.split(maxsplit=1)[0]) for stat in stats if int(stat.rpartition(")")[2].split()[1]) == pid]


@contextmanager
def plant(bays: int, buses: int = 1, *args: str) -> Iterator[tuple[PlantProcess, Path]]:
    """An emulated station of that many bays, spread evenly over that many CAN buses, with a directory for its files."""
    with TemporaryDirectory(prefix="bench-") as name:
        directory = Path(name)
        cans = [text for number in range(buses) for text in ("--can", json.dumps(bus(number)))]
        with PlantProcess(directory, "--bays", str(bays), *cans, *args) as process:
            yield process, directory


def one_station(process: PlantProcess, directory: Path, bitrate: int | None = None) -> list[Station]:
    """All bays under one controller."""
    return [Station(directory / "all", tuple(range(1, len(process.bays) + 1)), tuple(process.bays), bitrate)]


def a_station_each(process: PlantProcess, directory: Path) -> list[Station]:
    """One controller for each bay."""
    return [
        Station(directory / f"only-{number}", (number,), (bay,)) for number, bay in enumerate(process.bays, start=1)
    ]


def wait_until_charging(process: PlantProcess, controllers: Controllers) -> None:
    """Wait until current flows in every bay; RuntimeError with the controllers' logs if that takes too long."""
    end_s = time.monotonic() + CHARGING_S
    while not all(is_charging(bay) for bay in process.ask({"query": "state"})["bays"]):
        controllers.check()
        if time.monotonic() > end_s:
            raise RuntimeError(f"the bays do not charge within {CHARGING_S:g} s:\n{controllers.log()}")
        time.sleep(0.2)


def is_charging(state: Mapping[str, Any]) -> bool:
    """As reported by the emulator."""
    return bool(state["operation"] == 1 and state["current_a"] > 1.0)
