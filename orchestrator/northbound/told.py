"""What a reader is told of the station, in the reader's language; the same for all who have seen the same."""

import json
from functools import cached_property
from typing import Any

from orchestrator import __version__
from orchestrator.model.cause import PARTS
from orchestrator.northbound.packed import piece
from orchestrator.northbound.picture import Change, Picture
from orchestrator.text.catalogue import LANGUAGES
from orchestrator.text.document import in_language, said

#: So many different texts of one revision are kept: readers that are up to date share one for each language.
MOST_TEXTS = 8
#: What the page needs to know of this program.
PAGE = {"version": __version__}


def encoded(value: object) -> str:
    """JSON in one line, which UTF-8 can hold. What no browser can read, such as NaN, is a ValueError here."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode(errors="backslashreplace").decode()  # half a surrogate pair, as the service writes it


def asked_language(value: str | None) -> str:
    """A language that we have texts in; "" means the service's own."""
    return value if value is not None and value in LANGUAGES else ""


class Told:
    """A change in words: JSON members, without the braces, so that a reader's own can be put beside them."""

    def __init__(self, change: Change, language: str) -> None:
        self.change = change
        self.members = encoded(fields(change, language))[1:-1]

    @cached_property
    def packed(self) -> bytes:
        """The same as a piece of a gzip stream, made once."""
        return piece(self.members)


class Teller:
    """Puts changes of the picture into words."""

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._revision = 0
        self._texts: dict[tuple[bool, int | None, str], Told] = {}

    def since(self, seen: int | None, language: str) -> Told:
        """What has changed since then."""
        picture = self._picture
        if picture.revision != self._revision:
            self._texts, self._revision = {}, picture.revision
        key = (picture.known, seen, language)
        if key not in self._texts:
            if len(self._texts) >= MOST_TEXTS:
                self._texts.clear()
            own = picture.language == language  # nothing to translate
            self._texts[key] = Told(picture.since(seen), "" if own else language)
        return self._texts[key]


def fields(change: Change, language: str) -> dict[str, Any]:
    """A change as JSON: a whole document has its bays in a list, what changed has them by name."""
    document = {**change.station, "bays": list(change.bays)}
    time = {} if change.time is None else {"time": change.time}
    if language:
        document = in_language(document, language)
        document["bays"] = [_causes(bay, language) for bay in document["bays"]]
    if change.whole:
        return {"revision": change.revision, "document": {**document, **time, "revision": change.revision}}
    told = {str(bay["name"]): bay for bay in document.pop("bays")}
    return {"revision": change.revision, "bays": told, "station": document, "gone": list(change.gone), **time}


def _causes(part: Any, language: str) -> Any:  # noqa: ANN401 - a part of the document
    """The part with the sentence of each cause in it in this language, too."""
    if isinstance(part, list):
        return [_causes(one, language) for one in part]
    if not isinstance(part, dict):
        return part
    told = {name: _causes(value, language) for name, value in part.items() if name != "params"}
    if "params" in part and "id" in part and "text" in part:
        cause = {name: value for name, value in part.items() if name in PARTS}
        return {**told, "params": part["params"], "text": said(cause, part["text"], language)}
    return {**part, **told}
