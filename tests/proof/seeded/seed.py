"""A seed: a small change of the package that reopens a hole."""

from dataclasses import dataclass

Change = tuple[str, str, str]  #: file, text that occurs in it exactly once, replacement


@dataclass(frozen=True, slots=True)
class Seed:
    """One bug. `kind`: the kind of hole; `likely`: the proof tried first; `where`: the part of it tried first.

    `where` has scene names for the environment, and files or tests for proofs run by pytest.
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
    """A seed likely to be found by a scene of the environment."""
    return Seed(name, kind, about, changes, "environment", where)


def hostile(name: str, kind: str, about: str, where: tuple[str, ...], *changes: Change) -> Seed:
    """A seed that shows only in real processes."""
    return Seed(name, kind, about, changes, "hostile", where)


def part(name: str, kind: str, about: str, where: tuple[str, ...], *changes: Change) -> Seed:
    """A seed covered by a second guard: the station stays safe, and only the part's own tests find it."""
    return Seed(name, kind, about, changes, "parts", where)
