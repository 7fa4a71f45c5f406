"""Rules between keys. Each kind of file has a table of them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

Problems = Iterator[tuple[str, str]]  #: (dotted path of the key to fix, what is wrong and what is allowed)


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: a pure function, and the keys whose values it receives."""

    test: Callable[..., Problems]
    keys: tuple[str, ...]


def problems(rules: tuple[Rule, ...], values: Mapping[str, object]) -> Problems:
    """The rules' findings. A rule is skipped if one of its keys is absent, null or already a finding."""
    for rule in rules:
        given = [values.get(key) for key in rule.keys]
        if None not in given:
            yield from rule.test(*given)
