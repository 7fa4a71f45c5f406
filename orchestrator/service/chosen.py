"""Which bays a command line means: by names, by patterns as in a shell, and by exceptions to these."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from orchestrator.model import Cause

#: What makes a word a pattern, unless a bay has just this name.
WILD = frozenset("*?[")


@dataclass(frozen=True, slots=True)
class Chosen:
    """The names of bays in station order, and the words that match none."""

    bays: tuple[str, ...]
    unknown: tuple[str, ...]


def is_plain(words: Sequence[str]) -> bool:
    """Whether these are names alone: nobody needs to know which bays there are."""
    return not any(WILD.intersection(word) for word in words)


def choose(words: Sequence[str] | None, excepted: Sequence[str], known: Sequence[str]) -> Chosen:
    """The bays meant by these words, None meaning all, without the excepted ones."""
    found, gone = {name for word in words or () for name in _matching(word, known)}, set[str]()
    for word in excepted:
        gone.update(_matching(word, known))
    bays = tuple(name for name in known if (words is None or name in found) and name not in gone)
    unknown = [word for word in (*(words or ()), *excepted) if not any(_matching(word, known))]
    return Chosen(bays, tuple(dict.fromkeys(unknown)))


def unknown(words: Sequence[str], known: Sequence[str]) -> Cause:
    """That no bay is called this, nor matches it; and which bays there are."""
    if len(words) == 1:
        return Cause.of("bay_unknown", bay=f"{words[0]:.80}", bays=tuple(known))
    return Cause.of("bays_unknown", names=tuple(f"'{word:.80}'" for word in words), bays=tuple(known))


def _matching(word: str, known: Sequence[str]) -> Iterator[str]:
    """An exact name wins over a pattern."""
    return (name for name in known if (name == word if word in known else fnmatchcase(name, word)))
