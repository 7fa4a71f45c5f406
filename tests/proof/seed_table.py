"""The seeds: holes that were closed, each as a small change of the package that opens it again."""

from dataclasses import dataclass

Change = tuple[str, str, str]  #: file, what stands there exactly once, what takes its place


@dataclass(frozen=True, slots=True)
class Seed:
    """One bug. `kind`: of which kind of hole; `likely`: the proof that is asked first."""

    name: str
    kind: str
    about: str
    changes: tuple[Change, ...]
    likely: str = "environment"


SERVICE, DEVICES, CORE = "orchestrator/service/", "orchestrator/devices/", "orchestrator/core/"


def seed(name: str, kind: str, about: str, file: str, old: str, new: str, likely: str = "environment") -> Seed:
    """One with a single change."""
    return Seed(name, kind, about, ((file, old, new),), likely)


SEEDS: tuple[Seed, ...] = (
    # 1. The line is not ours alone.
    seed(
        "estop leaves the line as it is", "line", "whoever stops last does not look at the line's settings",
        f"{SERVICE}lastline.py",
        "return self._fd is not None and bool(settings.restore(self._fd))",
        "return False",
    ),
    seed(
        "nobody else's lock is passed", "line", "a port that a stranger has locked is left alone at the end",
        f"{SERVICE}lastline.py",
        "        if holder(name, (os.getpid(),)).ours:",
        "        if True:",
    ),
    # 2. What must survive is not on disk.
    seed(
        "a running charge is not kept", "disk", "it is not written down that a charger may be running",
        f"{CORE}persisted.py",
        "running=memory.state in RUNNING or memory.intends or memory.unverified,",
        "running=False,",
    ),
    seed(
        "who ran is not held", "disk", "a charge that a crash has ended goes on by itself after the restart",
        f"{CORE}persisted.py",
        "        if self.running:\n",
        "        if False:\n",
    ),
    seed(
        "a hold is not kept", "disk", "an operator's stop is forgotten with a restart",
        f"{CORE}persisted.py",
        "            hold=memory.hold,\n            paused=memory.paused,\n            faults=faults,",
        '            hold="",\n            paused=memory.paused,\n            faults=faults,',
    ),
    seed(
        "latches are not kept", "disk", "a fault that waits for a person is forgotten with a restart",
        f"{CORE}persisted.py",
        "            if fault.raised_s is not None or fault.strikes\n",
        "            if False\n",
    ),
    seed(
        "the directory is not synchronised", "disk", "after the rename the directory is not brought to the disk",
        f"{SERVICE}disk.py",
        "    os.replace(fresh, path)\n    sync_directory(path.parent)",
        "    os.replace(fresh, path)",
    ),
    seed(
        "the file is not synchronised", "disk", "a file is renamed before its bytes are on the disk",
        f"{SERVICE}disk.py",
        "            data = data[os.write(fd, data) :]\n        os.fsync(fd)",
        "            data = data[os.write(fd, data) :]",
    ),
    # Stops.
    seed(
        "a hung controller is left alone", "stop", "the guardian waits ten times as long for a heartbeat",
        f"{SERVICE}guardian.py",
        "SILENCE_S = 0.5",
        "SILENCE_S = 5.0",
    ),
    seed(
        "an opened port goes on", "stop", "a port that was opened does not begin with a stop",
        f"{DEVICES}schedule.py",
        "        self.order: Command | None = STOP  #: the standing order\n        self._urgent = True",
        "        self.order: Command | None = None  #: the standing order\n        self._urgent = False",
    ),
    seed(
        "the service ends at once", "stop", "SIGTERM ends the service without a stop",
        f"{SERVICE}supervisor.py",
        "            bay.end(self._ending, orderly=not self._lost)\n",
        "            return 0\n",
    ),
    seed(
        "hot is not seen", "limits", "no current flows above 45 °C, the limit of pack and policy: now 50 °C",
        f"{CORE}checks/battery.py",
        "    high = f.rules.temperature_c.high\n    again",
        "    high = 50.0\n    again",
    ),
)  # fmt: skip
