"""The generic walk: types from type hints, all findings at once, and never an exception."""

import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.config.load import check, load_policy
from orchestrator.config.shipped import shipped_dir
from orchestrator.config.yaml.reader import MAX_FINDINGS, Reader
from orchestrator.config.yaml.schema import INVALID, places
from orchestrator.config.yaml.tree import parse
from orchestrator.errors import ConfigError
from orchestrator.keys import Range, Source, key
from orchestrator.model import ControlMode

SHIPPED = [path.read_text() for path in shipped_dir().glob("*/**/*.yaml")] or [
    path.read_text() for folder in ("policies", "configs/maps", "configs/stations")
    for path in (shipped_dir() / folder).glob("*.yaml")
]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    """A nested record."""

    from_: int = key("where it begins", unit="V", ge=0)
    word: str = key("a word", default="none")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outer:
    """One key of each type."""

    number: float = key("a number", default=1.5)
    flag: bool = key("a flag", default=False)
    mode: ControlMode = key("a mode", default=ControlMode.MANUAL)
    span: Range | None = key("a range", unit="V", ge=0, le=9, default=None)
    numbers: tuple[float, ...] = key("numbers", gt=0, default=())
    inners: tuple[Inner, ...] = key("records", default=())
    inner: Inner = key("a record", default_factory=lambda: Inner(from_=7))
    names: Mapping[str, Mapping[str, object]] = key("names", default_factory=dict)
    path: Path = key("a path", default=Path("x"))
    port: str = key("a port", is_path=True, default="")
    source: Source = field(default=Source("?"), compare=False)


def _read(text: str) -> tuple[object, list[str], Reader]:
    node, findings = parse("dir/f.yaml", text.encode())
    assert node is not None
    assert not findings
    reader = Reader("dir/f.yaml")
    value = reader.read(Outer, node)
    return value, [str(finding) for finding in sorted(reader.findings)], reader


def test_every_type_is_read() -> None:
    value, findings, reader = _read(
        "number: -2\nflag: true\nmode: automatic\nspan: [0, 9]\nnumbers: [1, 2.5]\ninners:\n  - {from: 0x10}\n"
        "inner: {from: 1, word: on}\nnames: {a: {b: 1, c: [x]}}\npath: p\nport: /dev/x\n".replace("c: [x]", "c: x")
    )
    assert findings == []
    assert value == Outer(
        number=-2.0,
        flag=True,
        mode=ControlMode.AUTOMATIC,
        span=Range(0.0, 9.0),
        numbers=(1.0, 2.5),
        inners=(Inner(from_=16),),
        inner=Inner(from_=1, word="on"),
        names={"a": {"b": 1, "c": "x"}},
        path=Path("dir/p"),
        port="/dev/x",
    )
    assert reader.values["inners[0].from"] == 16
    assert reader.values["inners[0].word"] == "none"
    assert isinstance(value, Outer)
    assert value.source.at("inners[0].from") == "dir/f.yaml:7"


def test_defaults_are_known_to_the_rules_key_by_key() -> None:
    value, findings, reader = _read("flag: false\n")
    assert (value, findings) == (Outer(), [])
    assert (reader.values["inner.from"], reader.values["inner.word"]) == (7, "none")
    assert reader.values["span"] is None


def test_all_findings_come_at_once_and_the_rest_is_read() -> None:
    value, findings, reader = _read(
        "number: x\nflag: 2\nmode: on\nspan: [5, 10]\nnumbers: [1, 0, a]\ninners: [{}, {from: -1, wort: a}, 3]\n"
        "inner:\nnames: {a: 1}\npath: ''\nport: tty\n"
    )
    assert value is INVALID
    assert findings == [
        "dir/f.yaml:1:9: error: number: 'x' is not a number",
        "dir/f.yaml:2:7: error: flag: write true or false, not '2'",
        "dir/f.yaml:3:7: error: mode: 'on' is not one of the words allowed here; allowed: automatic, manual",
        "dir/f.yaml:4:11: error: span[1]: 10 V is too high, allowed: 0 … 9 V",
        "dir/f.yaml:5:14: error: numbers[1]: 0 is too low, allowed: above 0",
        "dir/f.yaml:5:17: error: numbers[2]: 'a' is not a number",
        "dir/f.yaml:6:10: error: inners[0]: the key 'from' is missing: where it begins, in V",
        "dir/f.yaml:6:21: error: inners[1].from: -1 V is too low, allowed: at least 0 V",
        "dir/f.yaml:6:25: error: unknown key 'wort' in inners[1]; did you mean word? Allowed here: from, word",
        "dir/f.yaml:6:35: error: inners[2]: needs the key from, and if wanted word, indented below it",
        "dir/f.yaml:7:1: error: inner: needs the key from, and if wanted word, indented below it",
        "dir/f.yaml:8:12: error: names.a: needs names with their values, indented below it: names",
        "dir/f.yaml:9:7: error: path: needs a text: a path",
        "dir/f.yaml:10:7: error: port: 'tty' is not a whole path: write e.g. /dev/tty",
    ]
    assert reader.values["inners[1].word"] == "a", "read as the key that was meant"


