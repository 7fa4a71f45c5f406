"""The short form of every target: good inputs and many mutated ones, reproducibly; and bugs it must find."""

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from importlib import import_module
from itertools import count
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from orchestrator.config import ports
from orchestrator.config.yaml import tree
from orchestrator.core import persisted
from orchestrator.devices import battery, dialogue, requester
from orchestrator.devices.sdo_client import SdoClient
from orchestrator.lastresort import bareport
from orchestrator.lastresort.guardian import Guardian
from orchestrator.model import Cause, Measurement
from orchestrator.protocol import frame, standby, words
from orchestrator.service import control, reception, typed
from orchestrator.service.client import Client
from orchestrator.service.reception import Later
from orchestrator.service.request_handler import RequestHandler
from tests.fuzz import __main__ as runner
from tests.fuzz.__main__ import NAMES, main, the_target, unguided
from tests.fuzz.config import STATION
from tests.fuzz.target import Target, changed
from tests.fuzz.watch import MAX_GROWTH_MIB, MIB, GrowthError, SlowError, Watch

Patch = pytest.MonkeyPatch
Bug = Callable[[Patch], None]


EXAMPLES = 1000  #: of each target, about two seconds
SLOW = {"clients": 100, "kept": 500}  #: fewer of these: they wait for each other or for a disk


def inputs(target: Target) -> st.SearchStrategy[bytes]:
    """A good input mutated up to three times, driven by numbers that shrink to smaller examples; or any bytes."""
    few = st.lists(st.integers(0, 2**32), max_size=3)

    def from_seed(seed: bytes, chances: Sequence[int]) -> bytes:
        return reduce(lambda data, chance: changed(target, data, Random(chance)), chances, seed)

    return st.one_of(st.builds(from_seed, st.sampled_from(target.seeds), few), st.binary(max_size=target.max_bytes))


def play(target: Target, phases: Sequence[Phase] = (Phase.generate, Phase.shrink), examples: int = EXAMPLES) -> None:
    """The short form; raises its finding."""
    watch = Watch(target)
    for seed in target.seeds:
        watch.one(seed)

    @settings(max_examples=examples, phases=phases, derandomize=True, database=None)
    @given(inputs(target))
    def each(data: bytes) -> None:
        watch.one(data)

    each()


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_found(name: str) -> None:
    play(the_target(name), examples=SLOW.get(name, EXAMPLES))


#: Target and input: each once found a bug.
ONCE = (
    ("bmu", bytes.fromhex("0080a10280a10281a10280a10280a16903a30000000000000000")),
    ("config", b'%YAML 1.' + b"1" * 5000 + b"\n---\npolicy: p\n"),
    ("config", b'policy: "\\UFFFFFFFF"\n'),
    ("config", STATION.replace(b"/dev/x", b"/dev/my port")),
    ("control", b'{"verb": "start", "bays": ["bay-1", "bay-1"]}\n'),
    ("control", b'{"verb": "stop", "bays": [null]}\n'),
    ("kept", b"[" * 5000),
    ("kept", b'{"bay-1": {"\\ud800": ""}}'),
    ("guardian", b"\x83a\0b"),
)  # fmt: skip


@pytest.mark.parametrize(("name", "data"), ONCE, ids=range(len(ONCE)))
def test_what_was_found_once_is_found_no_more(name: str, data: bytes) -> None:
    Watch(the_target(name)).one(data)


# --- bugs ------------------------------------------------------------------------------------------------------------


def no_checksum(patch: Patch) -> None:
    def trusting(data: bytes, at: int) -> int:
        size = frame.declared_size(data[at : at + 4])
        return -1 if size is None else size if len(data) - at >= size else 0

    patch.setattr(frame, "frame_size", trusting)


def waits_for_ever(patch: Patch) -> None:
    size = frame.frame_size
    patch.setattr(frame, "frame_size", lambda data, at: max(0, size(data, at)))


def any_error_frame(patch: Patch) -> None:
    patch.setattr(dialogue, "parse_error", lambda found: frame.Frame(found.data[3], 0, b"").bits)  # type: ignore[attr-defined]


def much_is_standby(patch: Patch) -> None:
    patch.setattr(standby, "_STANDBY_CENTIAMPS", 5000)


def any_range(patch: Patch) -> None:
    patch.setattr(words, "_decode", lambda field, word, t_s: Measurement(word * field.scale, t_s))


def remembers_all(patch: Patch) -> None:
    ask, number = SdoClient.ask, count(1)

    def hoards(self: SdoClient, key: tuple[int, int], now_s: float, *, write: bool = False) -> None:
        self._answers[next(number), -1] = None
        ask(self, key, now_s, write=write)

    patch.setattr(SdoClient, "ask", hoards)


def short_emergency(patch: Patch) -> None:
    patch.setattr(battery, "is_emergency", lambda _: True)
    patch.setattr(battery, "emergency_of", lambda data: Cause.of("emcy", code=data[1], meaning="", data=""))


