"""The serial ports of a station, even of one whose file has mistakes: what an emergency stop needs, and no more."""

import re
from pathlib import Path

from orchestrator.config.yamltree import MAX_BYTES, Entries, Items, Node, Scalar, parse

_PORT = re.compile(rb"""(?:^|[\s{,])port:\s+["']?(/[^\s"',}#]+)""", re.MULTILINE)


def charger_ports(path: Path) -> tuple[str, ...]:
    """Every charger's port, in the file's order. A mistake elsewhere must not keep a stop from being sent.

    A file that is not even YAML is searched for what looks like `port: /dev/…`. Raises `OSError` if it cannot be read.
    """
    with path.open("rb") as stream:
        data = stream.read(MAX_BYTES)
    node, _ = parse(str(path), data)
    if node is not None and (ports := _ports(node)):
        return tuple(str(path.parent / port) for port in dict.fromkeys(ports))
    return tuple(dict.fromkeys(match.decode(errors="surrogateescape") for match in _PORT.findall(data)))


def _ports(node: Node) -> list[str]:
    bays = _get(node, "bays")
    chargers = [_get(bay, "charger") for bay in bays.items] if isinstance(bays, Items) else []
    ports = [_get(charger, "port") for charger in chargers]
    return [port.text for port in ports if isinstance(port, Scalar) and "/" in port.text]


def _get(node: Node | None, key: str) -> Node | None:
    return (
        next((value for name, value in node.entries if name.text == key), None) if isinstance(node, Entries) else None
    )
