"""One scalar at a time: what is accepted, and the message for what is not."""

import math
from enum import Enum

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.config.yaml import scalars
from orchestrator.config.yaml.scalars import UnfitError
from orchestrator.config.yaml.tree import Mark, Scalar
from orchestrator.keys import KeyRule

VOLTS = KeyRule("a voltage", unit="V")
TEXT = KeyRule("a text")


def _plain(text: str) -> Scalar:
    return Scalar(Mark(1, 1), text)


@pytest.mark.parametrize(
    ("text", "value"),
    [("0", 0.0), ("-5", -5.0), ("+5", 5.0), ("58.4", 58.4), ("0.5", 0.5), ("-0.05", -0.05), ("10.00", 10.0)],
)
def test_a_number_is_a_plain_decimal(text: str, value: float) -> None:
    assert scalars.read_float(_plain(text), VOLTS) == value


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("on", "'on' is not a number in V"),
        ("1:30", "1:30 looks like a time (h:min or min:s) and would be read as 90: write one number"),
        ("19:20:00", "19:20:00 looks like a time (h:min:s) and would be read as 69600: write one number"),
        ("012", "012 with a leading 0 may be read as octal: write 12"),
        ("00", "00 with a leading 0 may be read as octal: write 0"),
        ("0o14", "write it in decimal: 12, not 0o14"),
        ("0x0C", "write it in decimal: 12, not 0x0C"),
        ("1e3", "write 1000, not 1e3"),
        ("1.5E-2", "write 0.015, not 1.5E-2"),
        ("1e300", "'1e300' is not a number in V"),
        ("1e999", "'1e999' is not a number in V"),
        (".nan", ".nan is not a number to charge by"),
        ("-.INF", "-.INF is not a number to charge by"),
        ("1_000", "write 1000, not 1_000"),
        ("1.2_3.4", "'1.2_3.4' is not a number in V"),
        ("58,4", "use a decimal point: 58.4, not 58,4"),
        ("58.4V", "only the number, without a unit: 58.4, not 58.4V"),
        ("58.4 V", "only the number, without a unit: 58.4, not 58.4 V"),
        (".5", "write 0.5, not .5"),
        ("5.", "write 5, not 5."),
        ("05.5", "write 5.5, not 05.5"),
        ("", "needs a number in V: a voltage"),
        ("1.2.3", "'1.2.3' is not a number in V"),
        ("٣", "'٣' is not a number in V"),
        ("1" * 41, "'" + "1" * 39 + "…' is not a number in V"),
    ],
)
def test_a_number_written_otherwise_is_told_how_to_be_written(text: str, said: str) -> None:
    with pytest.raises(UnfitError) as error:
        scalars.read_float(_plain(text), VOLTS)
    assert str(error.value) == said


def test_a_number_in_quotes_is_not_one() -> None:
    with pytest.raises(UnfitError, match=r"^write 48 without quotes$"):
        scalars.read_float(Scalar(Mark(1, 1), "48", plain=False), VOLTS)
    with pytest.raises(UnfitError, match=r"^'a' is not a number in V$"):
        scalars.read_float(Scalar(Mark(1, 1), "a", plain=False), VOLTS)


@pytest.mark.parametrize(("text", "value"), [("0", 0), ("127", 127), ("0x10", 16), ("0xfF", 255), ("-3", -3)])
def test_a_whole_number_may_be_hexadecimal(text: str, value: int) -> None:
    assert scalars.read_int(_plain(text), TEXT) == value


@pytest.mark.parametrize(
    ("text", "said"),
    [("5.0", "5.0 must be a whole number, e.g. 5"), ("0xG", "'0xG' is not a number"), ("017", "017 with a leading 0")],
)
def test_a_whole_number_written_otherwise(text: str, said: str) -> None:
    with pytest.raises(UnfitError, match=said):
        scalars.read_int(_plain(text), TEXT)


BOUNDS = [
    (KeyRule("", ge=1, le=2), [1, 2], [0.99, 2.01], "1 … 2"),
    (KeyRule("", gt=1, le=2), [1.01, 2], [1, 2.01], "above 1, at most 2"),
    (KeyRule("", ge=1, lt=2), [1, 1.99], [0.99, 2], "at least 1, below 2"),
    (KeyRule("", gt=1), [1.01], [1], "above 1"),
    (KeyRule("", unit="V", le=2), [2, -9], [2.01], "at most 2 V"),
    (KeyRule(""), [-1e9, 1e9], [], ""),
]


