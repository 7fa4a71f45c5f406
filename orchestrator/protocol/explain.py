"""Explains charger frames, good or bad, in any notation, to people and programs (`orchestrator decode`)."""

from collections.abc import Iterator
from dataclasses import dataclass

from orchestrator.protocol.charger import Code, Kinds
from orchestrator.protocol.frame import (
    ADDRESS,
    COUNTED,
    END,
    MAX_FRAME,
    OVERHEAD,
    START,
    Frame,
    checksum,
    declared_size,
    frame_size,
    why_bad,
)
from orchestrator.protocol.hextext import byte_count, hex_of, parse_hex
from orchestrator.protocol.meaning import NAMES, meaning_of, order_words

#: The one example in the document that is not a valid frame; tell whoever types it in that the mistake is not theirs.
_MISPRINT = bytes.fromhex("AFFA90071F031110058939AFA0")
_MISPRINT_NOTE = "This is the example of §3.3.5: the document prints 0x39, the sum is 0x68. A charger would send 0x68."


@dataclass(frozen=True, slots=True)
class Explained:
    """One frame, one false start, or a run of bytes outside any frame."""

    ok: bool  #: a good frame with only documented content
    text: str  #: several lines for a person
    facts: dict[str, object]  #: the same for a program, as JSON values


def explain(text: str, kinds: Kinds | None = None) -> list[Explained]:
    """Everything in a hexadecimal text, in order. HexError if it is not hexadecimal.

    A reply does not identify its values. It is decoded by `kinds`, else by the preceding status request in the same
    text, else by the kinds that the service requests if the length fits; else its raw words are shown.
    """
    data = parse_hex(text)
    explained = []
    asked = kinds
    for at, piece in _pieces(data):
        if not piece.startswith(START):
            explained.append(_garbage(at, piece))
        elif why_bad(piece):
            explained.append(_bad(at, data, piece, asked))
        else:
            frame = _frame(piece)
            if kinds is None and frame.command == Code.STATUS_REQUEST and len(frame.data) == 2:
                asked = (frame.data[0], frame.data[1])
            explained.append(_good(at, piece, frame, asked))
    return explained


def _pieces(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Good frames, false starts to their declared length, and the bytes in between, each with its offset."""
    done = 0
    at = data.find(START)
    while at >= 0:
        if at > done:
            yield done, data[done:at]
        size = frame_size(data, at)
        after = data.find(START, at + max(size, 1))
        claimed = declared_size(data[at : at + MAX_FRAME]) or (after if after > at else len(data)) - at
        piece = data[at : at + min(claimed, MAX_FRAME)]
        yield at, piece
        done = max(done, at + len(piece))
        at = after
    if done < len(data):
        yield done, data[done:]


def _frame(piece: bytes) -> Frame:
    return Frame(piece[4], piece[5], piece[6:-COUNTED])


def _garbage(at: int, piece: bytes) -> Explained:
    head = f"byte {at}: {byte_count(len(piece))} outside of any frame (no start AF FA)"
    rows: list[Row] = [("", piece[cut : cut + 16], "") for cut in range(0, len(piece), 16)]
    facts: dict[str, object] = {"offset": at, "hex": hex_of(piece), "frame": False, "valid": False}
    return Explained(ok=False, text=_text(head, rows, []), facts=facts)


def _good(at: int, piece: bytes, frame: Frame, kinds: Kinds | None) -> Explained:
    rows, facts, problems = _fields(piece, frame, kinds)
    verdict = "a whole frame, but not as documented" if problems else "good"
    head = f"byte {at}: {facts['name']}, {byte_count(len(piece))}, {verdict}"
    facts = {"offset": at, "hex": hex_of(piece), "frame": True, "valid": True, **facts, "problems": problems}
    return Explained(ok=not problems, text=_text(head, rows, problems), facts=facts)


def _bad(at: int, data: bytes, piece: bytes, kinds: Kinds | None) -> Explained:
    reason = why_bad(piece)
    facts: dict[str, object] = {"offset": at, "hex": hex_of(piece), "frame": True, "valid": False}
    notes: list[str] = []
    if declared_size(piece) == len(piece):
        rows, decoded, notes = _fields(piece, _frame(piece), kinds)
        facts |= decoded
    else:
        rows = [(name, piece[begin:end], "") for name, begin, end in _HEAD if piece[begin:end]]
        rows += [("rest", piece[cut : cut + 8], "") for cut in range(6, len(piece), 8)]
    notes += _hints(data[at : at + MAX_FRAME], piece)
    facts["problems"] = [reason, *notes]
    return Explained(ok=False, text=_text(f"byte {at}: not a good frame: {reason}", rows, notes), facts=facts)


def _hints(ahead: bytes, piece: bytes) -> list[str]:
    """Hints at the mistake: the document's own one, or an end marker that contradicts the length."""
    if piece == _MISPRINT:
        return [_MISPRINT_NOTE]
    end = ahead.find(END, OVERHEAD - 2)
    whole = declared_size(piece) == len(piece) and piece.endswith(END)
    if whole or end < 0 or START in ahead[2:end]:
        return []
    return [
        f"an end AF A0 stands after {end + 2} bytes: the length of such a frame is 0x{end + 2 - OVERHEAD + COUNTED:02X}"
    ]


_HEAD = (("start", 0, 2), ("address", 2, 3), ("length", 3, 4), ("command", 4, 5), ("order", 5, 6))
Row = tuple[str, bytes, str]


def _fields(piece: bytes, frame: Frame, kinds: Kinds | None) -> tuple[list[Row], dict[str, object], list[str]]:
    """A frame of its declared length, field by field, whether its values are right or not."""
    meaning = meaning_of(frame, kinds)
    order, order_problem = order_words(frame)
    name, sender = NAMES.get(frame.command, ("unknown command", "not documented"))
    said, summed = piece[-3], checksum(piece[2:-3])
    rows = [
        ("start", piece[:2], ""),
        ("address", piece[2:3], "" if piece[2] == ADDRESS else f"wrong, expected {ADDRESS:02X}"),
        ("length", piece[3:4], f"{piece[3]}: command, order, {byte_count(len(frame.data))} of data, checksum"),
        ("command", piece[4:5], f"{name} ({sender})"),
        ("order", piece[5:6], order),
        *(("" if at else "data", part, words) for at, (part, words) in enumerate(meaning.rows)),
        ("checksum", piece[-3:-2], "good" if said == summed else f"wrong, expected {summed:02X}"),
        ("end", piece[-2:], "" if piece.endswith(END) else f"wrong, expected {hex_of(END)}"),
    ]
    facts: dict[str, object] = {
        "name": name,
        "command": frame.command,
        "order": frame.order,
        "data": hex_of(frame.data),
        "decoded": meaning.facts,
        "checksum": {"got": said, "expected": summed},
    }
    return rows, facts, [problem for problem in (order_problem, *meaning.problems) if problem]


def _text(head: str, rows: list[Row], notes: list[str]) -> str:
    width = max(len(hex_of(part)) for _, part, _ in rows)
    lines = [f"  {name:<9} {hex_of(part):<{width}}  {words}".rstrip() for name, part, words in rows]
    return "\n".join([head, *lines, *(f"  ! {note}" for note in notes)])
