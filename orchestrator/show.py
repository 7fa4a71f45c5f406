"""What the status says of a bay: its line in the table, its details, what to do about it, and how urgently."""

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import cast

from orchestrator.model import Cause
from orchestrator.text.catalogue import say
from orchestrator.text.language import language_of

#: The battery's values in the table, with their ids in the catalogue.
BATTERY = {"soc_pct": "soc", "voltage_v": "pack_voltage", "temperature_c": "temperature"}
#: The causes whose text begins with what to do about a disobedient charger.
CUT_THE_MAINS = frozenset({
    "uncontrollable", "uncontrollable_unproved", "uncontrollable_contradicted", "uncontrollable_stands_by",
    "failed_uncontrollable",
})  # fmt: skip
#: States in which an obedient charger is in standby.
RESTING = frozenset({"IDLE", "HELD", "FULL", "SUSPENDED", "TRIPPED"})
#: The levels of `alarm` that need a person, worst first.
LEVELS = ("danger", "attention")
#: The most current that standby may show, at the charger and at the BMU.
STANDBY_A, BMU_A = 0.5, 1.0
#: Values whose ages differ by no more than this are of one moment.
SWEEP_S = 2.0

Bay = Mapping[str, object]


def own_language() -> str:
    """The language of this terminal's user; "" if unset. Where Korean cannot be shown, English."""
    try:
        "가".encode(sys.stdout.encoding or "utf-8")
    except UnicodeError:
        return "en"
    return language_of(os.environ)


def strays(document: Mapping[str, object], language: str = "") -> list[str]:
    """What to do about chargers that belong to no bay any more and are not verified in standby."""
    found = cast("Sequence[Mapping[str, object]]", document.get("strays", ()))
    causes = [
        Cause.of("cut_mains_of_stray", port=one["port"], bay=one["bay"], why=one["problem"] or one["state"])
        for one in found
        if not one["verified"]
    ]
    return [say(cause, language) for cause in causes]


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
    return level_of(bay) == "danger"


def level_of(bay: Bay) -> str:
    """How urgently the bay needs a person: one of `LEVELS`, or "" if it needs nobody.

    A service not restarted since an update may still report true for danger.
    """
    level = bay.get("alarm")
    if level is True or bay["state"] == "UNCONTROLLABLE":
        return "danger"
    return str(level) if level in LEVELS else ""


def urgency(bay: Bay) -> tuple[bool, int]:
    """The key by which bays are sorted: those that need a person first, the worst before all."""
    level = level_of(bay)
    return bay["state"] != "UNCONTROLLABLE", LEVELS.index(level) if level else len(LEVELS)


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


def below(bay: Bay, language: str) -> Iterator[str]:
    """Its further details: other faults, what a person has asked for, what is old, a policy that waits."""
    yield from (f"{fault['effect']}: {fault['text']}" for fault in other_faults(bay))
    asked = (cast("Mapping[str, object]", bay.get(name) or {}) for name in ("target", "timed_start"))
    yield from (str(one["text"]) for one in asked if one)
    if old := "; ".join(say(one, language) for one in _old_values(bay)):
        yield labelled("old", old, language)
    if cast("Mapping[str, object]", bay.get("policy", {})).get("waiting_sha256"):
        yield labelled("policy_note", say(Cause("policy_waits"), language), language)


def labelled(id_: str, what: str, language: str) -> str:
    """Behind one of the table's labels."""
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


def head(language: str) -> tuple[str, ...]:
    """The head of the table, as the catalogue has it in one text."""
    return tuple(say(Cause("bays_head"), language).split("|"))


def row(bay: Bay, language: str) -> tuple[str, ...]:
    """Its cells in the table, below `head`."""
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
