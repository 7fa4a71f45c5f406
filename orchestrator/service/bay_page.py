"""A page about one bay, made from the status document and from the newest events of its journal.

A line that an older service does not tell of is left out.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from typing import cast

from orchestrator.columns import folded, width_of
from orchestrator.model import Cause
from orchestrator.model.cause import from_plain, without_then
from orchestrator.page import Block, all_cut, loud
from orchestrator.record.lasting import lasting, session_figures
from orchestrator.service.wallclock import WallClock
from orchestrator.show import (
    Bay,
    below,
    figure,
    level_of,
    other_faults,
    step_of,
)
from orchestrator.text.catalogue import say
from orchestrator.text.document import in_language, language_of_answer

#: The battery's figures on the page.
BATTERY = {"soc_pct": "SOC {:.0f} %", "soh_pct": "SOH {:.0f} %", "voltage_v": "{:.2f} V", "current_a": "{:.2f} A",
           "temperature_c": "{:.1f} °C"}  # fmt: skip
CHARGER = {"voltage_v": "{:.1f} V", "current_a": "{:.2f} A"}

Line = tuple[str, str, str]  #: the id of its label, a column of its own, and what stands behind them


def bay_blocks(
    document: Mapping[str, object], events: Sequence[tuple[str, str]], language: str, width: int, now_s: float
) -> list[Block]:
    """The page of the document's only bay, `now_s` in Unix time; `events` are times and sentences."""
    language = language_of_answer(document, language)
    document = in_language(document, language)
    (bay,) = cast("Sequence[Bay]", document["bays"])
    clock, level = WallClock(now_s, now_s), level_of(bay)
    head = f"{bay['name']} · {clock.time_of_day(now_s)}"
    found = [Block(folded(head, width)), *loud(document, [bay], language, width)]
    lines = [*_lines(bay, clock, language), *(("page_events", *one) for one in events)]
    margin = max(width_of(say(Cause(label), language)) for label, *_ in lines) + 2
    before = ""
    for label, column, text in lines:
        name = "" if label == before else say(Cause(label), language)
        before = label
        begin = name + " " * (margin - width_of(name)) + (f"{column}  " if column else "")
        found.append(Block(folded(text, width, begin), level if label == "page_state" else ""))
    return all_cut(found, width)


def _lines(bay: Bay, clock: WallClock, language: str) -> Iterator[Line]:
    yield "page_state", "", _state(bay, clock, language)
    yield "page_why", "", why(bay, language)
    yield from (("page_faults", "", f"{one['effect']}: {one['text']}") for one in other_faults(bay))
    yield from _next(bay, clock, language)
    yield from _limits(bay, language)
    yield from _session(bay, language)
    yield from _forecast(bay, clock, language)
    yield from _devices(bay, language)
    yield from _policy(bay, clock, language)


def _state(bay: Bay, clock: WallClock, language: str) -> str:
    since_s = bay.get("since")
    if not isinstance(since_s, int | float):
        return str(bay["state"])
    since = clock.time_of_day(since_s)
    return say(
        Cause.of("page_since", state=bay["state"], begun_at=since, lasted=lasting(clock.wall_s - since_s)), language
    )


def why(bay: Bay, language: str) -> str:
    """The reason without what comes next, which has a line of its own."""
    try:
        return say(without_then(from_plain(bay.get("cause"))), language, str(bay["reason"]))
    except ValueError:
        return str(bay["reason"])


def _next(bay: Bay, clock: WallClock, language: str) -> Iterator[Line]:
    coming = cast("Mapping[str, object]", bay.get("next") or {})
    if not coming.get("text"):
        return
    at_s, text = coming.get("at"), str(coming["text"])
    if isinstance(at_s, int | float) and (end_at := clock.time_of_day(at_s)).removesuffix(":00") not in text:
        text = say(Cause.of("next_at", what=text, end_at=end_at), language)
    if not coming.get("by_itself"):
        text = say(Cause.of("next_person", what=text), language)
    yield "page_next", "", text


