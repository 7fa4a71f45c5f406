"""libyaml and the pure Python parser give the same tree: bounded, and without YAML's tricks."""

import random
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from orchestrator.config.load import check
from orchestrator.config.shipped import shipped_dir
from orchestrator.config.yaml import tree
from orchestrator.config.yaml.tree import MAX_BYTES, MAX_DEPTH, Entries, Items, Mark, Node, Refused, Scalar, parse

HERE = Path(__file__).parent
FILES = sorted([*HERE.glob("good/*.yaml"), *shipped_dir().glob("policies/*.yaml"), *shipped_dir().glob("configs/*/*")])


def _with(loader: object, data: bytes, monkeypatch: pytest.MonkeyPatch) -> tuple[Node | None, list[object]]:
    with monkeypatch.context() as patch:
        patch.setattr(tree, "_LOADERS", (loader,))
        node, findings = parse("f", data)
        return node, [(finding.line, finding.column, finding.text) for finding in findings]


def test_a_tree_has_what_was_written_and_where() -> None:
    node, findings = parse("f", b"a: 1\nb:\n  - 'x'\n  - {c: on}\n")
    assert findings == []
    assert node == Entries(
        Mark(1, 1),
        (
            (Scalar(Mark(1, 1), "a"), Scalar(Mark(1, 4), "1")),
            (
                Scalar(Mark(2, 1), "b"),
                Items(
                    Mark(3, 3),
                    (
                        Scalar(Mark(3, 5), "x", plain=False),
                        Entries(Mark(4, 5), ((Scalar(Mark(4, 6), "c"), Scalar(Mark(4, 9), "on")),)),
                    ),
                ),
            ),
        ),
    )


@pytest.mark.skipif(not yaml.__with_libyaml__, reason="PyYAML was built without libyaml: there is nothing to compare")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_both_parsers_give_the_same_tree_and_places(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = path.read_bytes()
    pure = _with(yaml.SafeLoader, data, monkeypatch)
    assert _with(yaml.CSafeLoader, data, monkeypatch) == pure
    assert pure[0] is not None


@pytest.mark.parametrize("path", sorted(HERE.glob("broken/*.yaml")), ids=lambda path: path.name)
def test_without_libyaml_the_findings_are_the_same(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = check([path])
    monkeypatch.setattr(tree, "_LOADERS", (yaml.SafeLoader,))
    assert check([path]) == expected


@pytest.mark.parametrize("text", [r'a: "\U00110000"', r'a: "\UFFFFFFFF"', f"%YAML 1.{'1' * 5000}\n---\na: 1\n"])
@pytest.mark.parametrize("loaders", [tree._LOADERS, (yaml.SafeLoader,)], ids=["both", "pure"])
def test_a_number_beyond_all_bounds_is_one_finding(
    text: str, loaders: tuple[type], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tree, "_LOADERS", loaders)
    node, findings = parse("f", text.encode())
    assert node is None
    assert len(findings) == 1


def test_a_byte_order_mark_and_windows_line_ends_are_fine() -> None:
    node, findings = parse("f", b"\xef\xbb\xbfa: 1\r\nb: 2\r\n")
    assert findings == []
    assert isinstance(node, Entries)
    assert [(name.text, name.mark) for name, _ in node.entries] == [("a", Mark(1, 1)), ("b", Mark(2, 1))]


def test_refused_parts_leave_the_rest_readable() -> None:
    node, findings = parse("f", b"a: &x 1\nb: *x\nc: !!int 3\nd: !t {e: 1}\n")
    assert [finding.line for finding in findings] == [1, 2, 3, 4]
    assert isinstance(node, Entries)
    kinds = {name.text: type(value) for name, value in node.entries}
    assert kinds == {"a": Scalar, "b": Refused, "c": Refused, "d": Refused}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"#" * (MAX_BYTES + 1), "more than 524288 bytes"),
        (b"a: " + b"[" * 200_000, f"nested more than {MAX_DEPTH} deep"),
        (b"- " * 200_000, f"nested more than {MAX_DEPTH} deep"),
        (b"{a: " * 100_000, f"nested more than {MAX_DEPTH} deep"),
        (b"? " * 200_000, f"nested more than {MAX_DEPTH} deep"),
        (b"a: [" + b"1," * 200_000 + b"]", "more than 50000 values"),
    ],
    ids=["bytes", "brackets", "dashes", "braces", "questions", "items"],
)
def test_input_is_bounded(data: bytes, said: str) -> None:
    node, findings = parse("f", data)
    assert node is None
    assert [said in finding.text for finding in findings] == [True]


def test_depth_and_size_at_the_bounds_are_read() -> None:
    depth = MAX_DEPTH - 1
    assert parse("f", b"[" * depth + b"1" + b"]" * depth)[1] == []
    assert parse("f", b"a: 1\n#".ljust(MAX_BYTES, b"x"))[1] == []


def test_the_billion_laughs_are_not_told() -> None:
    bomb = b"a: &a [x,x,x,x,x,x,x,x,x]\n" + b"".join(
        b"%c: &%c [%s]\n" % (c, c, b",".join([b"*%c" % (c - 1)] * 9)) for c in range(ord("b"), ord("j"))
    )
    node, findings = parse("f", bomb)
    assert node is None
    assert len(findings) == tree.MAX_FINDINGS
    assert all("anchors and aliases are not allowed" in finding.text for finding in findings)


def test_findings_are_bounded_too() -> None:
    assert len(parse("f", b"\t\n" * 1000)[1]) == tree.MAX_FINDINGS


def test_an_error_that_nobody_translated_is_still_told(monkeypatch: pytest.MonkeyPatch) -> None:
    _, (finding,) = parse("f", b"%YAML 2.0\n---\na: 1\n")
    assert (finding.line, finding.text.startswith("not valid YAML: ")) == (1, True)
    _, (finding,) = parse("f", b"a: >5 x\n  y\n")
    assert finding.text.startswith("not valid YAML: ")


_YAMLISH = st.text(alphabet="abc:- \n\t[]{},'\"#&*!|>%@`?~01.\\\x00é\u2028", max_size=80)


@given(st.one_of(st.text(max_size=200), _YAMLISH).map(lambda text: text.encode("utf-8", "surrogatepass")))
@example(b"a: \xff")
@example(b"\xef\xbb\xbf")
def test_any_bytes_are_a_tree_or_findings_in_the_file(data: bytes) -> None:
    node, findings = parse("f", data)
    assert node is not None or findings
    lines = data.split(b"\n")
    for finding in findings:
        assert 1 <= finding.line <= len(lines) + 1
        assert 1 <= finding.column <= len(data) + 1
        assert finding.text.isprintable()


@given(st.binary(max_size=200))
def test_binary_is_never_an_exception(data: bytes) -> None:
    parse("f", data)


@given(st.integers())
def test_a_damaged_file_is_never_an_exception(seed: int) -> None:
    rng = random.Random(seed)
    data = bytearray(rng.choice(FILES).read_bytes())
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(data))
        data[at : at + rng.choice((0, 1, 1, 5, 40))] = rng.choice(
            (b"", b" ", b"\n", b": ", b"- ", b"]", b"'", b"&a ", b"\t")
        )
    parse("f", bytes(data))
