"""A station's ports, contactors, socket and journal, even from a file with mistakes: for an emergency stop."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestrator.config.plainfile import read_plain
from orchestrator.config.yaml.tree import MAX_BYTES, Entries, Items, Node, Scalar, parse

_COMMENT = re.compile(rb"(?:^|(?<=\s))#.*", re.MULTILINE)
_PORT = re.compile(rb"""(?:^|[\s{,])port:\s+["']?(/[^\s"',}#]+)""", re.MULTILINE)
_SOCKET = re.compile(rb"""(?:^|[\s{,])socket:\s+["']?([^\s"',}#]+)""", re.MULTILINE)
_DIRECTORY = re.compile(rb"""(?:^|[\s{,])directory:\s+["']?([^\s"',}#]+)""", re.MULTILINE)


#: Top-level keys of every station file: a truncated file may still be valid YAML, but lacks the last of them.
_WHOLE = ("bays", "control", "journal")
_LINE = re.compile(r"0x[0-9a-fA-F]{1,3}|[0-9]{1,4}")
#: As `config/yaml/scalars.py` reads it.
_BOOLS = {"false": False, "true": True}


@dataclass(frozen=True, slots=True)
class Wiring:
    """Every charger's port, in the file's order, with its bay's name; socket and journal. "" means unknown.

    Contactors are (chip, line, active low), and only unambiguous ones: a guess might close one.
    """

    ports: Mapping[str, str]
    socket: str
    contactors: tuple[tuple[str, int, bool], ...] = ()
    journal: str = ""  #: the journal's directory
    view_socket: str = ""
    damaged: bool = False  #: part of the file, and ports with it, may be missing


def wiring(path: Path) -> Wiring:
    """The wiring in a station file. A mistake elsewhere in the file must not prevent a stop.

    Anything that looks like `port: /dev/…` counts, wherever it is, even if the file is not YAML. Raises `OSError` if
    the file cannot be read.
    """
    data = read_plain(path, MAX_BYTES, "a station file")
    node, wrong = parse(str(path), data)
    ports = {} if node is None else _ports(node)
    bare = _COMMENT.sub(b"", data)
    for match in _PORT.findall(bare):
        ports.setdefault(match.decode(errors="surrogateescape"), "")
    socket = _text(_get(_get(node, "control"), "socket")) or _found(_SOCKET, bare)
    view = _text(_get(_get(node, "control"), "view_socket"))
    journal = _text(_get(_get(node, "journal"), "directory")) or _found(_DIRECTORY, bare)
    return Wiring(
        {_shown(path.parent / port): name for port, name in ports.items()},
        _shown(path.parent / socket) if socket else "",
        tuple((_shown(path.parent / chip), line, active_low) for chip, line, active_low in _contactors(node)),
        _shown(path.parent / journal) if journal else "",
        _shown(path.parent / view) if view else "",
        damaged=bool(wrong) or any(_get(node, key) is None for key in _WHOLE),
    )


def _found(pattern: re.Pattern[bytes], data: bytes) -> str:
    found = pattern.search(data)
    return found[1].decode(errors="surrogateescape") if found else ""


def _shown(path: Path) -> str:
    """The path, with NUL escaped: no file name can contain it, and opening it would abort a stop with an error."""
    return str(path).replace("\0", "\\0")


def _bays(node: Node | None) -> tuple[Node, ...]:
    bays = _get(node, "bays")
    return tuple(bays.items) if isinstance(bays, Items) else ()


def _contactors(node: Node | None) -> Iterator[tuple[str, int, bool]]:
    for contactor in (_get(bay, "contactor") for bay in _bays(node)):
        entries = contactor.entries if isinstance(contactor, Entries) else ()
        given = {name.text: _text(value) for name, value in entries}
        chip, line, active_low = given.pop("chip", ""), given.pop("line", ""), given.pop("active_low", "false")
        if "/" in chip and _LINE.fullmatch(line) and active_low in _BOOLS and not given:
            yield chip, int(line, 16 if "x" in line else 10), _BOOLS[active_low]


def _ports(node: Node) -> dict[str, str]:
    ports: dict[str, str] = {}
    for bay in _bays(node):
        port = _text(_get(_get(bay, "charger"), "port"))
        if "/" in port:
            ports.setdefault(port, _text(_get(bay, "name")))
    return ports


def _text(node: Node | None) -> str:
    # YAML can escape a lone surrogate, which no file name contains: show it as it was written.
    return node.text.encode(errors="backslashreplace").decode() if isinstance(node, Scalar) else ""


def _get(node: Node | None, key: str) -> Node | None:
    return (
        next((value for name, value in node.entries if name.text == key), None) if isinstance(node, Entries) else None
    )