def asks_for_ever(patch: Patch) -> None:
    patch.setattr(requester.Requester, "ask", lambda self, now_s, send, *, online: now_s)


def texts_only(patch: Patch) -> None:
    patch.setattr(ports, "_text", lambda node: node.text)


def marks_believed(patch: Patch) -> None:
    patch.setattr(tree, "explain", lambda error: (error.context_mark.line + 1, 1, "not valid YAML"))


def wrong_place(patch: Patch) -> None:
    mark = tree.Mark
    patch.setattr(tree, "Mark", lambda line, column: mark(line + 30, column))


def any_json(patch: Patch) -> None:
    patch.setattr(control, "parse_request", json.loads)


def asks_one_only(patch: Patch) -> None:
    ask = RequestHandler._ask

    def once(self: RequestHandler, bays: list[Any], *more: Any) -> Later:
        return ask(self, bays[:1], *more)

    patch.setattr(RequestHandler, "_ask", once)


def raw_answers(patch: Patch) -> None:
    patch.setattr(reception, "encode", lambda answer: str(answer).encode() + b"\n")


def waits_for_the_line(patch: Patch) -> None:
    hear = Client.hear

    def patient(self: Client, now_s: float) -> bool:
        self._connection.settimeout(None)
        return hear(self, now_s)

    patch.setattr(Client, "hear", patient)
    patch.setattr(import_module("tests.fuzz.clients"), "ANSWER_S", 0.5)


def any_record(patch: Patch) -> None:
    patch.setattr(typed, "_plain", lambda value, _kind: value)


def latches_lost(patch: Patch) -> None:
    patch.setattr(persisted, "ROW", {})


def keeps_old_ports(patch: Patch) -> None:
    patch.setattr(Guardian, "_hold", lambda self, name, fd: self._ports.update({name: fd}))


def any_name(patch: Patch) -> None:
    patch.setattr(bareport, "open_port", lambda name, leave_held: os.open(name, os.O_RDWR))


#: Target → a plausible bug there.
BUGS: dict[str, tuple[Bug, ...]] = {
    "charger": (no_checksum, waits_for_ever, any_error_frame, much_is_standby),
    "bmu": (any_range, remembers_all, short_emergency, asks_for_ever),
    "config": (texts_only, marks_believed, wrong_place),
    "control": (any_json, asks_one_only, raw_answers),
    "clients": (waits_for_the_line,),
    "kept": (any_record, latches_lost),
    "guardian": (keeps_old_ports, any_name),
}
EACH = [(name, bug) for name, bugs in BUGS.items() for bug in bugs]


@pytest.mark.parametrize(("name", "bug"), EACH, ids=lambda value: getattr(value, "__name__", value))
def test_a_bug_is_seen(name: str, bug: Bug, monkeypatch: Patch) -> None:
    bug(monkeypatch)
    with pytest.raises((Exception, ExceptionGroup)):  # any symptom of a bug
        play(replace(the_target(name), limit_s=0.5), [Phase.generate])


def test_every_target_has_its_bugs() -> None:
    assert tuple(BUGS) == NAMES


def test_what_hangs_is_seen_even_if_it_catches_everything() -> None:
    def hangs(_data: bytes) -> None:
        try:
            while True:
                pass
        except AssertionError:
            return

    with pytest.raises(SlowError, match=r"more than 0\.01 s of CPU time"):
        Watch(replace(the_target("charger"), one=hangs, limit_s=0.01)).one(b"")


def test_what_grows_is_seen() -> None:
    hoard: list[bytes] = []
    growing = replace(the_target("charger"), one=lambda _data: hoard.append(b"x" * MIB))
    watch = Watch(growing, warm=1, every=1)
    with pytest.raises(GrowthError, match="MiB more after"):
        for _ in range(2 * int(MAX_GROWTH_MIB)):
            watch.one(b"")
    assert len(hoard) > MAX_GROWTH_MIB / 2


def test_what_the_long_form_finds_is_a_file_that_finds_it_again(
    tmp_path: Path, monkeypatch: Patch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(runner, "WORK", tmp_path)
    (tmp_path / "charger" / "corpus").mkdir(parents=True)
    for number, seed in enumerate(the_target("charger").seeds):
        (tmp_path / "charger" / "corpus" / str(number)).write_bytes(seed)
    with monkeypatch.context() as patch:
        no_checksum(patch)
        assert unguided("charger", 1000, 1.0, seed=1) == 1
        (found,) = (tmp_path / "charger").glob("crash-*")
        assert str(found) in capfd.readouterr().out
        with pytest.raises(AssertionError):
            main(["charger", str(found)])
    assert main(["charger", str(found)]) == 0
    assert main(["charger", str(tmp_path / "charger" / "corpus")]) == 0
