"""A whole station over many lives of its gateway, in virtual time: devices stay, processes come and go.

Only the product's foundations are replaced: the kernel, the CAN driver below `link/can.py`, and the control socket
(requests reach the handler behind it, in a service thread). The guardian is the real one, with the controller it
starts; `estop` is the real one; their files are on an emulated disk with realistic losses.
"""

import json
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any

from durand.scheduler import get_scheduler, set_scheduler  # type: ignore[import-untyped]  # it has no annotations

from orchestrator.config import load as load_module
from orchestrator.config.shipped import shipped_dir
from orchestrator.config.station import Station
from orchestrator.errors import ServiceError
from orchestrator.lastresort import asking, estop, guardian, port_owner, running_service
from orchestrator.link import can as can_module
from orchestrator.link import gpio
from orchestrator.service import boot, control, controller
from tests.proof.virtual_can import BusWire, Driver
from tests.proof.virtual_descriptors import ROOT
from tests.proof.virtual_disk import Disk
from tests.proof.virtual_gpio import Chip, Output, VirtualLine
from tests.proof.virtual_kernel import Kernel
from tests.proof.virtual_modules import exchange, path_class, replacements
from tests.proof.virtual_process import Process, Processes
from tests.proof.virtual_rig import Nature, VirtualRig
from tests.proof.virtual_time import Time

SMALL_AH, SMALL_RISE_S = 0.15, 24.0
PYTHON = ("/usr/bin/python3", "-P", "-m")
STEPS_A = (2.0, 5.0, 8.0, 11.0, 14.0)
FIRST_NODE = 0x10
JOURNAL, SOCKET, CHIP = f"{ROOT}journal", f"{ROOT}socket", f"{ROOT}gpiochip"
#: Changes to the shipped policy for a bay whose charges run to their end.
SMALL = {"max_ah: 44 ": f"max_ah: {SMALL_AH} ", "within_min: 5 ": f"within_min: {SMALL_RISE_S / 60} "}
#: A control socket answers within this or not at all.
ANSWER_S, POLL_S = 5.0, 0.002


@dataclass(frozen=True, slots=True)
class Entry:
    """One bay of the station file: its name, and its port and node (0, 1, …)."""

    name: str
    port: int
    node: int
    limit_a: float = 15.0
    policy: str = "li-ion-48v"
    control: str = "manual"
    contactor: bool = False


def port_name(number: int) -> str:
    return f"{ROOT}{number + 1}"


def document(entries: Sequence[Entry], battery: dict[str, Any], *, snapshots: bool = False) -> str:
    """The station file."""
    bays = [
        {
            "name": entry.name,
            "charger": {"port": port_name(entry.port), "control": entry.control, "steps_a": list(STEPS_A)},
            "battery": {"can": "can0", "node_id": FIRST_NODE + entry.node, "map": "tabos", **battery},
            "limits": {"voltage_v": 58.4, "current_a": entry.limit_a, "temperature_c": [0, 45]},
            "policy": entry.policy,
            **({"contactor": {"chip": CHIP, "line": entry.port}} if entry.contactor else {}),
        }
        for entry in entries
    ]
    can = {"can0": {"interface": "virtual", "bitrate": 250_000}}
    journal = {"directory": JOURNAL, "snapshots": snapshots}
    return json.dumps(
        {"station": "virtual", "can": can, "bays": bays, "control": {"socket": SOCKET}, "journal": journal}
    )


@cache
def _directory() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="station")


@cache
def _loaded(path: str, _text: str) -> Station:
    return load_module.load_station(path)


class Door:
    """The control socket: anyone who finds it may use it."""

    def __init__(self, gateway: "Gateway", _path: Any, handler: Callable[..., Any], *_: Any, **__: Any) -> None:
        self._gateway, self.handler = gateway, handler
        self.process: Process = gateway.kernel.me
        self._closed = False

    def start(self) -> None:
        self._gateway.doors.append(self)

    def close(self) -> None:
        self._closed = True

    def stalled(self, _now_s: float) -> bool:
        return False

    @property
    def is_open(self) -> bool:
        return not self._closed and self.process.status is None


