"""A whole station for tests: its file, the emulated plant and the service, in processes that never outlive the test."""

import ctypes
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event
from typing import Any, Self, cast

from orchestrator.lastresort.asking import ask
from orchestrator.service.journal_files import files_of, records_of
from orchestrator.sim.client import PlantProcess
from tests.sim.wires import udp_keys
from tests.waiting import wait_until

Document = dict[str, Any]

#: How Python is told to run a service.
RUN = ("-m", "orchestrator", "run")
POLICY = Path(__file__).with_name("policy.yaml")
#: Python starts, imports everything and opens the socket within this, even on a busy machine.
START_S = 20.0
#: At its end the service gives every charger 3 s, then closes its ports.
END_S = 10.0
#: Polling interval of waits: constant status requests for many bays slow a service down.
LOOK_S = 0.05


def unnamed(text: str) -> str:
    """What people read, without the name of whoever runs these tests."""
    return re.sub(r" by [^;,]+? at \d\d:\d\d", " by the operator", text)


#: Looked up here: between fork and exec, other threads may hold any lock for ever.
PRCTL = ctypes.CDLL(None).prctl


def die_with_parent() -> None:
    """In a child before exec: have the kernel kill it when the tests end, however they end."""
    PRCTL(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def station_document(directory: Path, cans: Sequence[Mapping[str, object]], bays: int) -> Document:
    """The document of a station with bays `bay-1`, `bay-2`, … on the ports of a plant in `directory`."""
    per_bus = -(-bays // len(cans))
    return {
        "station": "whole",
        "stagger_s": 0,  # all charges begin at once
        "can": {f"can{number}": dict(keys) for number, keys in enumerate(cans)},
        "bays": [
            {
                "name": f"bay-{number + 1}",
                "charger": {
                    "port": str(directory / f"bay-{number + 1}"),
                    "control": "manual",
                    "steps_a": [2.0, 5.0, 8.0, 11.0, 14.0],
                },
                "battery": {"can": f"can{number // per_bus}", "node_id": 0x10 + number % per_bus, "map": "tabos"},
                "limits": {"voltage_v": 58.4, "current_a": 15.0, "temperature_c": [0, 45]},
                "policy": str(POLICY),
            }
            for number in range(bays)
        ],
        "control": {"socket": "run/orchestrator.sock"},
        "journal": {"directory": "run/journal"},
    }


class Service:
    """`python -m orchestrator run` on a station file; its output is in `directory`/service.log."""

    def __init__(self, directory: Path, document: Document, run: Sequence[str] = RUN) -> None:
        self.directory = directory
        self._run = run
        self.file = directory / "station.yaml"
        self.file.write_text(json.dumps(document, indent=1), encoding="utf-8")  # JSON is YAML, too
        self.socket = directory / "run" / "orchestrator.sock"
        self._log = directory / "service.log"
        self._process: subprocess.Popen[bytes] | None = None
        self._pause = Event()

    # --- the process ---

    def start(self, stderr: int | None = None, env: Mapping[str, str] | None = None) -> Self:
        """Start it and wait for an answer; its output goes into its log, or to `stderr`."""
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, *self._run, str(self.file)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log if stderr is None else stderr,
                env={**os.environ, **(env or {})},
                start_new_session=True,
                preexec_fn=die_with_parent,
            )
        wait_until(self._answers, START_S, "the service's first answer")
        return self

    def _answers(self) -> bool:
        assert self._process is not None
        assert self._process.poll() is None, f"the service ended: {self.log()}"
        try:
            return bool(self.status())
        except Exception:  # noqa: BLE001 - not yet
            return False

    def edit(self, change: Callable[[Document], None]) -> None:
        """Change the station file, like a person with an editor."""
        document: Document = json.loads(self.file.read_text(encoding="utf-8"))
        change(document)
        self.file.write_text(json.dumps(document, indent=1), encoding="utf-8")

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the started process: the guardian."""
        assert self._process is not None
        self._process.send_signal(number)

    @property
    def has_ended(self) -> bool:
        """Whether the process that was started is gone."""
        return self._process is not None and self._process.poll() is not None

    @property
    def guardian(self) -> int:
        """The started process."""
        assert self._process is not None
        return self._process.pid

    @property
    def controller(self) -> int:
        """Its child."""
        return int(Path(f"/proc/{self.guardian}/task/{self.guardian}/children").read_text())

    def kill_controller(self) -> None:
        os.kill(self.controller, signal.SIGKILL)

    def kill_all(self) -> None:
        """Kill guardian and controller together, like a power failure."""
        assert self._process is not None
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def ended(self) -> int:
        """Wait for its end; returns the exit status."""
        assert self._process is not None
        return self._process.wait(END_S)

    def close(self) -> None:
        if self._process is not None:
            self.kill_all()

    # --- asking it ---

    def ask(self, verb: str, *bays: str) -> dict[str, str]:
        """Each bay's answer to a request; "" is yes."""
        return cast("dict[str, str]", ask(self.socket, {"verb": verb, "bays": list(bays) or None})["results"])

    def status(self, only: str | None = None) -> dict[str, Document]:
        """The status of every bay, or of one, by name."""
        bays = cast("list[Document]", ask(self.socket, {"verb": "status", "bay": only})["bays"])
        return {bay["name"]: bay for bay in bays}

    def strays(self) -> list[Document]:
        """The chargers in hand no longer in the station file."""
        return cast("list[Document]", ask(self.socket, {"verb": "status", "bay": None})["strays"])

    def bay(self, name: str = "bay-1") -> Document:
        return self.status(name)[name]

    def wait(
        self, states: str | Collection[str], bays: Collection[str] = ("bay-1",), timeout_s: float = 20.0
    ) -> dict[str, Document]:
        """Wait until each of these bays is in one of these states, not necessarily at one moment."""
        wanted = {states} if isinstance(states, str) else set(states)
        arrived: dict[str, Document] = {}
        newest: dict[str, Document] = {}

        def look() -> bool:
            self._pause.wait(LOOK_S)
            newest.update(self.status(next(iter(bays)) if len(bays) == 1 else None))
            arrived.update({name: newest[name] for name in bays if newest[name]["state"] in wanted})
            return len(arrived) == len(set(bays))

        try:
            wait_until(look, timeout_s)
        except AssertionError:
            late = {name: (newest[name]["state"], newest[name]["reason"]) for name in bays if name not in arrived}
            raise AssertionError(f"not in {sorted(wanted)} within {timeout_s:g} s: {late}") from None
        return arrived

    def cli(self, *args: str) -> subprocess.CompletedProcess[str]:
        """Run one verb on the real command line, with this service's socket in the environment."""
        return orchestrator(*args, env={"ORCHESTRATOR_SOCKET": str(self.socket)})

    # --- what it wrote ---

    def log(self) -> str:
        return self._log.read_text(encoding="utf-8")

    def journal(self, bay: str, kind: str) -> list[Document]:
        """The bay's journal lines of one kind, oldest first."""
        files = (self.directory / "run" / "journal").glob("*.jsonl*")
        records = [record for _, _, record in records_of(files_of(files), lambda _: True) if isinstance(record, dict)]
        return [record for record in records if record["bay"] == bay and record["kind"] == kind]

    def path_of(self, bay: str) -> list[str]:
        """The bay's states according to the journal."""
        return [record["to"] for record in self.journal(bay, "transition")]


def orchestrator(
    *args: str,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    program: Sequence[str] = ("-m", "orchestrator"),
) -> subprocess.CompletedProcess[str]:
    """Run one verb of the command line."""
    return subprocess.run(
        [sys.executable, *program, *args],
        env={**os.environ, **(env or {})},
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        preexec_fn=die_with_parent,
    )


@contextmanager
def whole_station(
    directory: Path,
    bays: int = 1,
    *plant_args: str,
    change: Callable[[Document], None] = lambda _: None,
    buses: int = 1,
    run: Sequence[str] = RUN,
) -> Iterator[tuple[PlantProcess, Service]]:
    """A running plant and a service not started yet, on separate buses and ports.

    `change` may alter the station's document before it is written.
    """
    cans = [{**udp_keys(), "channel": f"239.74.163.{2 + number}"} for number in range(buses)]
    document = station_document(directory, cans, bays)
    change(document)
    service = Service(directory, document, run)
    can_args = [arg for keys in cans for arg in ("--can", json.dumps(keys))]
    with PlantProcess(directory, "--bays", str(bays), *can_args, *plant_args) as plant:
        try:
            yield plant, service
        finally:
            service.close()
