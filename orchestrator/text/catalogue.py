"""`say()`: the sentence for a cause, in English or Korean.

Theory of operation. A template is stored under the id of its cause. It names its parameters, with the rounding of the
figures. A frame combines it with any advice; `where` precedes the evidence, `because` (a person's own words), `then` and
`how` follow. Besides the number
formats there are six of our own: `word` (a word of a fixed list, translated), `nth` (the first time …), `and` and
`then` (how the parts of a list are joined), `after` (a cause, if there is one, after what precedes it), `past` (a cause
in the past tense).

Past conditions use the past tense: a template holds both, `{reports|reported}`, and the cause says which applies
(`past`). Moments normally arrive as the time of day, in parameters called `…_at`. A cause straight from the core, which
knows no clock, has them in seconds, called `…_t_s`.

`say` never raises, whatever it is given: it is often asked for the reason of a stop. A cause that is unknown, for
example from an older or newer version, or incomplete is shown as its data.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.model.told import ToldCause
from orchestrator.text.en.advice import ADVICE as EN_ADVICE
from orchestrator.text.en.bays import TEXTS as EN_BAYS
from orchestrator.text.en.codes import CODES as EN_CODES
from orchestrator.text.en.faults import TEXTS as EN_FAULTS
from orchestrator.text.en.health import TEXTS as EN_HEALTH
from orchestrator.text.en.limits import TEXTS as EN_LIMITS
from orchestrator.text.en.links import TEXTS as EN_LINKS
from orchestrator.text.en.northbound import TEXTS as EN_NORTHBOUND
from orchestrator.text.en.pages import TEXTS as EN_PAGES
from orchestrator.text.en.records import TEXTS as EN_RECORDS
from orchestrator.text.en.service import TEXTS as EN_SERVICE
from orchestrator.text.en.words import FRAMES as EN_FRAMES
from orchestrator.text.en.words import WORDS as EN_WORDS
from orchestrator.text.ko.advice import ADVICE as KO_ADVICE
from orchestrator.text.ko.bays import TEXTS as KO_BAYS
from orchestrator.text.ko.codes import CODES as KO_CODES
from orchestrator.text.ko.faults import TEXTS as KO_FAULTS
from orchestrator.text.ko.health import TEXTS as KO_HEALTH
from orchestrator.text.ko.limits import TEXTS as KO_LIMITS
from orchestrator.text.ko.links import TEXTS as KO_LINKS
from orchestrator.text.ko.northbound import TEXTS as KO_NORTHBOUND
from orchestrator.text.ko.pages import TEXTS as KO_PAGES
from orchestrator.text.ko.particles import resolved
from orchestrator.text.ko.records import TEXTS as KO_RECORDS
from orchestrator.text.ko.service import TEXTS as KO_SERVICE
from orchestrator.text.ko.words import FRAMES as KO_FRAMES
from orchestrator.text.ko.words import WORDS as KO_WORDS
from orchestrator.text.moments import MOMENT, UNIX, told_as

#: The effect of a tripping fault, as a cause carries it: its sentence begins with what to do.
TRIP = "TRIP"
#: The present and the past form in a template: {reports|reported}.
TENSES = re.compile(r"\{([^{}|]*)\|([^{}|]*)\}")
#: Formats that are not number formats.
JOINS = {"": "list", "word": "list", "and": "and", "then": "then"}
#: No sentence is longer, whatever its parameters are.
MOST_CHARACTERS = 4000


@dataclass(frozen=True, slots=True)
class Language:
    """All texts of one language."""

    texts: Mapping[str, str]
    advice: Mapping[str, str]
    words: Mapping[str, str]
    frames: Mapping[str, str]
    past: Mapping[str, str]  #: the texts in the past tense
    finish: Callable[[str], str]  #: what depends on the finished sentence


def _language(
    texts: Mapping[str, str],
    advice: Mapping[str, str],
    words: Mapping[str, str],
    frames: Mapping[str, str],
    finish: Callable[[str], str] = str,
) -> Language:
    present, past = ({id_: TENSES.sub(tense, text) for id_, text in texts.items()} for tense in (r"\1", r"\2"))
    return Language(present, advice, words, frames, past, finish)


LANGUAGES: Mapping[str, Language] = {
    "en": _language(
        {
            **EN_FAULTS,
            **EN_BAYS,
            **EN_LIMITS,
            **EN_LINKS,
            **EN_SERVICE,
            **EN_PAGES,
            **EN_HEALTH,
            **EN_RECORDS,
            **EN_NORTHBOUND,
        },
        EN_ADVICE,
        {**EN_WORDS, **EN_CODES},
        EN_FRAMES,
    ),
    "ko": _language(
        {
            **KO_FAULTS,
            **KO_BAYS,
            **KO_LIMITS,
            **KO_LINKS,
            **KO_SERVICE,
            **KO_PAGES,
            **KO_HEALTH,
            **KO_RECORDS,
            **KO_NORTHBOUND,
        },
        KO_ADVICE,
        {**KO_WORDS, **KO_CODES},
        KO_FRAMES,
        resolved,
    ),
}


def say(cause: Cause | None, language: str = "en", otherwise: str = "") -> str:
    """The sentence; "" for no cause. An unknown language means English.

    `otherwise` is the sentence for a cause that is not understood, if its data is not to be shown.
    """
    if cause is None:
        return ""
    texts = LANGUAGES.get(language, LANGUAGES["en"])
    try:
        return texts.finish(_sentence(cause, texts)[:MOST_CHARACTERS])
    except (ArithmeticError, LookupError, RecursionError, TypeError, ValueError):
        return otherwise or _data(cause, texts)


def fields(cause: Cause | None, language: str = "en") -> ToldCause | None:
    """A cause with its sentence, as in JSON."""
    return as_told(cause, language) if cause is not None else None


def as_told(cause: Cause, language: str = "en") -> ToldCause:
    """The same where there is one."""
    return {**plain(cause), "text": say(cause, language)}


def advise(id_: str, language: str = "en") -> str:
    """What to do about a fault, without its evidence; "" if there is no advice."""
    return LANGUAGES.get(language, LANGUAGES["en"]).advice.get(id_, "")


def _sentence(cause: Cause, texts: Language) -> str:
    params, frames = _Params(cause, texts), texts.frames
    what = _evidence(cause, texts, params)
    if cause.advice:
        tripped, do = params.get("effect") == _Value(TRIP, texts), texts.advice[cause.advice].format_map(params)
        if "strikes" in params:
            do = frames["strikes"].format(do=do, strikes=params["strikes"])
        what = frames["trip" if tripped else "advice"].format(do=do, what=what)
    what = f"{what}{params['then']:after}" if "then" in params else what
    return f"{what}: {params['how']}" if "how" in params else what


def _evidence(cause: Cause, texts: Language, params: "_Params") -> str:
    """The evidence, present or past, with its times and its figures: then, at the worst, and now."""
    past = replace(texts, texts=texts.past) if cause.param("past") is True else texts
    what, frames = past.texts[cause.id].format_map(_Params(cause, past) if past is not texts else params), texts.frames
    what = frames["where"].format(where=params["where"], what=what) if "where" in params else what
    if "because" in params:
        what = frames["because"].format(what=what, because=params["because"])
    if "raised_at" in params:
        what = frames["at"].format(what=what, raised_at=params["raised_at"])
    notes = []
    if "since_at" in params:
        notes.append(frames["was" if "was" in params else "since"].format_map(params))
    notes += [str(params["worst"])] if "worst" in params else []
    notes += [frames["now"].format_map(params)] if "now" in params else []
    return f"{what}{frames['then']}{frames['list'].join(notes)}" if notes else what


def _data(cause: Cause, texts: Language) -> str:
    """The data of a cause that fits no template."""
    try:
        pairs = [*cause.params, ("key", cause.key), ("place", cause.place)]
        shown = ", ".join(f"{name}={_plainly(value)}" for name, value in pairs if value not in ("", None))
        return texts.frames["unknown"].format(id=cause.id, params=shown)[:MOST_CHARACTERS]
    except (ArithmeticError, LookupError, RecursionError, TypeError, ValueError):
        return str(cause.id)


def _plainly(value: object) -> str:
    if isinstance(value, Cause):
        return value.id
    return " ".join(map(_plainly, value)) if isinstance(value, tuple) else str(value)


class _Params(dict[str, "_Value"]):
    """A cause's parameters for `format_map`, with `at`: the place in brackets, if there is one."""

    def __init__(self, cause: Cause, texts: Language) -> None:
        super().__init__((name, _Value(value, texts)) for name, value in cause.params)
        for name, value in cause.params:
            if name.endswith((MOMENT, UNIX)) and isinstance(value, int | float):
                self[told_as(name)] = _Value(f"{value:.0f} s", texts)
        self["at"] = _Value(texts.frames["place"].format(place=cause.place) if cause.place else "", texts)
        self["place"] = _Value(cause.place, texts)


@dataclass(frozen=True, slots=True)
class _Value:
    """One parameter, which formats itself."""

    value: object
    texts: Language

    def __str__(self) -> str:
        return format(self, "")

    def __format__(self, form: str) -> str:
        value, texts = self.value, self.texts
        if value is None:
            return "" if form in ("", "after") else "–"
        if isinstance(value, Cause):
            return (texts.frames["then"] if form == "after" else "") + _sentence(
                value, replace(texts, texts=texts.past) if form == "past" else texts
            )
        if isinstance(value, tuple):
            joint = "then" if not form and any(isinstance(one, Cause) for one in value) else JOINS[form]
            return texts.frames[joint].join(_words(value, texts))
        if form == "nth":
            return texts.words[f"nth_{value}"]
        if form in JOINS:
            return texts.words.get(value, value) if form and isinstance(value, str) else str(value)
        return format(value, form)


def _words(values: tuple[object, ...], texts: Language) -> Iterator[str]:
    for value in values:
        if isinstance(value, Cause):
            yield _sentence(value, texts)
        else:
            yield texts.words.get(value, value) if isinstance(value, str) else str(value)
