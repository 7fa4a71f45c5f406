"""Finds the policies, object maps, scenarios and example stations that ship with the program."""

from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent.parent


@cache
def shipped_dir() -> Path:
    """The directory with `policies/` and `configs/`: inside an installed package, else at the checkout's top level."""
    inside = _PACKAGE / "_shipped"
    return inside if inside.is_dir() else _PACKAGE.parent


def shipped_names(folder: str) -> tuple[str, ...]:
    """The names of the shipped files in `folder` ("policies", "configs/maps", …), sorted."""
    return tuple(sorted(path.stem for path in (shipped_dir() / folder).glob("*.yaml")))
