"""Translates the YAML parser's complaints into messages that tell a person what to fix."""

import re

import yaml

#: (pattern in the parser's problem, pattern in its context, point to where the construct began?, our message)
_EXPLANATIONS: tuple[tuple[str, str, bool, str], ...] = (
    (
        "mapping values are not allowed here",
        "",
        False,
        "a second ':' in one value, a ':' without a space behind it in the line above, or a line indented deeper than "
        "its group: put a text with ': ' in quotes, and begin all keys of one group in the same column",
    ),
    (
        r"found character '(?P<what>.)' that cannot start",
        "",
        False,
        "a value cannot begin with {what}: put it in quotes",
    ),
    (
        "found unexpected end of stream|found unexpected document separator",
        "quoted scalar",
        True,
        "the text in quotes that begins here is never closed",
    ),
    (
        "found unknown escape character '(?P<what>.)'",
        "",
        False,
        "\\{what} means nothing in double quotes: use single quotes",
    ),
    (
        "invalid Unicode character escape code",
        "",
        False,
        "no character has this number: write the character itself, or put the text in single quotes",
    ),
    ("could not find expected ':'", "simple key", True, "a key needs ': ' (colon and space) behind it"),
    (
        r"expected ',' or '\]'",
        "",
        True,
        "the list that begins here is not closed: a ',' or ']' is missing before line {to_line}, column {to_column}",
    ),
    (
        r"expected ',' or '\}'",
        "",
        True,
        "the group that begins here is not closed: a ',' or '}}' is missing before line {to_line}, column {to_column}",
    ),
    (
        "sequence entries are not allowed here",
        "",
        False,
        "a list item '- ' cannot stand here: put it in a line of its own below its key",
    ),
    (
        "expected <block end>, but found '(?P<what>[^<'][^']*|<scalar>)'",
        "",
        False,
        "nothing can stand here, behind a value that has ended: a ',' missing, or quotes around a text?",
    ),
    (
        "expected <block end>",
        "block sequence|block collection",
        False,
        "the indentation does not fit: the list began in line {line}, column {column}, all its '-' belong there",
    ),
    (
        "expected <block end>",
        "",
        False,
        "the indentation does not fit: the group began in line {line}, column {column}, all its lines begin there",
    ),
    (
        "expected alphabetic or numeric character",
        "alias|anchor",
        True,
        "a value cannot begin with * or &: put it in quotes",
    ),
    (
        "expected the node content, but found '(?P<what>[^']*)'|did not find expected node content",
        "",
        False,
        "a value is missing before this",
    ),
)


def explain(error: yaml.MarkedYAMLError) -> tuple[int, int, str]:
    """The line and column (from 1) of a YAML error, and what to do about it."""
    problem, context = str(error.problem), str(error.context)
    began = error.context_mark or error.problem_mark
    for pattern, within, at_start, text in _EXPLANATIONS:
        match = re.search(pattern, problem)
        if match and re.search(within, context):
            mark = began if at_start else error.problem_mark
            there = error.problem_mark
            facts: dict[str, object] = dict(match.groupdict(), line=_line(began), column=_column(began))
            facts.update(to_line=_line(there), to_column=_column(there))
            return _line(mark), _column(mark), text.format(**facts)
    mark = error.problem_mark or began
    return _line(mark), _column(mark), f"not valid YAML: {', '.join(p for p in (error.context, problem) if p)}"


def _line(mark: yaml.Mark | None) -> int:
    return mark.line + 1 if mark else 1


def _column(mark: yaml.Mark | None) -> int:
    return mark.column + 1 if mark else 1
