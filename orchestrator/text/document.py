"""The status document in a language other than the service's: every sentence is made again from its cause."""

from collections.abc import Mapping
from typing import Any

from orchestrator.model.cause import PARTS, from_plain
from orchestrator.text.catalogue import say


def in_language(document: Mapping[str, Any], language: str) -> dict[str, Any]:
    """The document in `language`; "" leaves it as it is.

    A sentence from a service of another version whose cause is not understood here stays as it was sent.
    """
    if not language:
        return dict(document)
    parts: dict[str, Any] = {
        name: _problem(document[name], language) for name in ("journal", "persisted") if name in document
    }
    if "strays" in document:
        parts["strays"] = [_problem(stray, language) for stray in document["strays"]]
    if "supplies" in document:
        parts["supplies"] = [_text(supply, supply["cause"], language) for supply in document["supplies"]]
    return {**document, **parts, "bays": [_bay(bay, language) for bay in document["bays"]]}


def language_of_answer(answer: Mapping[str, Any], own: str) -> str:
    """The language for an answer: the reader's own, else that of the service."""
    return own or str(answer.get("language", ""))


def refusals(answer: Mapping[str, Any], language: str) -> dict[str, str]:
    """A service's answer to a request, by bay: "" means yes, anything else why not."""
    results, causes = answer["results"], answer.get("causes", {})
    return {bay: said(causes.get(bay), text, language) for bay, text in results.items()}


def said(cause: object, text: str, language: str) -> str:
    """The sentence for a cause in plain values; `text` if there is no such cause, if it is unknown here, or for ""."""
    if not language:
        return text
    try:
        return say(from_plain(cause), language, text)
    except ValueError:
        return text


def _problem(part: Mapping[str, Any], language: str) -> dict[str, Any]:
    """A part that reports a problem, translated if the problem is there as data, too."""
    if not part.get("cause"):
        return dict(part)
    return {**part, "problem": said(part["cause"], part.get("problem", ""), language)}


def _bay(bay: Mapping[str, Any], language: str) -> dict[str, Any]:
    parts, told, why = ("charger", "battery", "contactor"), ("timed_start", "target"), ("identity", "supply")
    return {
        **bay,
        **{name: _problem(bay[name], language) for name in parts if bay.get(name)},
        "reason": said(bay.get("cause"), bay["reason"], language),
        "step_rule": said(bay.get("step_cause"), bay.get("step_rule", ""), language),
        "faults": [_fault(one, language) for one in bay["faults"]],
        **({"limits": [_text(one, one["cause"], language) for one in bay["limits"]]} if "limits" in bay else {}),
        **({"next": _text(bay["next"], bay["next"], language)} if bay.get("next") else {}),
        **{name: _text(bay[name], bay[name], language) for name in told if bay.get(name)},
        **{name: _text(bay[name], bay[name]["cause"], language) for name in why if name in bay},
    }


def _text(part: Mapping[str, Any], cause: Mapping[str, Any], language: str) -> dict[str, Any]:
    return {
        **part,
        "text": said({name: cause.get(name, "") for name in PARTS if name in cause}, part["text"], language),
    }


def _fault(fault: Mapping[str, Any], language: str) -> dict[str, Any]:
    told = {**fault, "text": said(fault.get("cause"), fault["text"], language)}
    if ends := fault.get("clears"):  # a service of an older version does not send it
        told["clears"] = {**ends, "text": said(ends, ends["text"], language)}
    return told
