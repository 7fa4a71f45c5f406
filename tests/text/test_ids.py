"""The catalogue and the code agree: every cause that is made has its template, with all that the template needs."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from string import Formatter

from orchestrator.text.catalogue import LANGUAGES
from orchestrator.text.moments import MOMENT, UNIX, told_as

ROOT = Path(__file__).resolve().parents[2] / "orchestrator"
TEXTS = LANGUAGES["en"].texts
#: What makes a cause of an id and parameters.
MAKERS = frozenset({"Cause", "of", "by_policy", "by_station"})
#: Ids that are put together: of a stage, of a quantity.
TOGETHER = ("precharging_", "value_", "row_", "figure_", "goes_on_", "clears_")
#: … and of a request.
REQUESTS = frozenset({"start_now", "reset_now"})
#: What a template has from the cause itself, or from what an id with several causes is made with.
GIVEN = frozenset({"at", "place"})


@cache
def trees() -> tuple[tuple[str, ast.Module], ...]:
    """The product without the texts themselves."""
    paths = [path for path in sorted(ROOT.rglob("*.py")) if path.relative_to(ROOT).parts[:1] != ("text",)]
    return tuple((str(path.relative_to(ROOT)), ast.parse(path.read_text(encoding="utf-8"))) for path in paths)


def made() -> Iterator[tuple[str, str, ast.Call]]:
    """Every cause that is made with its id written there: where, which, the call."""
    for path, tree in trees():
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or not node.args or not isinstance(node.args[0], ast.Constant):
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in MAKERS and isinstance(node.args[0].value, str):
                yield f"{path}:{node.lineno}", node.args[0].value, node


def test_every_cause_that_is_made_has_its_template() -> None:
    assert [f"{where} {id_}" for where, id_, _ in made() if id_ not in TEXTS] == []
    assert len({id_ for _, id_, _ in made()}) > 150


def test_every_cause_has_the_parameters_that_its_template_names() -> None:
    lacking = [
        f"{where} {id_}: {', '.join(missing)}"
        for where, id_, call in made()
        if all(keyword.arg for keyword in call.keywords)  # else they are handed on
        and not (isinstance(call.func, ast.Name) and len(call.args) > 1)
        and (missing := sorted(needed(id_) - {called(keyword.arg) for keyword in call.keywords} - GIVEN))
    ]
    assert lacking == []


def called(name: str | None) -> str | None:
    """What a template calls a parameter: a moment is the time of day there."""
    return told_as(name) if name is not None and name.endswith((MOMENT, UNIX)) else name


def needed(id_: str) -> set[str]:
    """What the template of an id names."""
    return {name for _, name, _, _ in Formatter().parse(TEXTS.get(id_, "")) if name is not None}


def test_every_template_is_of_a_cause_that_is_made() -> None:
    written = {
        node.value
        for _, tree in trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    assert [id_ for id_ in TEXTS if id_ not in written | REQUESTS and not id_.startswith(TOGETHER)] == []


def test_no_id_stands_in_two_files() -> None:
    for folder in ("en", "ko"):
        keys = [
            key.value
            for path in (ROOT / "text" / folder).glob("*.py")
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.AnnAssign)
            and getattr(node.target, "id", "") in ("TEXTS", "WORDS", "CODES")
            and isinstance(node.value, ast.Dict)
            for key in node.value.keys
            if isinstance(key, ast.Constant)
        ]
        texts, words = LANGUAGES[folder].texts, LANGUAGES[folder].words
        assert len(keys) == len(texts) + len(words)
