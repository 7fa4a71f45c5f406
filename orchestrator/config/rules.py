"""Rules across keys: what no single key can know. Each file kind has a table of them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

Problems = Iterator[tuple[str, str]]  #: (dotted path of the key to mend, what is wrong and what is allowed)


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: a pure function, and the keys whose values it is given."""

    test: Callable[..., Problems]
    keys: tuple[str, ...]


def problems(rules: tuple[Rule, ...], values: Mapping[str, object]) -> Problems:
    """What the rules find. A rule of which a key is absent, null or already a finding has nothing to say."""
    for rule in rules:
        given = [values.get(key) for key in rule.keys]
        if None not in given:
            yield from rule.test(*given)
