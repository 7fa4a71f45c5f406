"""The file of what outlives the process, after whatever a disk or a person has done to it."""

import json

from orchestrator.core.faults import ROW
from orchestrator.core.memory import Memory
from orchestrator.service.answers import encode
from orchestrator.service.kept import FILE, Kept, read_kept, write_kept
from tests.fuzz.control import TOKEN
from tests.fuzz.target import Target, kind_of_word, scratch

DIRECTORY = scratch()
BAYS = ("bay-1", "bay-2")
NOW_S = 50.0


def one(data: bytes) -> None:
    """What a service makes of this file when it starts, and what it writes down and shows of it."""
    (DIRECTORY / FILE).write_bytes(data)
    kept = read_kept(DIRECTORY, BAYS)
    assert set(kept) == set(BAYS)
    for one_kept in kept.values():
        memory = one_kept.memory(NOW_S)
        _is_no_free_start(one_kept, memory)
        shown = {"reason": memory.hold, "faults": [fault.text for fault in memory.faults.values()]}
        assert json.loads(encode(shown)) == shown
    write_kept(DIRECTORY, kept)
    assert read_kept(DIRECTORY, BAYS) == kept


def _is_no_free_start(kept: Kept, memory: Memory) -> None:
    """What was latched or held is so again."""
    assert type(memory.paused) is bool and isinstance(memory.hold, str)
    for name in kept.faults:
        assert name in memory.faults if name in ROW else memory.hold
    assert not kept.running or "found_running" in memory.faults


_WHOLE = {
    "bay-1": {"running": True, "hold": "", "paused": False, "faults": {"bmu_silent": "seen", "emergency": "EMCY"}},
    "bay-2": {"running": False, "hold": "stopped", "paused": True, "faults": {}},
}

TARGET = Target(
    one,
    TOKEN.findall,
    kind_of_word,
    [json.dumps(_WHOLE).encode(), json.dumps(_WHOLE, indent=1).encode(), b'{"bay-1": {"running": false}}', b"{}", b""],
    [
        *(f'"{word}"'.encode() for word in (*BAYS, "running", "hold", "paused", "faults", "bmu_silent", "of later")),
        b"null", b"true", b"false", b"0", b"1", b"NaN", b'""', b'"\\ud800"', b'"\\u0000"', b"{", b"}", b"[", b"]",
        b", ", b": ", b"[" * 1200, b'{"bay-1":' * 300, b"9" * 5000, b"\xff", b"\xef\xbb\xbf", b"\0",
    ],
    ["orchestrator/service/kept.py"],
    max_bytes=6000,
    limit_s=1.0,
)  # fmt: skip
