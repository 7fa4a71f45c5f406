"""The cost of persisting: the time from a change until it is on the disk, and the control loop's time.

python -m benchmarks.persisted [DIRECTORY]     default: the current one; its disk is measured
"""

import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from threading import Event

from orchestrator.core.memory import FaultMemory, Memory
from orchestrator.core.persisted import Persisted
from orchestrator.model import Session, State
from orchestrator.service.past import Place
from orchestrator.service.store import Store

BAYS = 128
CHANGES = 200
STEPS = 20_000


def to_the_disk(directory: Path) -> list[float]:
    """Seconds from each change to its confirmation, with that many bays in the file."""
    places = [Place(f"bay-{number}", f"/dev/ttyS{number}", "can0", number) for number in range(BAYS)]
    told = Event()
    store = Store(directory, places, time.monotonic, time.time, on_persisted=lambda _: told.set())
    store.start()
    store.wait(5.0)
    taken: list[float] = []
    for number in range(CHANGES + 1):
        told.wait()
        told.clear()
        began_s = time.perf_counter()
        store.put(places[number % BAYS], Persisted(running=number // BAYS % 2 == 0))
        told.wait()
        taken.append(time.perf_counter() - began_s)
        told.set()
    store.close(5.0)
    return taken[1:]


def of_a_step(directory: Path) -> float:
    """Seconds of the control loop's time it takes per decision during a charge."""
    place = Place("bay-1", "/dev/ttyS1", "can0", 1)
    store = Store(directory, [place], time.monotonic, time.time)
    store.past(place)
    memory = Memory(state=State.CHARGING, session=Session(0.0), faults={"late": FaultMemory(strikes=(1.0, 2.0))})
    began_s = time.perf_counter()
    for number in range(STEPS):
        store.not_persisted(float(number))
        store.on_disk(place)
        store.put(place, Persisted.of(memory, float(number)))
    return (time.perf_counter() - began_s) / STEPS


def main(arguments: list[str]) -> int:
    """Measure and report."""
    with tempfile.TemporaryDirectory(dir=arguments[0] if arguments else ".") as scratch:
        taken = sorted(to_the_disk(Path(scratch)))
        each_s = of_a_step(Path(scratch) / "other")
    print(f"on the disk, {BAYS} bays: median {median(taken) * 1e3:.1f} ms, p99 {taken[-3] * 1e3:.1f} ms")
    print(f"of each step: {each_s * 1e6:.1f} µs")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
