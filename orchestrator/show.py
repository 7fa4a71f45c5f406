"""The status document as text for a terminal: first what to do, then one line per bay, and why."""

import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import cast

from orchestrator.columns import beside, folded, width_of
from orchestrator.model import Cause
from orchestrator.text.catalogue import say
from orchestrator.text.document import in_language, language_of_answer
from orchestrator.text.language import language_of

HEAD = ("BAY", "STATE", "SOC", "PACK", "CURRENT", "TEMP", "STEP", "WHY")
#: The battery's values in the table, with their ids in the catalogue.
BATTERY = {"soc_pct": "soc", "voltage_v": "pack_voltage", "temperature_c": "temperature"}
#: The causes whose text begins with what to do about a disobedient charger.
CUT_THE_MAINS = frozenset({
    "uncontrollable", "uncontrollable_unproved", "uncontrollable_contradicted", "uncontrollable_stands_by",
    "failed_uncontrollable",
})  # fmt: skip
#: States in which an obedient charger is in standby.
RESTING = frozenset({"IDLE", "HELD", "FULL", "SUSPENDED", "TRIPPED"})
#: The levels of `alarm`, worst first; the table sorts bays by them, all others last.
LEVELS = ("danger", "attention")
#: In a narrower column nobody reads why: it goes below its bay.
LEAST_WHY = 40
#: The most current that standby may show, at the charger and at the BMU.
STANDBY_A, BMU_A = 0.5, 1.0
#: Values whose ages differ by no more than this are of one moment.
SWEEP_S = 2.0

Bay = Mapping[str, object]


def own_language() -> str:
    """The language of this terminal's user; "" if unset."""
    return language_of(os.environ)


def page(document: Mapping[str, object], language: str = "", width: int = 0) -> str:
    """The whole status: what to do, the bays, and what is wrong with the station itself.

    Its lines are folded to `width` columns; 0 leaves each as long as it is.
    """
    language = language_of_answer(document, language)
    document = in_language(document, language)
    lines = [folded(_labelled("alarm", text, language), width) for text in strays(document, language)]
    lines.append(table(cast("Sequence[Bay]", document["bays"]), language, width))
    problems = (
        cast("Mapping[str, object]", document.get(part, {})).get("problem") for part in ("journal", "persisted")
    )
    return "\n".join([*lines, *(_labelled("warning", str(problem), language) for problem in problems if problem)])


def strays(document: Mapping[str, object], language: str = "") -> list[str]:
    """What to do about chargers that belong to no bay any more and are not verified in standby."""
    found = cast("Sequence[Mapping[str, object]]", document.get("strays", ()))
    causes = [
        Cause.of("cut_mains_of_stray", port=one["port"], bay=one["bay"], why=one["problem"] or one["state"])
        for one in found
        if not one["verified"]
    ]
    return [say(cause, language) for cause in causes]


def table(bays: Sequence[Bay], language: str = "", width: int = 0) -> str:
    """All bays, aligned, those that need a person first; below each bay its further details."""
    bays = sorted(bays, key=lambda bay: (bay["state"] != "UNCONTROLLABLE", _level(bay)))
    rows = [HEAD, *(_row(bay, language) for bay in bays)]
    widths = [max(width_of(row[column]) for row in rows) for column in range(len(HEAD) - 1)]
    lines = [folded(_labelled("alarm", what_to_do(bay, language), language), width) for bay in bays if is_alarming(bay)]
    for row, bay in zip(rows, [None, *bays], strict=True):
        cells = beside(row[:-1], widths, width)
        narrow = width and width - width_of(cells) < LEAST_WHY
        lines.append(cells.rstrip() if narrow else folded(row[-1], width, cells).rstrip())
        if bay is not None:
            below = [row[-1], *_below(bay, language)] if narrow else _below(bay, language)
            lines.extend(folded(f"  {line}", width) for line in below)
    return "\n".join(lines)


def other_faults(bay: Bay) -> list[Mapping[str, object]]:
    """The faults that the reason does not tell already, as its cause or as the state."""
    faults, told = cast("list[Mapping[str, object]]", bay["faults"]), set(_told(bay.get("cause")))
    said = {"will_not_stop"} if bay["state"] == "UNCONTROLLABLE" else set()
    return [one for one in faults if one["id"] not in said and told.isdisjoint(islice(_told(one.get("cause")), 1))]


def _told(cause: object) -> Iterator[tuple[object, ...]]:
    """The causes contained in a cause of the document: itself, then those in its parameters."""
    if isinstance(cause, Mapping):
        yield cause.get("id"), cause.get("key"), cause.get("advice")
        params = cause.get("params")
        yield from (one for value in (params.values() if isinstance(params, Mapping) else ()) for one in _told(value))
    elif isinstance(cause, list):
        yield from (one for value in cause for one in _told(value))


def is_alarming(bay: Bay) -> bool:
    """Whether a charger may be running out of control."""
    return _level(bay) == 0 or bay["state"] == "UNCONTROLLABLE"


def _level(bay: Bay) -> int:
    """The bay's index in `LEVELS`. A service not restarted since an update may still report true for danger."""
    level = "danger" if bay.get("alarm") is True else bay.get("alarm")
    return LEVELS.index(level) if level in LEVELS else len(LEVELS)


