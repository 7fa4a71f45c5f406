"""The unchanged controller with one part of it broken on SIGUSR1: `python -m tests.guardian.saboteur MODE FD STATION`.

The hooks installed beforehand only check whether it is time; the rest is the product.
"""

import os
import re
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

from orchestrator.devices.bus import BatteryBus
from orchestrator.devices.charger import ChargerPort
from orchestrator.service import bay, control, controller
from orchestrator.service.control import ControlSocket
from orchestrator.service.journal import Journal
from orchestrator.service.supervisor import Supervisor

ARMED = threading.Event()


def hang(*_: object) -> None:
    threading.Event().wait()


def end_thread(*_: object, **__: object) -> None:
    """Silently: `except Exception` does not catch it."""
    raise SystemExit


def loop(*_: object) -> None:
    while True:
        pass


def keep_the_gil(*_: object) -> None:
    """In C: no other thread of this process runs for ages."""
    re.match(r"(a|a)+$", "a" * 40 + "b")


def leave(*_: object) -> None:
    os._exit(0)


def fail(*_: object) -> None:
    raise RuntimeError("sabotage")


def die(*_: object) -> None:
    os.abort()


def keep_the_lock(port: ChargerPort, *_: object) -> None:
    """The lock between the port's thread and the control loop: both wait for ever."""
    port._lock.acquire()
    hang()


#: Mode → the function replaced, and its replacement.
MODES: dict[str, tuple[Any, str, Callable[..., None]]] = {
    "port_hangs": (ChargerPort, "_once", hang),
    "port_dies": (ChargerPort, "_once", end_thread),
    "port_deadlock": (ChargerPort, "_once", keep_the_lock),
    "bus_hangs": (BatteryBus, "_turn", hang),
    "bus_dies": (BatteryBus, "_turn", end_thread),
    "control_hangs": (ControlSocket, "_turn", hang),
    "control_dies": (ControlSocket, "_turn", end_thread),
    "journal_dies": (Journal, "_write", end_thread),
    "loop_hangs": (Supervisor, "_news", hang),
    "loop_fails": (Supervisor, "_news", fail),
    "decision_loops": (bay, "decide", loop),
    "decision_keeps_the_gil": (bay, "decide", keep_the_gil),
    "decision_leaves": (bay, "decide", leave),
    "decision_aborts": (bay, "decide", die),
}


def spoil(owner: Any, name: str, instead: Callable[..., None]) -> None:
    good = getattr(owner, name)

    def spoilt(*arguments: Any, **named: Any) -> Any:
        if ARMED.is_set():
            instead(*arguments)
        return good(*arguments, **named)

    setattr(owner, name, spoilt)


if __name__ == "__main__":
    mode, fd, station = sys.argv[1:]
    spoil(*MODES[mode])
    control.STALL_S = 0.5  # the default for a client is 30 s
    signal.signal(signal.SIGUSR1, lambda *_: ARMED.set())
    sys.exit(controller.main(int(fd), station))