@pytest.mark.parametrize(("key", "inside", "outside", "words"), BOUNDS)
def test_bounds_are_kept_and_told(key: KeyRule, inside: list[float], outside: list[float], words: str) -> None:
    assert scalars.allowed(key) == words
    for value in inside:
        assert scalars.bounded(value, key) == value
    for value in outside:
        with pytest.raises(UnfitError, match=f"allowed: {words}"):
            scalars.bounded(value, key)


@pytest.mark.parametrize(
    ("text", "plain", "said"),
    [
        ("yes", True, "write true, not 'yes'"),
        ("Off", True, "write false, not 'Off'"),
        ("TRUE", True, "write true, not 'TRUE'"),
        ("true", False, "write true without quotes, not 'true'"),
        ("1", True, "write true, not '1'"),
        ("maybe", True, "write true or false, not 'maybe'"),
    ],
)
def test_true_and_false_are_the_only_ones(text: str, plain: bool, said: str) -> None:
    assert scalars.read_bool(_plain("true"), TEXT) is True
    assert scalars.read_bool(_plain("false"), TEXT) is False
    with pytest.raises(UnfitError) as error:
        scalars.read_bool(Scalar(Mark(1, 1), text, plain), TEXT)
    assert str(error.value) == said


class Colour(Enum):
    RED = 1
    GREEN = 2


def test_a_word_is_one_of_its_list() -> None:
    assert scalars.read_enum(_plain("green"), Colour) is Colour.GREEN
    with pytest.raises(UnfitError, match=r"'gren' is not .* did you mean green\? Allowed: red, green"):
        scalars.read_enum(_plain("gren"), Colour)
    with pytest.raises(UnfitError, match=r"'Green' is not .* did you mean green\? Allowed: red, green"):
        scalars.read_enum(_plain("Green"), Colour)
    with pytest.raises(UnfitError, match=r"'blue' is not .*; allowed: red, green"):
        scalars.read_enum(_plain("blue"), Colour)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("null", None),
        ("~", None),
        ("true", True),
        ("false", False),
        ("250000", 250000),
        ("0x1F", 31),
        ("-1", -1),
        ("0.1", 0.1),
        ("can0", "can0"),
        ("239.74.163.2", "239.74.163.2"),
        ("/dev/ttyACM0", "/dev/ttyACM0"),
        ("00:1A:2b", "00:1A:2b"),
        ("ttyS0@115200", "ttyS0@115200"),
    ],
)
def test_a_value_for_a_library_is_what_yaml_1_2_says(text: str, value: object) -> None:
    got = scalars.read_any(_plain(text), TEXT)
    assert got == value
    assert type(got) is type(value)
    assert scalars.read_any(Scalar(Mark(1, 1), text, plain=False), TEXT) == text


@pytest.mark.parametrize("text", ["on", "NO", "y", "012", "1e3", "1_000", ".nan", "-.inf", "0o7", "0b1", "5.", ".5"])
def test_a_value_for_a_library_that_yaml_readers_dispute_is_refused(text: str) -> None:
    with pytest.raises(UnfitError, match="in quotes for the text"):
        scalars.read_any(_plain(text), TEXT)


def test_the_nearest_word_is_the_first_of_the_nearest() -> None:
    assert scalars.nearest("cano", ["can0", "can1"]) == "can0"
    assert scalars.nearest("SOC-PCT", ["soh_pct", "soc_pct"]) == "soc_pct"
    assert scalars.nearest("zzz", ["can0"]) == ""
    assert scalars.nearest("x", []) == ""
    assert scalars.nearest("a" * 64, ["a" * 64]) == "a" * 64
    assert scalars.nearest("a" * 65, ["a" * 65]) == "", "no long words are compared: that takes time"


@given(st.text(), st.booleans())
def test_any_text_is_a_value_or_a_sentence(text: str, plain: bool) -> None:
    for read in (scalars.read_float, scalars.read_int, scalars.read_bool, scalars.read_str, scalars.read_any):
        try:
            value = read(Scalar(Mark(1, 1), text, plain), VOLTS)
        except UnfitError as error:
            assert str(error)
            assert len(str(error)) < 250
        else:
            assert not isinstance(value, float) or math.isfinite(value)


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e9, max_value=1e9))
def test_every_decimal_comes_back_as_it_was_written(value: float) -> None:
    text = f"{value:.6f}"
    assert scalars.read_float(_plain(text), VOLTS) == float(text)
