"""The meaning of the data in a charger's frame, in words for people and as values for programs."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import IntEnum

from orchestrator.model import Cause, ErrorBit
from orchestrator.protocol.charger import (
    STATUS_KINDS,
    Code,
    Kinds,
    Push,
    parse_error,
    status_values,
)
from orchestrator.protocol.frame import ADDRESS, Frame
from orchestrator.protocol.hextext import byte_count


@dataclass(slots=True)
class Meaning:
    """Rows of (bytes, words), facts as JSON values, and violations of the document."""

    rows: list[tuple[bytes, str]] = field(default_factory=list)
    facts: dict[str, object] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)


#: Each command's name and its sender.
NAMES: dict[int, tuple[str, str]] = {
    Code.STATUS_REQUEST: ("status request", "controller → charger"),
    Code.SET: ("set value", "controller → charger, acted on in manual mode only"),
    Code.STATUS_REPLY: ("status reply", "charger → controller"),
    Code.REST: ("stop/resume", "controller → charger"),
    Code.ERROR: ("error", "charger → controller: the frame that it received was bad"),
}

#: The current steps, by their value in a frame (0 … 4) and as people see them everywhere (1 … 5).
_STEPS = {0: "step 1, the lowest", 1: "step 2", 2: "step 3", 3: "step 4", 4: "step 5, the highest"}
_PUSHED: dict[int, tuple[str, dict[int, str]]] = {
    Push.OPERATION: ("operation", {0: "stop", 1: "run"}),
    Push.CURRENT_LIMIT: ("current limit", _STEPS),
    Push.CHARGE_MODE: ("charge mode", {3: "precharge", 4: "charge", 5: "standby"}),
    Push.PRECHARGE: ("precharge function", {0: "off", 1: "pulse", 2: "continuous"}),
}
_RESTS = {0: "stop: to standby, whatever it is doing", 1: "resume: from standby back to normal"}
_UNITS = {"v": " V", "a": " A", "c": " °C"}


def _raw(data: bytes) -> list[tuple[bytes, str]]:
    """Rows of undecoded data."""
    return [(data[at : at + 8], "") for at in range(0, len(data), 8)]


def _words(name: str, value: float) -> str:
    if isinstance(value, IntEnum):
        return f"{value} ({value.name.lower().replace('_', ' ')})"
    if name == "current_step":
        return f"{value} ({_STEPS[int(value)]})"
    return f"{value}{_UNITS[name.rpartition('_')[2]]}"


def error_names(bits: int) -> list[str]:
    """The documented bits of a 0x1F frame that are set."""
    return [bit.name.lower() for bit in ErrorBit if bit.name and bit & bits]


def _status_request(frame: Frame, _kinds: Kinds | None) -> Meaning:
    kind1, kind2 = frame.data
    rows = status_values(kind1, kind2)
    basic = ", ".join(row.title for row in rows if row.kind1) or "none"
    extended = ", ".join(row.title for row in rows if row.kind2) or "none"
    return Meaning(
        [(frame.data[:1], f"kind 1: {basic}"), (frame.data[1:], f"kind 2: {extended}")],
        {"kind1": kind1, "kind2": kind2, "asks": [row.name for row in rows]},
    )


def _set(frame: Frame, _kinds: Kinds | None) -> Meaning:
    push, value = frame.data
    meaning = Meaning(facts={"push": push, "value": value})
    if push in _PUSHED:
        title, allowed = _PUSHED[push]
        says = f"{value}: {allowed[value]}" if value in allowed else f"{value} (documented: {_listed(allowed)})"
        if value not in allowed:
            meaning.problems.append(f"{title} {says}")
    else:
        title, says = f"0x{push:02X} (documented: 1, 2, 4, 8)", f"{value}"
        meaning.problems.append(f"push {title}")
    meaning.rows = [(frame.data[:1], f"push: {title}"), (frame.data[1:], says)]
    return meaning


def _listed(values: Iterable[int]) -> str:
    return ", ".join(map(str, values))


def _rest(frame: Frame, _kinds: Kinds | None) -> Meaning:
    rest = frame.data[0]
    says = _RESTS.get(rest, f"rest {rest} (documented: 0, 1)")
    return Meaning([(frame.data, says)], {"rest": rest}, [] if rest in _RESTS else [says])


def _status_reply(frame: Frame, kinds: Kinds | None) -> Meaning:
    asked = STATUS_KINDS if kinds is None else kinds
    rows = status_values(*asked)
    if len(frame.data) != 2 * len(rows):
        return _raw_reply(frame, kinds)
    meaning = Meaning(facts={"kind1": asked[0], "kind2": asked[1]})
    for at, row in enumerate(rows):
        two = frame.data[2 * at : 2 * at + 2]
        raw = int.from_bytes(two)
        value = row.value(raw)
        if isinstance(value, Cause):
            meaning.problems.append(row.refused(raw))
        meaning.facts[row.name] = None if isinstance(value, Cause) else value
        said = row.refused(raw) if isinstance(value, Cause) else f"{row.title} {_words(row.name, value)}"
        meaning.rows.append((two, said))
    if kinds is None:
        meaning.rows.append((b"", f"taken for the kinds 0x{asked[0]:02X} 0x{asked[1]:02X} that the service asks for"))
    return meaning


def _raw_reply(frame: Frame, kinds: Kinds | None) -> Meaning:
    """The raw words of a reply that does not fit the kinds, or whose kinds are unknown."""
    count = len(frame.data)
    words = [int.from_bytes(frame.data[at : at + 2]) for at in range(0, count, 2)]
    meaning = Meaning(_raw(frame.data), {"words": words})
    if kinds is not None:
        expected = 2 * len(status_values(*kinds))
        meaning.problems.append(
            f"kinds 0x{kinds[0]:02X} 0x{kinds[1]:02X} are answered with {expected} data bytes, got {count}"
        )
    elif count % 2:
        meaning.problems.append(f"data of {byte_count(count)}, but every value has two")
    else:
        meaning.rows.append((b"", "a reply does not say which values it holds: give the kinds of its request"))
    return meaning


def _error(frame: Frame, _kinds: Kinds | None) -> Meaning:
    reply = parse_error(frame)
    received = {
        "length": reply.length,
        "command": reply.command,
        "order": reply.order,
        "checksum": reply.checksum,
    }
    return Meaning(
        [(bytes((value,)), f"{name} that it received") for name, value in received.items()],
        {"errors": error_names(reply.bits), **received},
    )


#: By command: the number of its data bytes, if fixed, and the function that decodes them.
_DATA: dict[int, tuple[int | None, Callable[[Frame, Kinds | None], Meaning]]] = {
    Code.STATUS_REQUEST: (2, _status_request),
    Code.SET: (2, _set),
    Code.STATUS_REPLY: (None, _status_reply),
    Code.REST: (1, _rest),
    Code.ERROR: (4, _error),
}


def order_words(frame: Frame) -> tuple[str, str]:
    """The meaning of the order byte, and what is wrong with it."""
    if frame.command == Code.ERROR:
        return f"what was wrong: {', '.join(error_names(frame.order)) or 'no documented bit is set'}", ""
    if frame.order != ADDRESS:
        problem = f"order 0x{frame.order:02X}, expected 0x{ADDRESS:02X}: it must equal the address"
        return problem, problem
    return "the charger meant", ""


def meaning_of(frame: Frame, kinds: Kinds | None) -> Meaning:
    """The meaning of the frame's data. `kinds` are those of the request that a reply answers, None if unknown."""
    size, decode = _DATA.get(frame.command, (None, None))
    if decode is not None and size in (None, len(frame.data)):
        return decode(frame, kinds)
    meaning = Meaning(_raw(frame.data))
    if decode is None:
        meaning.problems.append(f"command 0x{frame.command:02X} is not documented")
    else:
        meaning.problems.append(f"data of {byte_count(len(frame.data))}, expected {size}")
    return meaning