@dataclass(slots=True)
class Asked:
    """A person's request and its answers: bay → "" is yes; None without an answer so far."""

    request: dict[str, Any]
    asked_s: float
    answer: dict[str, Any] | None = None
    answered_s: float = inf
    error: str = ""


@dataclass(slots=True)
class Said:
    """A line printed by a process."""

    t_s: float
    process: str
    text: str


@dataclass(slots=True)
class Ended:
    """A process that ended by itself."""

    t_s: float
    name: str
    status: int


class Gateway:
    """The station and its gateway. Only callbacks and the main runner change it, not its threads."""

    def __init__(
        self,
        natures: Sequence[Nature],
        entries: Sequence[Entry],
        *,
        seed: int,
        end_s: float,
        snapshots: bool = False,
        **battery: Any,
    ) -> None:
        self.time = Time(end_s)
        self.entries = list(entries)
        self.disk = Disk(ROOT.rstrip("/"), JOURNAL)
        self.kernel = Kernel(self.time, self.disk)
        self.processes = Processes(self.kernel)
        self.doors: list[Door] = []
        self.said: list[Said] = []
        self.ended: list[Ended] = []
        self.service: Process | None = None  #: the guardian of the current life
        self.controller: Process | None = None
        self.on_end: Callable[[Process], None] = lambda _: None
        self.boots = 1
        self._battery, self._snapshots = battery, snapshots
        self._dice = Random(seed)
        self._lines: dict[int, str] = {}
        self._stack = ExitStack()
        self._stack.callback(set_scheduler, get_scheduler())  # the emulated BMUs replace it by this world's
        self.bus = BusWire(self.time, self.kernel.calls)
        self.rigs = [
            VirtualRig(self.time, self.bus, self.kernel.add(port_name(number)), FIRST_NODE + number, nature)
            for number, nature in enumerate(natures)
        ]
        lines = {number: Output(rig.breaker.drive) for number, rig in enumerate(self.rigs) if rig.breaker is not None}
        self.kernel.chips[CHIP] = Chip(lines)
        self.kernel.on_said = self._on_said
        self.processes.on_spawn = self._controller
        self._disk_path = path_class(self.kernel)
        self._exchange()
        self.write_station()

    def _exchange(self) -> None:
        also = {
            load_module.load_station: self._load,
            control.ControlSocket: partial(Door, self),
            asking.ask: self._ask,
            port_owner.services: lambda ports: (self._holder(ports), []),
            running_service._listens: lambda _: self.door is not None,
            boot.boot_id: lambda: f"boot {self.boots}",
            can_module._open_bus: lambda _: Driver(self.bus, self.time),
            gpio.OutputLine: SimpleNamespace(open=partial(VirtualLine.open, self.kernel)),
            gpio.need_gpiod: lambda: None,
        }
        exchange(self._stack, replacements(self.kernel, self.processes), also)

    def close(self) -> None:
        try:
            self.time.close()
        finally:
            self._stack.close()

    # --- the station file ---------------------------------------------------------------------------------------------

    @property
    def station_file(self) -> Path:
        return Path(_directory().name) / "station.yaml"

    def write_station(self) -> None:
        """The file, with the small policy beside it."""
        text = (shipped_dir() / "policies" / "li-ion-48v.yaml").read_text(encoding="utf-8")
        for usual, small in SMALL.items():
            text = text.replace(usual, small)
        self.station_file.with_name("small.yaml").write_text(text, encoding="utf-8")
        self.station_file.write_text(document(self.entries, self._battery, snapshots=self._snapshots), encoding="utf-8")

    def _load(self, path: Any) -> Station:
        station = _loaded(str(path), Path(path).read_text(encoding="utf-8"))
        directory = self._disk_path(station.journal.directory)
        return replace(station, journal=replace(station.journal, directory=directory))

    # --- lives --------------------------------------------------------------------------------------------------------

    def boot(self) -> Process:
        """`orchestrator run`, as systemd would."""
        words = (*PYTHON, "orchestrator", "run", str(self.station_file))
        self.service = self._start("guardian", words, lambda: guardian.guard([str(self.station_file)]))
        return self.service

    def estop(self, *words: str) -> Process:
        """`orchestrator estop` on the station file, or with the given arguments."""
        options = list(words) or [str(self.station_file)]
        return self._start("estop", (*PYTHON, "orchestrator", "estop", *options), lambda: estop.main(options))

    def _start(self, name: str, words: Sequence[str], main: Callable[[], int]) -> Process:
        process = self.processes.new(name, *words)
        return process.run(lambda: self._ends(process, main()))

    def _controller(self, process: Process, command: Sequence[str]) -> Callable[[], int]:
        self.controller = process
        fd, station = int(command[-2]), command[-1]
        return lambda: self._ends(process, controller.main(fd, station))

    def _ends(self, process: Process, status: int) -> int:
        self.ended.append(Ended(self.time.now_s, process.name, status))
        self.time.call_soon(self.on_end, process)
        return status

    def alive(self, process: Process | None) -> bool:
        return process is not None and process.status is None

    def signal(self, process: Process | None, number: int) -> None:
        if process is not None:
            process.signal(number)

    def cut_power(self, how: str = "") -> str:
        """The gateway loses power; the chargers keep it. Returns what the disk had written by then."""
        for process in list(self.processes.all.values()):
            if not process.dead:
                process.status = process.status if process.status is not None else -9
                self.time.kill(process)
                process.dead = True
                self.kernel.bury(process)
        for tty in self.kernel.ttys.values():
            tty.unplug()
            tty.plug()
        self.kernel.calls.troubles.clear()
        for stream in self.kernel.output.values():
            stream.stopped = False
        for rig in self.rigs:
            if rig.breaker is not None:
                rig.breaker.drive(False)
        self.bus.drivers.clear()
        self.boots += 1
        return self.disk.cut(self._dice, how)

    # --- what is said and asked ---------------------------------------------------------------------------------------

    def _on_said(self, process: Process | None, text: str) -> None:
        pid = process.pid if process is not None else 0
        *lines, self._lines[pid] = (self._lines.get(pid, "") + text).split("\n")
        for line in filter(None, lines):
            self.said.append(Said(self.time.now_s, process.name if process else "", line))

    @property
    def door(self) -> Door | None:
        return next((door for door in reversed(self.doors) if door.is_open), None)

    def ask(self, request: dict[str, Any], on_answer: Callable[[Asked], None] = lambda _: None) -> Asked:
        """A person, or a watch, sends a request; the answer comes later."""
        asked = Asked(request, self.time.now_s)
        door = self.door
        if door is None:
            asked.error = "no service answers"
            on_answer(asked)
            return asked
        self.time.start(lambda: self._answer(door, asked, on_answer), door.process)
        return asked

    def _answer(self, door: Door, asked: Asked, on_answer: Callable[[Asked], None]) -> None:
        try:
            answer = door.handler(asked.request)
            while callable(answer):  # it comes later
                self.time.wait(self.time.now_s + POLL_S)
                later = answer()
                answer = answer if later is None else later
            asked.answer = answer
        except ServiceError as error:
            asked.error = str(error)
        asked.answered_s = self.time.now_s
        on_answer(asked)

    def _ask(self, _path: Any, request: dict[str, Any], timeout_s: float = ANSWER_S) -> dict[str, Any]:
        """What the product's own clients call: `estop`, in a thread of theirs."""
        me = self.time.me()
        asked = self.ask(request, lambda _: self.time.wake(me))
        if asked.answer is None and not asked.error:
            self.time.wait(self.time.now_s + timeout_s)
        if asked.answer is None:
            raise ServiceError(asked.error or "no answer")
        return {"ok": True, **asked.answer}

    def _holder(self, ports: Iterable[str]) -> list[str]:
        """The control sockets of the service that has one of these ports locked."""
        locked = any((tty := self.kernel.ttys.get(port)) is not None and tty.lock is not None for port in ports)
        return [SOCKET] if locked and self.door is not None else []
