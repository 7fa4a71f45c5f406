"""Whether the bays that a person has started do charge; if not, why, and what to type."""

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.text.catalogue import say
from orchestrator.text.document import in_language

#: A bay at rest decides twice a second; the second decision after a start shows where it leads.
DECIDED_S, LOOK_S = 1.3, 0.1
#: The states on the way to a charge.
AT_WORK = frozenset({"QUALIFYING", "PRECHARGE_PULSE", "PRECHARGE_CONTINUOUS", "CHARGING"})
FULL_PCT = 100.0
#: Why a battery wants no charge → what that means for who starts it all the same.
WANTS_NONE = {"soc_not_below": "nothing_to_do", "charged_again": "nothing_to_do_full"}


def not_charging(path: Path, names: Sequence[str], language: str) -> list[str]:
    """A line for each of these bays that does not charge. A service that does not answer now is not asked again."""
    end_s, resting = time.monotonic() + DECIDED_S, list[Mapping[str, object]]()
    while names:
        try:
            document = in_language(ask(path, {"verb": "status"}), language)
        except ServiceError:
            return []
        found = cast("Sequence[Mapping[str, object]]", document["bays"])
        resting = [bay for bay in found if bay["name"] in names and bay["state"] not in AT_WORK]
        if not resting or time.monotonic() >= end_s:
            break
        time.sleep(LOOK_S)
    return [say(_told(bay), language) for bay in resting]


def _told(bay: Mapping[str, object]) -> Cause:
    cause = Cause.of("does_not_charge", bay=bay["name"], state=bay["state"], reason=bay["reason"])
    return with_hint(cause, bay.get("cause"))


def with_hint(cause: Cause, why: object) -> Cause:
    """The cause with what to type, where `why`, a cause in plain values, shows that the battery wants no charge."""
    found = next((one for one in _all(why) if one.get("id") in WANTS_NONE), None)
    params = found.get("params") if found is not None else None
    if found is None or not isinstance(params, Mapping):
        return cause
    below = (params.get("soc_pct") or 0.0) < FULL_PCT
    once = Cause.of("charge_once", bay=cause.param("bay") or "BAY") if below else None
    return cause.with_(then=Cause.of(WANTS_NONE[found["id"]], threshold_pct=params.get("threshold_pct"), once=once))


def _all(cause: object) -> Iterator[Mapping[str, Any]]:
    """The causes in a cause of the document: itself, then those in its parameters."""
    if isinstance(cause, Mapping):
        yield cause
        params = cause.get("params")
        yield from (one for value in (params.values() if isinstance(params, Mapping) else ()) for one in _all(value))
    elif isinstance(cause, list):
        yield from (one for value in cause for one in _all(value))
