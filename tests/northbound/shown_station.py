"""What the page's tests look at: real status documents of an emulated station, behind the real control socket."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

from orchestrator.errors import RequestError
from orchestrator.model import Cause, ControlMode, Request
from orchestrator.service import bay as bay_module
from orchestrator.service.control import ControlSocket
from orchestrator.service.status import station_status
from orchestrator.sim.faults import FAULTS
from orchestrator.sim.presets import PACKS
from tests.proof.virtual_rig import Nature, VirtualRig
from tests.proof.virtual_service import World, station, world

BAYS = 5
#: Virtual seconds: when things go wrong, when somebody looks, and when somebody looks after a stop of the first bay.
WRONG_S, LOOK_S, STOPPED_S = 15.0, 25.0, 30.0
STATES = ("CHARGING", "TRIPPED", "HELD", "UNCONTROLLABLE", "IDLE")
STATION = """\
station: depot-1
can: {can0: {interface: serial, channel: /dev/null, bitrate: 250000}}
bays:
  - name: bay-1
    charger: {port: /dev/null, control: manual, steps_a: [2.0, 5.0, 8.0, 11.0, 14.0]}
    battery: {can: can0, node_id: 0x10, map: tabos}
    limits: {voltage_v: 58.4, current_a: 15.0, temperature_c: [0, 45]}
    policy: li-ion-48v
control: {socket: control.sock}
journal: {directory: journal}
"""

Document = dict[str, Any]


def _look(made: World) -> Document:
    shown = [bay.status(closely=True) for bay in made.bays]
    settings = replace(made._station, station="depot-1")
    found = station_status(settings, max(bay.alarm for bay in made.bays), shown, None)
    return json.loads(json.dumps(found))  # type: ignore[no-any-return]  # JSON


def _inject(rig: VirtualRig, fault: str) -> None:
    rig.inject(lambda this: FAULTS[fault].happen(this, None))


def documents() -> tuple[Document, Document]:
    """The station with its bays in `STATES`, and then with the first one stopped."""
    natures = []
    for number in range(BAYS):
        pack = PACKS["48v"]()
        pack.set_soc(40.0 + number * 7)
        natures.append(Nature(pack, seed=number + 1))
    settings = replace(station([ControlMode.MANUAL] * BAYS), stagger_s=0.0)
    found = list[Document]()
    with world(settings, natures, end_s=STOPPED_S + 30.0) as made:
        began_s, later, rigs = made.time.now_s, made.time.call_later, made.rigs
        later(WRONG_S, setattr, rigs[1].bay.pack, "temperature_c", 57.0)
        later(WRONG_S, made.ask, Request.STOP, 2)
        later(WRONG_S, _inject, rigs[3], "ignore_stop")
        later(WRONG_S + 1.0, made.ask, Request.STOP, 3)
        later(WRONG_S, _inject, rigs[4], "battery_removed")
        later(LOOK_S, lambda: found.append(_look(made)))
        later(LOOK_S + 0.1, made.ask, Request.STOP, 0)
        later(STOPPED_S, lambda: found.append(_look(made)))
        later(STOPPED_S + 0.1, made.end)
        ahead_s = time.time() - LOOK_S - began_s
        with (
            patch.object(bay_module, "monotonic", lambda: made.time.now_s),
            patch.object(bay_module, "time", lambda: made.time.now_s + ahead_s),
        ):
            made.run()
    before, after = found
    return before, after


class Shown:
    """A station that shows a document, and remembers what it was asked to do."""

    def __init__(self, before: Document, after: Document) -> None:
        self.before, self.after = before, after
        self.document = before
        self.asked: list[Mapping[str, object]] = []
        self.address = ""
        self._process: subprocess.Popen[str] | None = None

    def answer(self, request: Mapping[str, object]) -> Mapping[str, object]:
        """As the service would: `watch` is unknown, as to an older one."""
        verb, bay = request.get("verb"), request.get("bay")
        if verb == "status":
            bays = [one for one in self.document["bays"] if bay in (None, one["name"])]
            return {**self.document, "bays": bays}
        names = request.get("bays")
        if not isinstance(names, list):
            raise RequestError(Cause.of("verb_unknown", verb=verb, verbs=("status", *map(str, Request))))
        self.asked.append(request)
        if verb == "stop":
            self.document = self.after
        return {"language": "en", "results": dict.fromkeys(names, ""), "causes": {}}

    def many(self, count: int) -> Document:
        """The same with so many bays."""
        bays = self.before["bays"]
        more = [{**bays[number % BAYS], "name": f"bay-{number + 1}"} for number in range(count)]
        return {**self.before, "bays": more}

    def kill(self) -> None:
        """End the page's server."""
        assert self._process is not None
        self._process.kill()
        self._process.wait()

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """The page's server keeps its connections, and does nothing."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self._process.send_signal(signal.SIGCONT)

    def serve(self, directory: Path) -> None:
        """Start the page's server, where it was before."""
        listen = self.address.removeprefix("http://").rstrip("/") or "127.0.0.1:0"
        file = directory / "northbound.yaml"
        file.write_text(f"station: {directory / 'station.yaml'}\npage: {{listen: '{listen}'}}\n")
        command = [sys.executable, "-m", "orchestrator", "serve", str(file)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().split()[-1]


@contextmanager
def shown(directory: Path) -> Iterator[Shown]:
    """The control socket in this process, and the page's server beside it."""
    (directory / "station.yaml").write_text(STATION)
    made = Shown(*documents())
    socket = ControlSocket(directory / "control.sock", made.answer, time.monotonic)
    socket.start()
    try:
        made.serve(directory)
        yield made
    finally:
        if made._process is not None:
            made.kill()
        socket.close()
