"""One charge in sections: as a page of text, or for the web. Pure."""

from collections.abc import Iterator
from typing import Any

from orchestrator.model import Cause
from orchestrator.model.cause import said
from orchestrator.record.lasting import lasting
from orchestrator.record.lines import Record
from orchestrator.record.sections import Section
from orchestrator.record.stamp import from_fields
from orchestrator.record.table import began, ended, length_s, sentence, value_rows, why_ended
from orchestrator.text.catalogue import say

#: How it is said where a battery's id is from.
SOURCES = {"assumed": "battery_assumed", "typed": "battery_typed", "serial_number": "battery_serial_number"}
#: A pause that lasts.
DASH = "…"


def sections(charge: Record, language: str) -> list[Section]:
    """All of it, for people; ValueError for a record that is damaged."""
    try:
        return [
            Section("", [(say(cause, language),) for cause in _head(charge, language)]),
            Section("", value_rows(charge, language), has_head=True),
            *(
                Section(say(Cause(id_), language), [(line,) for line in found(charge, language)])
                for id_, found in PARTS
            ),
        ]
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise ValueError(f"a damaged record: {error!r}") from None


def title(charge: Record, language: str) -> str:
    """Which charge it is."""
    return say(Cause.of("charge_of", id=charge["id"], bay=charge["bay"], station=charge["station"]), language)


def battery(battery: Record) -> Cause:
    """Which battery it was, and how that is known."""
    return Cause.of(SOURCES.get(battery["source"], "battery_otherwise"), battery=battery["id"])


def _head(charge: Record, language: str) -> Iterator[Cause]:
    policy, by = charge["policy"], charge.get("by")
    yield Cause.of("charge_of", id=charge["id"], bay=charge["bay"], station=charge["station"])
    yield battery(charge["battery"])
    yield Cause.of("charge_time", begin_at=began(charge), end_at=ended(charge), lasted=lasting(length_s(charge)))
    why = why_ended(charge, language)
    yield Cause.of("charge_ended", why=why) if charge.get("result") else said(why)
    yield Cause.of("charge_took", **charge["charger"], bmu_ah=charge["bmu"]["ah"], bmu_wh=charge["bmu"]["wh"])
    yield Cause.of("charge_policy", policy=policy["name"], sha256=policy["sha256"], software=charge["software"])
    for change in charge.get("changes", ()):
        named = {name: change[name] for name in ("policy", "sha256", "software")}
        yield Cause.of("charge_policy_since", begin_at=from_fields(change).local(), **named)
    if by:
        yield Cause.of("charge_by", by=sentence(by, language))
    if charge.get("stop_verified_ms") is not None:
        yield Cause.of("charge_stop", took_ms=charge["stop_verified_ms"])
    if foreseen := charge.get("forecast"):
        yield _forecast(foreseen)


def _forecast(foreseen: Record) -> Cause:
    """What was foreseen of it, and what came of that."""
    own, bmu, took = (
        Cause.of(id_, lasts=lasting(60 * minutes)) if (minutes := foreseen.get(name)) is not None else None
        for id_, name in (("foreseen_own", "own_min"), ("foreseen_bmu", "bmu_min"), ("foreseen_took", "took_min"))
    )
    by, begin = tuple(filter(None, (own, bmu))), lasting(foreseen["elapsed_s"])
    return Cause.of("charge_forecast", begin=begin, target_pct=foreseen["target_pct"], by=by, took=took)


def _rules(charge: Record, language: str) -> Iterator[str]:
    for rule in charge["rules"]:
        what: dict[str, Any] = {"lasted": lasting(rule["s"]), "ah": rule["ah"]}
        if rule["key"]:
            yield say(Cause.of("charge_rule", rule=rule["key"], at_line=rule["place"], **what), language)
        else:
            yield say(Cause.of("charge_no_rule", **what), language)


def _steps(charge: Record, language: str) -> Iterator[str]:
    for one in charge.get("steps", ()):
        what: dict[str, Any] = {"lasted": lasting(one["s"]), "ah": one["ah"]}
        if one["step"]:
            yield say(Cause.of("charge_step", number=one["step"], step_a=one["current_a"], **what), language)
        else:
            yield say(Cause.of("charge_no_step", **what), language)


def _pauses(charge: Record, language: str) -> Iterator[str]:
    for pause in charge["pauses"]:
        length = DASH if pause["lasted_s"] is None else say(lasting(pause["lasted_s"]), language)
        yield f"{from_fields(pause).local()}, {length}: {sentence(pause['cause'], language)}"


def _faults(charge: Record, language: str) -> Iterator[str]:
    for fault in charge["faults"]:
        times = f" (×{fault['times']})" if fault["times"] > 1 else ""
        yield f"{fault['effect']}{times}: {sentence(fault['cause'], language)}"


#: The sections below the values.
PARTS = (
    ("charge_rules", _rules), ("charge_steps", _steps), ("charge_pauses", _pauses), ("charge_faults", _faults),
)  # fmt: skip
