"""The demo's environment: a directory, an emulated station in one process and the service in another."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Self, cast

from orchestrator.config.shipped import shipped_dir
from orchestrator.errors import OrchestratorError, ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.sim.client import PlantProcess

STATION = """\
station: demo
can:
  can0: {{interface: serial, channel: {directory}/can0, bitrate: 250000, timeout: 0.01}}  # a pty: no network
bays:
  - name: bay-1
    charger: {{port: {directory}/bay-1, control: manual, steps_a: [2.0, 5.0, 8.0, 11.0, 14.0]}}
    battery: {{can: can0, node_id: 0x10, map: tabos}}
    limits: {{voltage_v: 58.4, current_a: 15.0, temperature_c: [0, 45]}}
    policy: policy.yaml
control: {{socket: run/orchestrator.sock}}
journal: {{directory: run/journal}}
"""
#: Any free port of this machine.
PAGE = "station: station.yaml\npage: {listen: 127.0.0.1:0}\n"
#: The service verifies every charger within this after it is told to end.
END_S = 8.0


class Stage:
    """`with Stage() as stage`: both processes run; afterwards both have ended.

    `plant` are further arguments for the emulated station, `orchestrator.sim.plant`.
    """

    def __init__(self, *plant: str) -> None:
        self.directory = Path(tempfile.mkdtemp(prefix="orchestrator-demo-"))
        self.station = self.directory / "station.yaml"
        self.station.write_text(STATION.format(directory=self.directory), encoding="utf-8")
        policy = (shipped_dir() / "configs" / "demo" / "policy.yaml").read_text(encoding="utf-8")
        (self.directory / "policy.yaml").write_text(policy, encoding="utf-8")
        self.log = self.directory / "service.log"
        can = json.dumps({"interface": "pty", "channel": str(self.directory / "can0")})
        self.plant = PlantProcess(self.directory, "--pack", "demo", "--soc", "-100", "--can", can, *plant)
        self.service = self._start()
        self.page: subprocess.Popen[str] | None = None

    def serve(self) -> str:
        """Start the page's server; returns the line that says where. OrchestratorError if it does not start."""
        (self.directory / "northbound.yaml").write_text(PAGE, encoding="utf-8")
        command = [sys.executable, "-P", "-m", "orchestrator", "serve", "northbound.yaml"]
        self.page = subprocess.Popen(  # noqa: S603 - our own program, by our own interpreter
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=self.directory
        )
        told, why = self.page.stdout, self.page.stderr
        assert told is not None and why is not None
        if line := told.readline().strip():
            return line
        raise OrchestratorError(why.read().strip())

    def _start(self) -> "subprocess.Popen[bytes]":
        with self.log.open("ab") as log:
            return subprocess.Popen(  # noqa: S603 - our own program, by our own interpreter
                [sys.executable, "-P", "-m", "orchestrator", "run", self.station.name], stderr=log, cwd=self.directory
            )

    def restart(self) -> None:
        """Start the service again after it has ended, as systemd would."""
        self.service.wait()
        self.service = self._start()

    def bay(self) -> dict[str, object] | None:
        """The bay's status; None until the service is up. OrchestratorError if it has ended."""
        if self.service.poll() is not None:
            raise OrchestratorError(f"the service ended with status {self.service.returncode}:\n{self.log.read_text()}")
        try:
            document = ask(self.directory / "run" / "orchestrator.sock", {"verb": "status"})
        except ServiceError:
            return None
        return cast("list[dict[str, object]]", document["bays"])[0]

    def stop(self) -> None:
        """Do what `orchestrator stop --all` does."""
        ask(self.directory / "run" / "orchestrator.sock", {"verb": "stop", "bays": None})

    def end(self) -> int:
        """End the service as an operator would; returns its exit status."""
        if self.service.poll() is None:
            self.service.terminate()
        try:
            return self.service.wait(END_S)
        except subprocess.TimeoutExpired:
            self.service.kill()
            return self.service.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.page is not None:
            self.page.kill()
            self.page.communicate()
        self.end()
        self.plant.close()
