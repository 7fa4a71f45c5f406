"""Numbers as people write them elsewhere: what the message says to write, and when it says nothing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.config.yaml.numbers import decimals_meant, digits_meant, range_meant, why_no_number
from orchestrator.config.yaml.tree import Items, Mark, Scalar
from orchestrator.keys import KeyRule

VOLTS = KeyRule("a voltage", unit="V")
NODE_ID = KeyRule("a node id", ge=1, le=127)
MARK = Mark(1, 1)


def listed(text: str) -> Items:
    return Items(MARK, tuple(Scalar(MARK, item) for item in text.split()))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1A", "write 0x1A, not 1A: hexadecimal begins with 0x"),
        ("7f", "write 0x7F, not 7f: hexadecimal begins with 0x"),
        ("10h", "write 0x10, not 10h: hexadecimal begins with 0x"),
        ("#1", "write 0x01, not #1: hexadecimal begins with 0x"),
        ("80h", "only the number, without a unit: 80, not 80h"),  # there is no such id
        ("0xGG", "'0xGG' is not a number"),
        ("1O", "write 10: '1O' has a letter or a sign that only looks like it"),
        ("0x1l", "write 0x11: '0x1l' has a letter or a sign that only looks like it"),
        ("Ol", "'Ol' is not a number"),  # a word, as far as anybody can tell
        ("12 pcs", "only the number, without a unit: 12, not 12 pcs"),
    ],
)
def test_a_node_id_is_read_as_hexadecimal_where_that_is_possible(text: str, said: str) -> None:
    assert why_no_number(Scalar(MARK, text), NODE_ID, whole=True) == said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("14,5 V", "only the number, without a unit: 14.5, not 14,5 V"),
        ("5V", "only the number, without a unit: 5, not 5V"),
        ("58 max", "only the number, without a unit: 58, not 58 max"),
        ("55200 mV", "write 55.2, in V, not 55200 mV"),
        ("0,0584 kV", "write 58.4, in V, not 0,0584 kV"),
        ("5A", "5A is no number in V: write how many V are meant"),  # never 0x5A
        ("5V3", "'5V3' is not a number in V"),  # 5 would be wrong
        ("≤ 58.4", "only the number: 58.4, not ≤ 58.4"),
        ("58.4;", "write 58.4, not 58.4;"),
        ("5..", "write 5, not 5.."),
        ("１４．５", "write 14.5: '１４．５' has a letter or a sign that only looks like it"),
        ("−5", "write -5: '−5' has a letter or a sign that only looks like it"),
        ("1; 2", "write 1, 2, not 1; 2"),
    ],
)
def test_a_number_with_a_unit_is_told_how_to_be_written(text: str, said: str) -> None:
    assert why_no_number(Scalar(MARK, text), VOLTS) == said


@pytest.mark.parametrize(
    ("unit", "text", "said"),
    [
        ("s", "1 min", "write 60, in s, not 1 min"),
        ("s", "500 ms", "write 0.5, in s, not 500 ms"),
        ("h", "90 min", "write 1.5, in h, not 90 min"),
        ("min", "2h", "write 120, in min, not 2h"),
        ("h", "12 hours", "only the number, without a unit: 12, not 12 hours"),
        ("Ah", "44000 mAh", "write 44, in Ah, not 44000 mAh"),
        (
            "A",
            "0.5C",
            "0.5C is no number in A: write how many A are meant; C belong to a key of their own, such as max_c",
        ),
        ("°C", "45℃", "only the number, without a unit: 45, not 45℃"),
        ("%", "98 Percent", "only the number, without a unit: 98, not 98 Percent"),
        ("MB", "1 GB", "write 1000, in MB, not 1 GB"),
        ("", "13S", "only the number, without a unit: 13, not 13S"),
        ("", "13s4p", "only the cells in series: 13, not 13s4p"),
    ],
)
def test_another_unit_is_converted_and_never_dropped(unit: str, text: str, said: str) -> None:
    assert why_no_number(Scalar(MARK, text), KeyRule("", unit=unit)) == said


@pytest.mark.parametrize(
    "text",
    [
        "0..45", "0 - 45", "0…45", "0-45", "0 to 45", "0, 45", "0:45", "0/45", "0;45", "0 45", "(0, 45)",
        "0 °C - 45 °C", "0°C to 45°C", "0℃~45℃", "0 V … 45 V",
    ],
)  # fmt: skip
def test_a_range_written_otherwise_is_understood(text: str) -> None:
    assert range_meant(Scalar(MARK, text)) == ("[0, 45]", "")
    assert range_meant(Items(MARK, (Scalar(MARK, text),))) == ("[0, 45]", "")


def test_what_is_no_range_gets_no_advice_but_the_number_of_values() -> None:
    assert range_meant(Scalar(MARK, "hot")) == ("", "")
    assert range_meant(Items(MARK, ()))[0] == ""
    assert range_meant(listed("1 2 3")) == ("", ", two numbers (2.5, not 2,5), not 3")
    assert range_meant(listed("26 0 55 2")) == ("[26.0, 55.2]", ", two numbers (2.5, not 2,5), not 4")
    assert range_meant(listed("2.6 0 55 2"))[0] == ""


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("2 0 5 0 8 0 11 0 13 5", "[2.0, 5.0, 8.0, 11.0, 13.5]"),
        ("2 5 5 5 8 5", "[2.5, 5.5, 8.5]"),
        ("2 5 8 11 14", ""),
        ("1 2 3 4 5 6", ""),  # rises: six whole numbers
        ("9 7 5 3 2 1", ""),  # falls either way
        ("2 25 5 0 8 0", ""),
        ("2.0 5 5 0 8 0", ""),
        ("9 1 5 0", ""),
    ],
)
def test_a_list_whose_decimals_have_commas_is_recognised_by_its_rise(text: str, meant: str) -> None:
    assert decimals_meant(listed(text)) == meant


@given(st.text(max_size=60), st.booleans())
def test_any_text_gets_a_sentence(text: str, whole: bool) -> None:
    assert why_no_number(Scalar(MARK, text), NODE_ID, whole=whole)
    digits_meant(text)
    range_meant(Scalar(MARK, text))
    decimals_meant(Items(MARK, (Scalar(MARK, text),) * 6))
