"""Serial ports and control socket of a station, even of one whose file has mistakes: what an emergency stop needs."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestrator.config.yamltree import MAX_BYTES, Entries, Items, Node, Scalar, parse

_COMMENT = re.compile(rb"(?:^|(?<=\s))#.*", re.MULTILINE)
_PORT = re.compile(rb"""(?:^|[\s{,])port:\s+["']?(/[^\s"',}#]+)""", re.MULTILINE)
_SOCKET = re.compile(rb"""(?:^|[\s{,])socket:\s+["']?([^\s"',}#]+)""", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Wiring:
    """Every charger's port, in the file's order, with its bay's name; and the socket. "" is what cannot be told."""

    ports: Mapping[str, str]
    socket: str


def wiring(path: Path) -> Wiring:
    """What a station file says about them. A mistake elsewhere must not keep a stop from being sent.

    What looks like `port: /dev/…` counts wherever it stands, in a file that is not even YAML, too. Raises `OSError` if
    the file cannot be read.
    """
    with path.open("rb") as stream:
        data = stream.read(MAX_BYTES)
    node, _ = parse(str(path), data)
    ports = {} if node is None else _ports(node)
    bare = _COMMENT.sub(b"", data)
    for match in _PORT.findall(bare):
        ports.setdefault(match.decode(errors="surrogateescape"), "")
    socket = _text(_get(_get(node, "control"), "socket"))
    if not socket and (found := _SOCKET.search(bare)):
        socket = found[1].decode(errors="surrogateescape")
    return Wiring(
        {_shown(path.parent / port): name for port, name in ports.items()},
        _shown(path.parent / socket) if socket else "",
    )


def _shown(path: Path) -> str:
    """The path, with a backslash for a 0: no file can have that, and asking for it would end a stop with an error."""
    return str(path).replace("\0", "\\0")


def _ports(node: Node) -> dict[str, str]:
    bays = _get(node, "bays")
    ports: dict[str, str] = {}
    for bay in bays.items if isinstance(bays, Items) else ():
        port = _text(_get(_get(bay, "charger"), "port"))
        if "/" in port:
            ports.setdefault(port, _text(_get(bay, "name")))
    return ports


def _text(node: Node | None) -> str:
    # Half a character, which YAML can write as an escape, is in no file's name: it is shown as what was written.
    return node.text.encode(errors="backslashreplace").decode() if isinstance(node, Scalar) else ""


def _get(node: Node | None, key: str) -> Node | None:
    return (
        next((value for name, value in node.entries if name.text == key), None) if isinstance(node, Entries) else None
    )
