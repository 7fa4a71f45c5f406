"""What a seed is: a small change of the package that opens a hole again."""

from dataclasses import dataclass

Change = tuple[str, str, str]  #: file, what stands there exactly once, what takes its place


@dataclass(frozen=True, slots=True)
class Seed:
    """One bug. `kind`: the kind of hole; `likely`: the proof that is asked first; `where`: what of it comes first.

    `where` holds names of scenes for the environment, and files or tests for the proofs that pytest runs.
    """

    name: str
    kind: str
    about: str
    changes: tuple[Change, ...]
    likely: str = "environment"
    where: tuple[str, ...] = ()


SERVICE, LASTRESORT, DEVICES, CORE, LINK = (
    "orchestrator/service/",
    "orchestrator/lastresort/",
    "orchestrator/devices/",
    "orchestrator/core/",
    "orchestrator/link/",
)
WORKBENCH = "orchestrator/workbench/"


def scene(name: str, kind: str, about: str, where: tuple[str, ...], *changes: Change) -> Seed:
    """One that a scene of the environment is likely to find."""
    return Seed(name, kind, about, changes, "environment", where)


def hostile(name: str, kind: str, about: str, where: tuple[str, ...], *changes: Change) -> Seed:
    """One that shows in real processes only."""
    return Seed(name, kind, about, changes, "hostile", where)


def part(name: str, kind: str, about: str, where: tuple[str, ...], *changes: Change) -> Seed:
    """One behind which a second guard stands: the station is safe with it, and only the part's own tests tell."""
    return Seed(name, kind, about, changes, "parts", where)