def test_a_mistyped_key_is_not_read_over_the_right_one() -> None:
    _, findings, reader = _read("inner: {from: 1, word: right, wort: wrong}\n")
    assert len(findings) == 1
    assert reader.values["inner.word"] == "right"
    _, findings, reader = _read("inner: {from: 1, wort: first, wrod: second}\n")
    assert len(findings) == 2
    assert reader.values["inner.word"] == "first"


def test_a_key_of_a_deeper_group_is_sent_there() -> None:
    _, (finding,), _ = _read("from: 1\n")
    assert "unknown key 'from'; it belongs below inners or inner, indented;" in finding
    assert places(Outer, frozenset()) == ("inners.from", "inners.word", "inner.from", "inner.word")


def test_a_finding_at_an_unwritten_key_is_placed_at_its_nearest_parent() -> None:
    _, _, reader = _read("flag: true\ninner: {from: 1}\n")
    reader.report("inner.word", "too short")
    reader.report("span[1]", "too wide")
    assert [str(finding) for finding in reader.findings] == [
        "dir/f.yaml:2:8: error: inner.word: too short",
        "dir/f.yaml:1:1: error: span[1]: too wide",
    ]


def test_findings_are_bounded() -> None:
    _, findings, _ = _read("".join(f"key-{i}: 1\n" for i in range(1000)))
    assert len(findings) == MAX_FINDINGS


def test_a_range_has_an_inside() -> None:
    _, findings, _ = _read("span: [5, 5]\n")
    assert findings == ["dir/f.yaml:1:7: error: span: [low, high] with low below high, not [5, 5]"]


def test_a_path_is_no_longer_than_linux_allows() -> None:
    _, (finding,), _ = _read(f"path: {'x' * 5000}\n")
    assert finding.endswith("a path has at most 4096 characters, this one 5000")


# --- arbitrary input -------------------------------------------------------------------------------------------------


def _all_kinds(text: str) -> None:
    """Reads `text` as each kind of file; anything but findings is a bug."""
    with TemporaryDirectory() as directory:
        for first in ("", "policy: a\n", "station: a\n", "map: a\n"):
            file = Path(directory, "x.yaml")
            file.write_bytes((first + text).encode("utf-8", "surrogatepass"))
            for finding in check([file]):
                assert finding.line >= 1
                assert finding.column >= 1
                assert finding.text.isprintable()
                assert len(finding.text) < 1000
            try:
                load_policy(file)
            except ConfigError as error:
                assert error.findings


_TEXTS = st.text(max_size=12) | st.sampled_from(["null", "on", "1:30", ".nan", "0x10", "1", "55.2", "li-ion-48v"])
_KEYS = st.sampled_from(sorted({line.split(":")[0].strip(" -#") for text in SHIPPED for line in text.splitlines()}))
_TREES = st.recursive(
    _TEXTS | st.integers() | st.floats() | st.booleans() | st.none(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_KEYS | _TEXTS, inner, max_size=6),
    max_leaves=20,
)


@given(st.text(max_size=100))
def test_any_text_is_findings(text: str) -> None:
    _all_kinds(text)


@given(st.dictionaries(_KEYS, _TREES, max_size=6))
def test_any_tree_is_findings(tree: dict[str, object]) -> None:
    _all_kinds(yaml.safe_dump(tree, allow_unicode=True))


@given(st.integers())
def test_any_shipped_file_with_a_value_exchanged_is_findings_or_well(seed: int) -> None:
    rng = random.Random(seed)
    lines = rng.choice(SHIPPED).splitlines()
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(lines))
        lines[at : at + rng.randint(0, 2)] = [rng.choice(rng.choice(SHIPPED).splitlines())] * rng.randint(0, 2)
    with TemporaryDirectory() as directory:
        file = Path(directory, "x.yaml")
        file.write_text("\n".join(lines))
        check([file])
