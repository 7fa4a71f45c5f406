"""Converts entries of the second format, which had sentences instead of causes: each becomes a cause with that text.

The input is still untrusted: whatever is not decoded here is decoded, or refused, with the rest.
"""

from collections.abc import Mapping

from orchestrator.model.cause import SAID

#: Before the state HELD existed, a hold ended with what to do about it; the bay itself adds that now.
OLD_END = "; start to go on"
#: The sentences that other code depends on.
KNOWN = {"stopped by the operator": "operator_stop", "reset by the operator": "operator_reset"}


def of_sentences(entry: Mapping[str, object]) -> dict[str, object]:
    """The entry in the third format."""
    new = dict(entry)
    new["hold"] = said(entry.get("hold"))
    faults, session = entry.get("faults"), entry.get("session")
    if isinstance(faults, Mapping):
        new["faults"] = {name: _fault(fault) for name, fault in faults.items()}
    if isinstance(session, Mapping):
        new["session"] = {**session, "result": said(session.get("result", ""))}
    return new


def _fault(fault: object) -> object:
    if not isinstance(fault, Mapping) or "text" not in fault:
        return fault
    kept = {name: value for name, value in fault.items() if name != "text"}
    return {**kept, "cause": said(fault["text"])}


def said(text: object) -> dict[str, object] | None:
    """The cause for a sentence, as plain values; None for an empty one. ValueError if it is not a text."""
    if not isinstance(text, str):
        raise ValueError(f"{text!r:.80} is no sentence")
    if not text:
        return None
    what = text.removesuffix(OLD_END)
    return {"id": KNOWN[what]} if what in KNOWN else {"id": SAID, "params": {"text": what}}
