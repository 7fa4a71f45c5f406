"""Starts an emulated station in another process and talks to it: for the demo, tests and benchmarks."""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

#: Enough for Python to start, import and open 64 ports, even on a slow and busy machine.
READY_S = 20.0
#: If an answer takes longer, the process is stuck.
ANSWER_S = 10.0
#: The process ends within this after its stdin is closed.
END_S = 5.0


class PlantProcess:
    """`with PlantProcess(directory, "--bays", "2") as plant:`; takes the arguments of `orchestrator.sim.plant`.

    `bays` lists each bay's name, port, node_id and the index of its bus.
    """

    def __init__(self, directory: Path, *args: str) -> None:
        self._process = subprocess.Popen(  # noqa: S603 - our own module, by our own interpreter
            [sys.executable, "-P", "-m", "orchestrator.sim.plant", "--dir", str(directory), *args],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._heard = b""
        try:
            self.bays: Sequence[Mapping[str, Any]] = self._hear(READY_S)["bays"]
        except BaseException:
            self._process.kill()
            self._process.wait()
            raise

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def ask(self, command: Mapping[str, Any]) -> dict[str, Any]:
        """One command, one answer.

        RuntimeError with the plant's reason if it cannot comply, TimeoutError if it does not answer.
        """
        if self._process.stdin is None:
            raise RuntimeError("the emulated station has no stdin")
        self._process.stdin.write(json.dumps(command).encode() + b"\n")
        self._process.stdin.flush()
        answer = self._hear(ANSWER_S)
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer

    def inject(self, fault: str, bay: int = 1, value: float | None = None) -> float:
        """Inject a fault into a bay (the first is 1); returns the time, `time.monotonic()`."""
        return float(self.ask({"bay": bay, "inject": fault, "value": value})["t_s"])

    def state(self, bay: int = 1) -> dict[str, Any]:
        """The truth of one bay and its counters."""
        answer: dict[str, Any] = self.ask({"query": "state", "bay": bay})["bays"][0]
        return answer

    def set(self, bay: int = 1, **values: float) -> None:
        """Set a pack's `soc_pct`, `soh_pct` or `temperature_c`."""
        self.ask({"bay": bay, "set": values})

    def close(self) -> None:
        """End it; its ports and BMUs vanish."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _hear(self, within_s: float) -> dict[str, Any]:
        if self._process.stdout is None:
            raise RuntimeError("the emulated station has no stdout")
        fd, deadline_s = self._process.stdout.fileno(), time.monotonic() + within_s
        while b"\n" not in self._heard:
            ready, _, _ = select.select([fd], [], [], max(deadline_s - time.monotonic(), 0.0))
            if not ready:
                raise TimeoutError(f"the emulated station has said nothing for {within_s:g} s")
            chunk = os.read(fd, 65536)
            if not chunk:
                raise RuntimeError(f"the emulated station ended with status {self._process.wait(END_S)}")
            self._heard += chunk
        line, self._heard = self._heard.split(b"\n", 1)
        answer: dict[str, Any] = json.loads(line)
        return answer