def stands_by(bay: Bay) -> bool:
    """Whether the charger is verified as stopped: by its own fresh reading, and by the BMU's if there is one."""
    charger, battery = _part(bay, "charger"), _part(bay, "battery")
    command = cast("Mapping[str, Mapping[str, object]]", bay["command"])
    amps, pack_a = charger["current_a"], battery["current_a"]
    sees = isinstance(pack_a, int | float) and "current_a" not in _old(bay)
    return (
        bay["state"] in RESTING
        and not is_alarming(bay)
        and command["order"]["action"] is None
        and charger["online"] is True
        and not charger.get("old")
        and charger["operation"] == 0
        and isinstance(amps, int | float)
        and amps <= STANDBY_A
        and not (sees and cast("float", pack_a) > BMU_A)
    )


def what_to_do(bay: Bay, language: str = "") -> str:
    """For a charger not verified in standby: first what to do, then why."""
    if next(_told(bay.get("cause")), ("",))[0] in CUT_THE_MAINS:
        return f"{bay['name']}: {bay['reason']}"
    dangerous = is_alarming(bay) or bay["state"] not in RESTING | {"OFFLINE"}
    id_, port = "cut_mains_of" if dangerous else "look_at", bay.get("port") or Cause("port_unknown")
    return say(Cause.of(id_, bay=bay["name"], port=port, state=bay["state"], reason=bay["reason"]), language)


def _below(bay: Bay, language: str) -> Iterator[str]:
    yield from (f"{fault['effect']}: {fault['text']}" for fault in other_faults(bay))
    if old := "; ".join(say(one, language) for one in _old_values(bay)):
        yield _labelled("old", old, language)
    if cast("Mapping[str, object]", bay.get("policy", {})).get("waiting_sha256"):
        yield _labelled("policy_note", say(Cause("policy_waits"), language), language)


def _labelled(id_: str, what: str, language: str) -> str:
    return say(Cause.of(id_, what=what), language)


def _old_values(bay: Bay) -> Iterator[Cause]:
    """Values shown although they may be outdated, with their age and any fresher evidence."""
    charger, battery = _part(bay, "charger"), _part(bay, "battery")
    if charger.get("old"):
        fresh = battery.get("current_a") is not None and "current_a" not in _old(bay)
        bmu = Cause.of("bmu_sees", pack_a=battery["current_a"]) if fresh else None
        yield Cause.of("old_charger", charger_a=charger["current_a"], age=_age(charger["age_s"]), bmu=bmu)
    ages_s = cast("Mapping[str, object]", battery.get("age_s", {}))
    old = [name for name in BATTERY if name in _old(bay)]
    while old:  # values of the same moment have one age
        first_s = ages_s.get(old[0])
        alike = [name for name in old if _alike(ages_s.get(name), first_s)]
        yield Cause.of("old_values", names=tuple(BATTERY[name] for name in alike), age=_age(first_s))
        old = [name for name in old if name not in alike]


def _old(bay: Bay) -> Sequence[str]:
    return cast("Sequence[str]", _part(bay, "battery").get("old", ()))


def _part(bay: Bay, name: str) -> Mapping[str, object]:
    return cast("Mapping[str, object]", bay[name])


def _row(bay: Bay, language: str) -> tuple[str, ...]:
    battery, charger = _part(bay, "battery"), _part(bay, "charger")
    old, step = _old(bay), bay["step"]
    return (
        str(bay["name"]),
        str(bay["state"]),
        _marked(figure(battery["soc_pct"], "{:.0f} %"), language, old="soc_pct" in old),
        _marked(figure(battery["voltage_v"], "{:.2f} V"), language, old="voltage_v" in old),
        _marked(figure(charger["current_a"], "{:.2f} A"), language, old=bool(charger.get("old"))),
        _marked(figure(battery["temperature_c"], "{:.1f} °C"), language, old="temperature_c" in old),
        step_of(step, bay.get("step_current_a")),
        say(Cause("see_alarm"), language) if is_alarming(bay) else str(bay["reason"]),
    )


def step_of(index: object, current_a: object) -> str:
    """A current step as people count it, 1 (lowest) … 5, with its amperes; the protocol counts from 0."""
    return f"{index + 1} ({figure(current_a, '{:.1f} A')})" if isinstance(index, int) else "–"


def _marked(text: str, language: str, *, old: bool) -> str:
    return say(Cause.of("old_figure", figure=text), language) if old else text


def figure(value: object, form: str) -> str:
    """A number with its unit; a dash if there is none."""
    return form.format(value) if isinstance(value, int | float) else "–"


def _alike(one_s: object, other_s: object) -> bool:
    """Whether two values are equally old: all are read within a second, but not at once."""
    if isinstance(one_s, int | float) and isinstance(other_s, int | float):
        return abs(one_s - other_s) <= SWEEP_S
    return one_s == other_s


def _age(age_s: object) -> Cause | str:
    """An age in the unit that a person would use."""
    if not isinstance(age_s, int | float):
        return "long"
    for id_, seconds in (("age_h", 3600), ("age_min", 60)):
        if age_s >= 2 * seconds:
            return Cause.of(id_, age=age_s / seconds)
    return Cause.of("age_s", age=age_s)
