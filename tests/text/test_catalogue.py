"""Every id says the same in both languages, and no text can fail to format."""

import re
from collections.abc import Iterator
from string import Formatter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.core.faults import FAULTS
from orchestrator.model import Cause, Effect
from orchestrator.model.cause import SEVERAL, from_plain, plain, together
from orchestrator.show import CUT_THE_MAINS
from orchestrator.text.catalogue import LANGUAGES, advise, fields, say
from orchestrator.text.document import in_language, refusals
from orchestrator.text.language import language_of

#: A word of a sentence, and what is the same in every language.
WORD, NAMES = re.compile("[a-z]{3}"), ("orchestrator start", "baud", "(pid )")
EN, KO = LANGUAGES["en"], LANGUAGES["ko"]
HOT = Cause.of("over_temperature", key="pack.temperature_c", place="p.yaml:3", pack_c=45.23, limit_c=45, again_c=40.0)


def params(template: str) -> Iterator[tuple[str, str]]:
    """A template's parameters and their formats; for a word or a list only its kind."""
    for _, name, form, _ in Formatter().parse(template):
        if name is not None:
            yield name, "" if form in ("word", "and", "then", "nth", "past") else form or ""


@pytest.mark.parametrize("part", ["texts", "advice", "words", "frames"])
def test_each_id_is_in_both_languages_with_the_same_parameters(part: str) -> None:
    english, korean = getattr(EN, part), getattr(KO, part)
    assert english.keys() == korean.keys()
    for id_ in english:
        assert set(params(english[id_])) == set(params(korean[id_])), id_


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_row_of_the_fault_table_says_what_to_do(language: str) -> None:
    assert {row.id for row in FAULTS} <= LANGUAGES[language].advice.keys()
    for row in FAULTS:
        assert advise(row.id, language)


def test_korean_is_korean() -> None:
    for texts in (KO.texts, KO.advice):
        for id_, text in texts.items():
            bare = "".join(literal for literal, *_ in Formatter().parse(text)).strip(" ,.:'")
            figure = id_.startswith("figure_")  # a number with its unit
            korean = any("가" <= one <= "힣" for one in bare)
            assert figure or korean or not WORD.search(bare) or bare in NAMES, id_
    assert say(HOT, "ko") == ("팩 온도가 45.2 °C이고 상한은 45 °C입니다(p.yaml:3). 40 °C 아래에서 다시 충전합니다")


def test_what_is_out_of_control_begins_with_the_mains() -> None:
    begins = {id_ for id_, text in EN.texts.items() if text.startswith("CUT THE MAINS")}
    assert begins == CUT_THE_MAINS | {"cut_mains_of", "cut_mains_of_stray"}


def test_what_to_do_goes_first_where_a_person_must_act() -> None:
    seen = "the pack has 45.2 °C, the limit is 45 °C (p.yaml:3); it charges again below 40 °C"
    do = "let it cool down"
    assert say(HOT) == seen
    assert say(HOT.with_("over_temperature", effect="PAUSE")) == f"{seen}; {do}"
    assert say(HOT.with_("over_temperature", effect="TRIP")) == f"{do} – {seen}"
    latched = f"{do}; it came 4 times within an hour: reset by a person – {seen}"
    assert say(HOT.with_("over_temperature", effect="TRIP", strikes=4)) == latched


def test_what_a_parameter_can_be() -> None:
    assert say(Cause.of("stale_reading", missing=("soc", "soh"))) == "no fresh SOC, SOH from the BMU"
    assert say(Cause.of("stale_reading", missing=("soc", "soh")), "ko") == "BMU의 최신 값이 없습니다: SOC, SOH"
    assert say(Cause.of("rejected_frame", wrong=("command", "order"))).endswith(
        "wrong command and order in what it received"
    )
    volts = Cause.of(
        "volts_disagree", charger_v=48.0, pack_v=41.5, wrong=Cause.of("bmu_likelier_wrong", by=Cause("by_soc"))
    )
    assert say(volts).endswith("or a bad connection; the BMU is likelier wrong, by the pack's SOC")
    assert say(Cause.of("volts_disagree", charger_v=48.0, pack_v=None, wrong=None)).endswith(
        "48.00 V, the BMU – V: not the same battery, or a bad connection"
    )
    assert say(Cause.of(SEVERAL, whats=(Cause("loose_plug"), Cause("found_running")))) == (
        "the battery left in mid-charge and was back at once; the charger was found running though it was not "
        "commanded to"
    )
    assert say(None) == ""


@pytest.mark.parametrize(
    ("cause", "text"),
    [
        (
            Cause.of("of_tomorrow", key="a.b", place="p:1", what=Cause("x"), n=1),
            "of_tomorrow (what=x, n=1, key=a.b, place=p:1)",
        ),
        (Cause("late"), "late ()"),
        (Cause.of("late", late_s="soon"), "late (late_s=soon)"),
        (Cause.of("late", late_s=10**400), f"late (late_s={10**400})"),
        (Cause("loose_plug", advice="of_tomorrow"), "loose_plug ()"),
    ],
    ids=["unknown", "lacks a parameter", "no number", "too large", "unknown advice"],
)
def test_what_is_not_understood_is_shown_as_its_data(cause: Cause, text: str) -> None:
    assert say(cause) == text
    assert say(cause, "tlh") == text


