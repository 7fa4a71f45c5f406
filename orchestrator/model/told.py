"""A cause in JSON, and what says that something is wrong: parts of every document."""

from collections.abc import Mapping
from typing import Annotated, TypedDict


class CauseFields(TypedDict):
    """A reason as data. Two are the same if `id` and `key` are: the figures in `params` change all the time."""

    id: Annotated[str, "which reason it is, for programs (causes.md)"]
    params: Annotated[Mapping[str, object], "its figures and words, by name, with units; some are causes, or lists"]
    key: Annotated[str, "the key of the policy or station file that sets the limit; empty without one"]
    place: Annotated[str, "FILE:LINE of that key"]
    advice: Annotated[str, "the id of what to do; empty without"]


class ToldCause(CauseFields):
    """A reason with its sentence."""

    text: Annotated[str, "the sentence for people, in the language of the service"]


class Problem(TypedDict):
    """What is wrong with something."""

    problem: Annotated[str, "what is wrong, for people; empty if nothing is"]
    cause: Annotated[ToldCause | None, "the same as data"]
