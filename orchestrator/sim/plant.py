"""An emulated station in its own process: N chargers on ptys, N BMUs on CAN, each pair on one battery.

    python -m orchestrator.sim.plant --dir DIR --bays 2 --pack demo

When ready, it prints one JSON line on stdout: {"ready": true, "bays": [{"name", "port", "node_id", "can"}]}. Then it
answers each JSON line on stdin with one line, and ends on {"quit": true} or when stdin closes:

    {"bay": 1, "inject": "over_temperature", "value": 50}   a fault of `faults.py`; value is optional
    {"bay": 1, "set": {"soc_pct": 40, "temperature_c": 20, "soh_pct": 90}}
    {"query": "state"}                                      of all bays, or of one with "bay"

All times are `time.monotonic()` and can be compared with those of other processes on this machine.
"""

import argparse
import asyncio
import json
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from orchestrator.model import ControlMode
from orchestrator.sim.bay import SimulatedBay
from orchestrator.sim.bmu import Layout
from orchestrator.sim.can_noise import BUSES
from orchestrator.sim.can_pty import open_bus
from orchestrator.sim.can_wire import CanWire
from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.faults import FAULTS
from orchestrator.sim.line import LINES
from orchestrator.sim.presets import PACKS
from orchestrator.sim.rig import Rig, Setup

#: hop_limit 0: nothing leaves this machine.
CAN = '{"interface": "udp_multicast", "channel": "239.74.163.2", "port": 43113, "hop_limit": 0}'
LAYOUTS = {"first-high": Layout.FIRST_HIGH, "first-low": Layout.FIRST_LOW}
#: Bays advance at least this often, even without requests.
TICK_S = 0.1
#: CANopen node ids end here.
LAST_NODE_ID = 127