VALUES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9) | st.tuples(st.text(max_size=3))
CAUSES = st.recursive(
    st.builds(Cause, st.sampled_from([*EN.texts]) | st.text(max_size=5)),
    lambda inner: st.builds(
        Cause,
        st.sampled_from([*EN.texts]) | st.text(max_size=5),
        st.lists(
            st.tuples(st.sampled_from(["late_s", "what", "whats", "text", "strikes", "effect", "at"]), VALUES | inner),
            max_size=4,
        ).map(tuple),
        st.text(max_size=3),
        st.text(max_size=3),
        st.sampled_from(["", *EN.advice]) | st.text(max_size=3),
    ),
    max_leaves=5,
)


@given(CAUSES, st.sampled_from(["en", "ko", "", "xx"]))
def test_nothing_that_is_said_can_fail(cause: Cause, language: str) -> None:
    assert isinstance(say(cause, language), str)


def test_a_cause_is_the_same_by_id_and_key_whatever_it_says() -> None:
    warmer = Cause.of("over_temperature", key="pack.temperature_c", place="other.yaml:9", pack_c=50.0)
    assert HOT.same_as(warmer)
    assert warmer != HOT
    assert not HOT.same_as(Cause.of("over_temperature", key="limits.temperature_c"))
    assert not HOT.same_as(Cause("hot_trip", key="pack.temperature_c"))
    assert not HOT.same_as(None)
    assert len({HOT, HOT.with_(), Cause.of("x")}) == 2
    assert (HOT.param("limit_c"), HOT.param("limit_v")) == (45, None)


def test_several_causes_are_one() -> None:
    assert together([HOT]) == HOT
    assert together([HOT, HOT]).param("whats") == (HOT, HOT)


def test_a_cause_is_written_with_its_sentence_and_read_without() -> None:
    nested = Cause.of("charging", rule=HOT, whats=(HOT, "x"), step=3)
    written = fields(nested)
    assert written is not None
    assert set(written) == {"id", "params", "key", "place", "advice", "text"}
    assert from_plain(written) == nested
    assert from_plain(plain(nested)) == nested
    assert fields(None) is None


DEEP: dict[str, object] = {"id": "x"}
for _ in range(20):
    DEEP = {"id": "x", "params": {"what": DEEP}}


@pytest.mark.parametrize(
    "value",
    [
        None, "late", [], {}, {"id": ""}, {"id": 1}, {"id": "x", "more": 1}, {"id": "x", "params": 3}, DEEP,
        {"id": "x", "params": [["a"]]}, {"id": "x", "params": [[1, 2]]}, {"id": "x", "key": None}, {"id": "\ud800"},
        {"id": "x", "params": {"a": "\ud800"}}, {"id": "x", "params": {"a": float("nan")}},
        {"id": "x", "params": {"a": {"b": 1}}}, {"id": "x", "params": {"a": [[[[[[[[[[1]]]]]]]]]]}},
    ],
    ids=repr,
)  # fmt: skip
def test_what_is_no_cause_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match=r"is no (cause|parameter)|surrogates"):
        from_plain(value)


@pytest.mark.parametrize(
    ("environment", "language"),
    [
        ({}, ""), ({"LANG": "C"}, "en"), ({"LANG": "C.UTF-8"}, "en"), ({"LANG": "ko_KR.UTF-8"}, "ko"),
        ({"LANG": "ko"}, "ko"), ({"LANG": "de_DE.UTF-8"}, "en"), ({"LC_ALL": "en_US", "LANG": "ko_KR"}, "en"),
        ({"LC_ALL": "", "LC_MESSAGES": "ko_KR.UTF-8", "LANG": "en_GB"}, "ko"),
    ],
)  # fmt: skip
def test_the_terminals_language(environment: dict[str, str], language: str) -> None:
    assert language_of(environment) == language


def test_the_effect_that_is_said_first_is_the_one_of_the_core() -> None:
    from orchestrator.text.catalogue import TRIP

    assert Effect.TRIP.name == TRIP


def status(cause: Cause) -> dict[str, Any]:
    told = fields(cause)
    fault = {"id": "over_temperature", "text": say(cause), "cause": told}
    return {"bays": [{"name": "bay-1", "reason": say(cause), "cause": told, "step_rule": "", "faults": [fault]}]}


def test_a_document_is_said_in_the_readers_language() -> None:
    document = status(HOT)
    (bay,) = in_language(document, "ko")["bays"]
    assert (bay["reason"], bay["faults"][0]["text"], bay["step_rule"]) == (say(HOT, "ko"), say(HOT, "ko"), "")
    assert in_language(document, "en") == document
    assert in_language(document, "") == document


def test_what_a_newer_service_says_stays_as_it_said_it() -> None:
    for cause in ({"id": "of_tomorrow", "params": {}}, {"id": "late", "params": {}}, {"id": "late", "more": 1}, None):
        document: dict[str, Any] = {"bays": [{"reason": "what it said", "cause": cause, "faults": []}]}
        assert in_language(document, "ko")["bays"][0]["reason"] == "what it said"


def test_a_refusal_is_said_in_the_readers_language() -> None:
    answer = {"results": {"bay-1": "", "bay-2": "not done"}, "causes": {"bay-2": plain(Cause("overtaken"))}}
    assert refusals(answer, "ko") == {"bay-1": "", "bay-2": say(Cause("overtaken"), "ko")}
    assert refusals(answer, "") == answer["results"]
    assert refusals({"results": {"bay-2": "no"}}, "ko") == {"bay-2": "no"}
