"""One charge as a page of text. Pure."""

from collections.abc import Iterator
from typing import Any

from orchestrator.columns import folded
from orchestrator.model import Cause
from orchestrator.record.lines import Record
from orchestrator.record.stamp import from_fields
from orchestrator.record.table import began, ended, lasted, length_s, sentence, values, why_ended
from orchestrator.text.catalogue import say

#: How it is said where a battery's id is from.
SOURCES = {"assumed": "battery_assumed", "typed": "battery_typed", "serial_number": "battery_serial_number"}
#: A pause that lasts.
DASH = "…"


def shown(charge: Record, language: str, width: int) -> str:
    """All of it, for people."""
    lines = [folded(say(cause, language), width) for cause in _head(charge, language)]
    parts = ["\n".join(lines), values(charge)]
    for id_, found in (("charge_rules", _rules), ("charge_pauses", _pauses), ("charge_faults", _faults)):
        if listed := [folded(f"  {line}", width) for line in found(charge, language)]:
            parts.append("\n".join([say(Cause(id_), language), *listed]))
    return "\n\n".join(parts)


def _head(charge: Record, language: str) -> Iterator[Cause]:
    battery, policy, by = charge["battery"], charge["policy"], charge.get("by")
    yield Cause.of("charge_of", id=charge["id"], bay=charge["bay"], station=charge["station"])
    yield Cause.of(SOURCES[battery["source"]], battery=battery["id"])
    yield Cause.of("charge_time", begin_at=began(charge), end_at=ended(charge), lasted=lasted(length_s(charge)))
    yield Cause.of("charge_ended", why=why_ended(charge, language))
    yield Cause.of("charge_took", **charge["charger"], bmu_ah=charge["bmu"]["ah"], bmu_wh=charge["bmu"]["wh"])
    yield Cause.of("charge_policy", policy=policy["name"], sha256=policy["sha256"], software=charge["software"])
    if by:
        yield Cause.of("charge_by", by=sentence(by, language))
    if charge.get("stop_verified_ms") is not None:
        yield Cause.of("charge_stop", took_ms=charge["stop_verified_ms"])


def _rules(charge: Record, language: str) -> Iterator[str]:
    for rule in charge["rules"]:
        what: dict[str, Any] = {"lasted": lasted(rule["s"]), "ah": rule["ah"]}
        if rule["key"]:
            yield say(Cause.of("charge_rule", rule=rule["key"], at_line=rule["place"], **what), language)
        else:
            yield say(Cause.of("charge_no_rule", **what), language)


def _pauses(charge: Record, language: str) -> Iterator[str]:
    for pause in charge["pauses"]:
        length = DASH if pause["lasted_s"] is None else lasted(pause["lasted_s"])
        yield f"{from_fields(pause).local()}, {length}: {sentence(pause['cause'], language)}"


def _faults(charge: Record, language: str) -> Iterator[str]:
    for fault in charge["faults"]:
        times = f" (×{fault['times']})" if fault["times"] > 1 else ""
        yield f"{fault['effect']}{times}: {sentence(fault['cause'], language)}"