class Plant:
    """The rigs and the buses of one emulated station. Belongs to the loop's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, args: argparse.Namespace) -> None:
        self._loop = loop
        self._args = args
        self._buses = [open_bus(json.loads(text)) for text in args.can or [CAN]]
        self._wires = [CanWire(loop, bus, BUSES[args.bus]) for bus in self._buses]
        self._per_bus = -(-args.bays // len(self._buses))
        self.rigs = [self._build(number) for number in range(args.bays)]
        self._tick()

    def _build(self, number: int) -> Rig:
        args = self._args
        pack = PACKS[args.pack]()
        if args.soc is not None:
            pack.set_soc(args.soc)
        if args.temperature is not None:
            pack.temperature_c = pack.ambient_c = args.temperature
        charger = SimulatedCharger(ControlMode.AUTOMATIC if args.automatic else ControlMode.MANUAL)
        setup = Setup(
            node_id=args.node + number % self._per_bus,
            link=args.dir / f"bay-{number + 1}",
            line=LINES[args.line],
            layout=LAYOUTS[args.layout],
            main_loop=args.bmu == "mainloop",
            speed=args.speed,
            serial=args.serial and args.serial + number,
        )
        return Rig(self._loop, self._wires[number // self._per_bus], SimulatedBay(charger, pack), setup)

    def _tick(self) -> None:
        for rig in self.rigs:
            rig.catch_up()
        self._loop.call_later(TICK_S, self._tick)

    def close(self) -> None:
        """Remove all devices."""
        for rig in self.rigs:
            rig.close()
        for wire, bus in zip(self._wires, self._buses, strict=True):
            wire.close()
            bus.shutdown()

    # --- what is said about it ---

    def ready(self) -> dict[str, Any]:
        """Where everything is."""
        names = (
            {
                "name": f"bay-{number + 1}",
                "port": str(self._args.dir / f"bay-{number + 1}"),
                "node_id": rig.bmu.node_id,
                "can": number // self._per_bus,
            }
            for number, rig in enumerate(self.rigs)
        )
        return {"ready": True, "bays": list(names)}

    def state(self, rig: Rig) -> dict[str, Any]:
        """The true state of one bay, and what arrived on its lines."""
        rig.catch_up()
        pack, charger = rig.bay.pack, rig.bay.charger
        return {
            "soc_pct": round(pack.soc * 100, 3),
            "voltage_v": round(pack.voltage_v, 3),
            "current_a": round(pack.current_a, 3),
            "temperature_c": round(pack.temperature_c, 2),
            "operation": int(charger.operation),
            "charge_mode": int(charger.charge_mode),
            "current_limit": charger.current_step,
            "precharge": int(charger.precharge),
            "resting": charger.resting,
            "run": charger.run,
            "sdo_requests": rig.bmu.port.reads,
            "injected_s": rig.injected_s,
            **asdict(rig.wire.counters),
        }

    # --- commands ---

    def obey(self, command: Mapping[str, Any]) -> dict[str, Any]:
        """One command, one answer; an impossible command is answered with the reason."""
        rigs = self.rigs
        if "bay" in command:
            number = command["bay"]
            if not isinstance(number, int) or not 1 <= number <= len(rigs):
                return {"error": f"bay {number}: there are 1 … {len(rigs)}"}
            rigs = rigs[number - 1 : number]
        if command.get("query") == "state":
            return {"t_s": self._loop.time(), "bays": [self.state(rig) for rig in rigs]}
        if "inject" in command:
            return _inject(rigs, str(command["inject"]), command.get("value"))
        if "set" in command:
            return _set(rigs, command["set"])
        return {"error": f"unknown command {json.dumps(command)}"}


def _inject(rigs: Sequence[Rig], name: str, value: float | None) -> dict[str, Any]:
    if name not in FAULTS:
        return {"error": f"unknown fault {name!r}: there are {', '.join(FAULTS)}"}
    times_s = [rig.inject(lambda rig: FAULTS[name].happen(rig, value)) for rig in rigs]
    return {"injected": name, "t_s": times_s[0]}


def _set(rigs: Sequence[Rig], values: Mapping[str, float]) -> dict[str, Any]:
    unknown = set(values) - {"soc_pct", "soh_pct", "temperature_c"}
    if unknown:
        return {"error": f"cannot set {', '.join(sorted(unknown))}"}
    for rig in rigs:
        rig.catch_up()
        pack = rig.bay.pack
        pack.soh_pct = values.get("soh_pct", pack.soh_pct)
        pack.temperature_c = values.get("temperature_c", pack.temperature_c)
        if "soc_pct" in values:
            pack.set_soc(values["soc_pct"])
    return {"set": dict(values)}


class Console:
    """Reads commands from stdin and writes answers to stdout, one line each."""

    def __init__(self, loop: asyncio.AbstractEventLoop, plant: Plant) -> None:
        self._loop = loop
        self._plant = plant
        self._pending = b""
        os.set_blocking(sys.stdin.fileno(), False)
        loop.add_reader(sys.stdin.fileno(), self._on_readable)

    def say(self, answer: Mapping[str, Any]) -> None:
        """Print one line."""
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()

    def _on_readable(self) -> None:
        chunk = os.read(sys.stdin.fileno(), 65536)
        *lines, self._pending = (self._pending + chunk).split(b"\n")
        for line in filter(None, lines):
            try:
                command = json.loads(line)
            except ValueError as error:
                self.say({"error": f"not JSON: {error}"})
                continue
            if not isinstance(command, dict):
                self.say({"error": "a command is a JSON object"})
            elif command.get("quit"):
                self._loop.stop()
            else:
                self.say(self._plant.obey(command))
        if not chunk:
            self._loop.stop()


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m orchestrator.sim.plant", description="An emulated station.")
    parser.add_argument("--dir", type=Path, required=True, help="where the ports bay-1, bay-2, … are linked")
    parser.add_argument("--bays", type=int, default=1)
    parser.add_argument(
        "--can",
        action="append",
        help=f"python-can's keys as JSON, or interface pty; may be repeated; default {CAN}",
    )
    parser.add_argument("--node", type=lambda text: int(text, 0), default=0x10, help="node id of each bus's first BMU")
    parser.add_argument("--pack", choices=PACKS, default="48v")
    parser.add_argument("--soc", type=float, help="initial state of charge, %%; -100 … 0 is deep discharge")
    parser.add_argument("--temperature", type=float, help="initial temperature of packs and surroundings, °C")
    parser.add_argument("--line", choices=LINES, default="real", help="the quality of the serial lines")
    parser.add_argument("--bus", choices=BUSES, default="perfect", help="the quality of the CAN buses")
    parser.add_argument("--layout", choices=LAYOUTS, default="first-high", help="of the BMUs' words")
    parser.add_argument("--bmu", choices=("immediate", "mainloop"), default="immediate", help="when the BMUs answer")
    parser.add_argument("--automatic", action="store_true", help="the chargers' rotary switches are on 5, not on 1")
    parser.add_argument("--speed", type=float, default=1.0, help="speed of the batteries relative to real time")
    parser.add_argument("--serial", type=int, default=0, help="the first battery's serial number; 0: they have none")
    args = parser.parse_args(argv)
    last = args.node + -(-args.bays // len(args.can or [CAN])) - 1
    if args.bays < 1 or args.node < 1 or last > LAST_NODE_ID:
        parser.error(f"node ids {args.node} … {last}: only 1 … {LAST_NODE_ID} are valid; repeat --can for more buses")
    return args


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until told to quit."""
    args = arguments(argv)
    args.dir.mkdir(parents=True, exist_ok=True)
    loop = asyncio.new_event_loop()
    for signal_number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(signal_number, loop.stop)
    plant = Plant(loop, args)
    console = Console(loop, plant)
    console.say(plant.ready())
    try:
        loop.run_forever()
    finally:
        plant.close()
        loop.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
