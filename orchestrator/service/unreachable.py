"""Why a verb does not reach the service: where it was looked for, who may ask it, and what to type."""

import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from orchestrator.model import Cause
from orchestrator.service.where import INSTALLED, origin

#: The folders in which sudo looks for programs.
USUAL = frozenset({"/bin", "/usr/bin", "/usr/local/bin"})
#: The verbs for which there is a way without a service.
STOPS = ("stop", "pause")


def unreachable(told: object, named: str | None, words: Sequence[str]) -> Cause | None:
    """The cause for people of what `ask` raised; None if it is something else. `words` is the command line."""
    if not isinstance(told, Mapping) or not isinstance(params := told.get("params"), Mapping):
        return None
    socket = str(params.get("socket"))
    if told.get("id") == "socket_forbidden":
        return Cause.of(
            "socket_forbidden", socket=socket, owners=tuple(map(str, params["owners"])), command=_as_root(words, socket)
        )
    if told.get("id") != "service_silent":
        return None
    others = str(INSTALLED) if socket != str(INSTALLED) and _exists(INSTALLED) else ""
    return Cause.of(
        "service_silent",
        socket=socket,
        reason=params.get("reason"),
        origin=origin(named),
        other=Cause.of("installed_answers", socket=others) if others else None,
        without=Cause("estop_without") if words[:1] and words[0] in STOPS else None,
    )


def _as_root(words: Sequence[str], socket: str) -> str:
    """The same command line for sudo, which may find neither our program nor our environment."""
    there = "--socket" in words or any(word.startswith("--socket=") for word in words)
    return shlex.join(["sudo", *_program(), *words, *(() if there else ("--socket", socket))])


def _program() -> list[str]:
    path = os.path.abspath(sys.argv[0])  # noqa: PTH100 - a link stays what it is
    if Path(path).name != "orchestrator":
        return [sys.executable, "-m", "orchestrator"]
    return ["orchestrator" if str(Path(path).parent) in USUAL else path]


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:
        return False