def _limits(bay: Bay, language: str) -> Iterator[Line]:
    limits = cast("Sequence[Mapping[str, object]]", bay.get("limits") or ())
    amps = [figure(one.get("allowed_a"), "{:.1f} A") for one in limits]
    most = max(map(width_of, amps), default=0)
    for one, allowed in zip(limits, amps, strict=True):
        text = str(one["text"])
        if one.get("binds"):
            text = say(Cause.of("limit_binds", rule=text), language)
        yield "page_limits", f"{allowed:>{most}}", text


def _session(bay: Bay, language: str) -> Iterator[Line]:
    if session := cast("Mapping[str, object]", bay.get("session") or {}):
        yield "page_session", "", say(session_figures(session), language)


def _forecast(bay: Bay, clock: WallClock, language: str) -> Iterator[Line]:
    known = cast("Mapping[str, object]", bay.get("forecast") or {})
    if not known:
        return
    to_full = Cause("forecast_full")
    goal = to_full if known["goes_full"] else Cause.of(
        "forecast_target", place=str(known["place"]), target_pct=known["target_soc_pct"]
    )  # fmt: skip
    told = []
    for id_, minutes, end_s in (
        ("forecast_bmu", known["bmu_min"], known["bmu_at"]),
        ("forecast_own", known["own_min"], known["own_at"]),
    ):
        if isinstance(minutes, int | float) and isinstance(end_s, int | float):
            end_at = clock.time_of_day(end_s, coming=True)
            told.append(say(Cause.of(id_, lasts=lasting(60 * minutes), end_at=end_at), language))
    yield "page_forecast", "", f"{say(goal, language)}: {'; '.join(told) or say(Cause('forecast_none'), language)}"


def _devices(bay: Bay, language: str) -> Iterator[Line]:
    battery, charger = (cast("Mapping[str, object]", bay[part]) for part in ("battery", "charger"))
    bmu = cast("Mapping[str, object]", bay.get("bmu") or {})
    old = cast("Sequence[str]", battery.get("old", ()))
    if identity := cast("Mapping[str, object]", bay.get("identity") or {}):
        yield "page_battery", "", str(identity["text"])
    shown = list(_figures(battery, BATTERY, old, language))
    if bmu:
        shown.append(say(Cause.of("battery_on", can=bmu["can"], node_id=bmu["node_id"]), language))
    yield "page_battery", "", ", ".join(shown) or "–"
    shown = list(_figures(charger, CHARGER, tuple(CHARGER) if charger.get("old") else (), language))
    if bay["step"] is not None:
        shown.append(say(Cause.of("page_step", step=step_of(bay["step"], bay.get("step_current_a"))), language))
    yield "page_charger", "", ", ".join([*shown, *([str(bay["port"])] if bay.get("port") else [])]) or "–"
    coming = cast("Mapping[str, object]", bay.get("next") or {}).get("text")
    notes = below({**bay, "faults": []}, language)  # as below its line in the table
    yield from (("page_notes", "", text) for text in notes if text != coming)


def _figures(part: Mapping[str, object], forms: Mapping[str, str], old: Container[str], language: str) -> Iterator[str]:
    """Each value that is known; what was not heard lately is marked."""
    for name, form in forms.items():
        if part.get(name) is not None:
            text = figure(part[name], form)
            yield say(Cause.of("old_figure", figure=text), language) if name in old else text


def _policy(bay: Bay, clock: WallClock, language: str) -> Iterator[Line]:
    policy = cast("Mapping[str, object]", bay.get("policy") or {})
    if not policy:
        return
    named = Cause.of("policy_line", policy=policy["name"], file=policy["file"], sha256=policy["sha256"])
    since_s = policy.get("since")
    if isinstance(since_s, int | float):
        named = Cause.of("policy_since", policy=named, begun_at=clock.time_of_day(since_s))
    yield "page_policy", "", say(named, language)
