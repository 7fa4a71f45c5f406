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
    seed(
        "estop leaves the line as it is", "line", "whoever opens a port for a stop does not set it up",
        f"{SERVICE}laststop.py",
        "        termios.tcsetattr(fd, termios.TCSANOW, _SETTINGS)\n",
        "",
    ),
    seed(
        "a running charge is not kept", "disk", "it is not written down that a charger may be running",
        f"{SERVICE}kept.py",
        "return cls(memory.state in RUNNING, ",
        "return cls(False, ",
    ),
    seed(
        "a hold is not kept", "disk", "an operator's stop is forgotten with a restart",
        f"{SERVICE}kept.py",
        "memory.hold, memory.paused, waiting)",
        '"", memory.paused, waiting)',
    ),
    seed(
        "latches are not kept", "disk", "a fault that waits for a person is forgotten with a restart",
        f"{SERVICE}kept.py",
        "memory.hold, memory.paused, waiting)",
        "memory.hold, memory.paused, {})",
    ),
    seed(
        "what is kept is written late", "disk", "what must survive is gathered for 30 s before it is written",
        f"{SERVICE}journal.py",
        "GATHER_S = 0.5",
        "GATHER_S = 30.0",
    ),
    seed(
        "a hung controller is left alone", "stop", "the guardian waits ten times as long for a heartbeat",
        f"{SERVICE}guardian.py",
        "SILENCE_S = 0.5",
        "SILENCE_S = 5.0",
    ),
    seed(
        "the first port only", "stop", "the guardian sends the stop to one port only",
        f"{SERVICE}laststop.py",
        "            for line in doubtful:\n                line.write(frame)",
        "            for line in doubtful[:1]:\n                line.write(frame)",
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
