"""What the kernel knows of the threads of the service: processor time, waits, wake-ups."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

MAIN = "MainThread"
#: What a thread of the controller does, by the beginning of its name; the last one is everything else.
ROLES: Mapping[str, str] = {
    MAIN: "control loop",
    "charger ": "chargers' threads",
    "can-": "CAN threads",
    "journal": "journal",
    "": "other threads",
}
GUARDIAN = "guardian"


def role(thread: str) -> str:
    """What the thread of this name does."""
    return next(said for beginning, said in ROLES.items() if thread.startswith(beginning))


@dataclass(frozen=True, slots=True)
class Times:
    """Of some threads, since they started or in a second."""

    threads: int = 0
    ran_s: float = 0.0
    waited_s: float = 0.0  #: ready to run, but every core was busy with something else
    user_ticks: float = 0.0  #: the kernel's own sampling, coarser than `ran_s`
    system_ticks: float = 0.0
    wakeups: float = 0.0

    @property
    def system(self) -> float:
        """The share of its time that was the kernel's, in system calls."""
        ticks = self.user_ticks + self.system_ticks
        return self.system_ticks / ticks if ticks else 0.0

    def __add__(self, other: Self) -> "Times":
        return Times(
            self.threads + other.threads, self.ran_s + other.ran_s, self.waited_s + other.waited_s,
            self.user_ticks + other.user_ticks, self.system_ticks + other.system_ticks, self.wakeups + other.wakeups,
        )  # fmt: skip

    def since(self, before: Self, seconds: float) -> "Times":
        """What a second adds."""
        return Times(
            self.threads, (self.ran_s - before.ran_s) / seconds, (self.waited_s - before.waited_s) / seconds,
            (self.user_ticks - before.user_ticks) / seconds, (self.system_ticks - before.system_ticks) / seconds,
            (self.wakeups - before.wakeups) / seconds,
        )  # fmt: skip


def until_now(pids: Sequence[int]) -> dict[tuple[str, int], Times]:
    """By role and thread; `pids` has the guardian first, then the controller."""
    found = {}
    for pid in pids:
        for task in Path(f"/proc/{pid}/task").glob("*"):
            try:
                name = MAIN if task.name == str(pid) else (task / "comm").read_text(encoding="utf-8").rstrip("\n")
                found[GUARDIAN if pid == pids[0] else role(name), int(task.name)] = _times(task)
            except OSError:
                continue  # it has ended
    return found


def _times(task: Path) -> Times:
    ran_ns, waited_ns, _ = map(int, (task / "schedstat").read_text(encoding="ascii").split())
    stat = (task / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    status = (task / "status").read_text(encoding="utf-8")
    wakeups = status.partition("\nvoluntary_ctxt_switches:")[2].split(maxsplit=1)[0]
    return Times(1, ran_ns / 1e9, waited_ns / 1e9, int(stat[11]), int(stat[12]), int(wakeups))


def by_role(
    before: Mapping[tuple[str, int], Times], after: Mapping[tuple[str, int], Times], seconds: float
) -> dict[str, Times]:
    """In a second, all threads of a role together."""
    found: dict[str, Times] = {}
    for (said, number), times in after.items():
        of = times.since(before.get((said, number), Times()), seconds)
        found[said] = found.get(said, Times()) + of
    return found


def rows(found: Mapping[str, Times], bays: int) -> Iterator[str]:
    """A line for each role, and for all together."""
    yield "                    threads       ran  of that, system  waited for a core  wake-ups/s  ran, each bay"
    of_all = sum(found.values(), Times())
    for said, of in {**dict.fromkeys((*ROLES.values(), GUARDIAN), Times()), **found, "all": of_all}.items():
        yield (
            f"{said:20}{of.threads:7}{100 * of.ran_s:8.2f} %{100 * of.system:15.0f} %{100 * of.waited_s:17.2f} %"
            f"{of.wakeups:12.0f}{1e6 * of.ran_s / bays:10.0f} µs/s"
        )
