"""Entries of the second format, which had sentences where now are causes: each becomes a cause that says its sentence.

What comes in is hostile still: what is not decoded here is, or is refused, with the rest.
"""

from collections.abc import Mapping

from orchestrator.model.cause import SAID

#: Until there was the state HELD, a hold ended with what to do about it; the bay itself says that now.
OLD_END = "; start to go on"
#: The sentences that anything depends on.
KNOWN = {"stopped by the operator": "operator_stop", "reset by the operator": "operator_reset"}


def of_sentences(entry: Mapping[str, object]) -> dict[str, object]:
    """An entry as the third format has it."""
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
    """The cause of a sentence, in plain values; None for an empty one. ValueError for what is none."""
    if not isinstance(text, str):
        raise ValueError(f"{text!r:.80} is no sentence")
    if not text:
        return None
    what = text.removesuffix(OLD_END)
    return {"id": KNOWN[what]} if what in KNOWN else {"id": SAID, "params": {"text": what}}
