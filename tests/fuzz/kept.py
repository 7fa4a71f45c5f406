"""The files of the persisted state, after whatever a disk or a person has done to them."""

import json

from orchestrator.core.faults import ROW
from orchestrator.core.memory import Memory
from orchestrator.core.persisted import Persisted, PersistedFault
from orchestrator.model import Cause
from orchestrator.service import reception
from orchestrator.service.loading import FILE, FIRST_FILE, load
from orchestrator.service.past import Entry, Place
from orchestrator.service.stateformat import Stamp, decode, encode
from orchestrator.text.catalogue import say
from tests.fuzz.control import TOKEN
from tests.fuzz.target import Target, kind_of_word, scratch

DIRECTORY = scratch()
PLACES = (Place("bay-1", "/dev/ttyS1", "can0", 16), Place("bay-2", "/dev/ttyS2", "can0", 17))
NOW_S = 50.0
NOW = Stamp(1_800_000_000.0, NOW_S, "this")


def one(data: bytes) -> None:
    """Start a service on this file, in either format, and check what it writes and shows."""
    for name in (FILE, FIRST_FILE):
        (DIRECTORY / name).write_bytes(data)
        loaded = load(DIRECTORY, PLACES, NOW)
        (DIRECTORY / name).unlink()
        found = {entry.place: entry.persisted for entry in loaded.entries}
        assert {*PLACES} <= found.keys()
        for place in PLACES:
            memory = found[place].memory(NOW_S)
            _is_no_free_start(found[place], memory)
            causes = [say(fault.cause) for fault in memory.faults.values()]
            shown = {"reason": say(memory.operator.hold), "faults": causes}
            assert json.loads(reception.encode(shown)) == shown
        assert decode(encode(NOW, loaded.run, loaded.entries), NOW) == (loaded.run, list(loaded.entries))


def _is_no_free_start(persisted: Persisted, memory: Memory) -> None:
    """What was latched or held is latched or held again."""
    assert type(memory.operator.paused) is bool and isinstance(memory.operator.hold, Cause | None)
    for name in persisted.faults:
        assert name in memory.faults or (name not in ROW and memory.operator.hold)
    assert not persisted.running or "found_running" in memory.faults


_FIRST = {
    "bay-1": {"running": True, "hold": "", "paused": False, "faults": {"bmu_silent": "seen", "emergency": "EMCY"}},
    "bay-2": {"running": False, "hold": "stopped", "paused": True, "faults": {}},
}
_ENTRIES = [
    Entry(
        PLACES[0],
        Persisted(running=True, faults={"bmu_silent": PersistedFault(Cause.of("said", text="seen"), raised=3.0)}),
        3,
    ),
    Entry(
        Place("bay-2", "/dev/ttyS9", "can0", 17), Persisted(hold=Cause.of("said", text="stopped"), soc=(1.0, 50.0)), 4
    ),
]
_SECOND = encode(Stamp(1_790_000_000.0, 7.0, "that"), 4, _ENTRIES)

TARGET = Target(
    one,
    TOKEN.findall,
    kind_of_word,
    [_SECOND, json.dumps(_FIRST).encode(), json.dumps(_FIRST, indent=1).encode(), b'{"bay-1": {"running": false}}',
     b"{}", b""],
    [
        *(f'"{word}"'.encode() for word in (
            "bay-1", "bay-2", "running", "hold", "paused", "faults", "bmu_silent", "of later", "entries", "format",
            "port", "node_id", "run", "written", "boot", "latched", "strikes", "/dev/ttyS1",
        )),
        b"null", b"true", b"false", b"0", b"1", b"-1", b"NaN", b"Infinity", b"1e999", b'""', b'"\\ud800"',
        b'"\\u0000"', b"{", b"}", b"[", b"]", b", ", b": ", b"[" * 1200, b'{"bay-1":' * 300, b"9" * 5000, b"\xff",
        b"\xef\xbb\xbf", b"\0",
    ],
    ["orchestrator/service/loading.py", "orchestrator/service/past.py", "orchestrator/service/stateformat.py",
     "orchestrator/service/typed.py"],
    max_bytes=6000,
    limit_s=1.0,
)  # fmt: skip
