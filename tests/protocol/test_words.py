"""Words to measurements through a map."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.keys import Range
from orchestrator.model import BatteryReading, Cause, Measurement
from orchestrator.protocol.objects import READING_FIELDS, Evidence, FieldMap, ObjectEntry, Sweep
from orchestrator.protocol.words import Decoded, decode_word, raw_bits
from orchestrator.text.catalogue import say

EVERYTHING = Range(-1e12, 1e12)


def bits(name: str, first_bit: int, width: int, **more: object) -> FieldMap:
    plain = FieldMap(name=name, first_bit=first_bit, width=width, range=EVERYTHING, evidence=Evidence.ASSUMED)
    return dataclasses.replace(plain, **more)  # type: ignore[arg-type]  # each test names the fields it means


def entry(*fields: FieldMap, size: int = 4, index: int = 0x6000) -> ObjectEntry:
    return ObjectEntry(index=index, size=size, sweep=Sweep.FAST, fields=fields)


VOLTS_AMPS = entry(
    bits("voltage_v", 16, 16, scale=0.01, range=Range(0, 60)),
    bits("current_a", 0, 16, scale=0.01, range=Range(-60, 60), signed=True),
)
TIMES = entry(
    bits("time_to_empty_min", 16, 16, unavailable=0xFFFF),
    bits("soc_pct", 8, 8, range=Range(0, 100)),
    bits("soh_pct", 0, 8, range=Range(0, 100)),
    index=0x6002,
)


def outside(field: str, value: float, low: float, high: float, raw: str) -> Cause:
    return Cause.of("value_outside", field=field, value=value, low=low, high=high, raw=raw)


def test_what_is_outside_is_said_with_its_raw_bits() -> None:
    assert say(outside("soc_pct", 255.0, 0, 100, "0xFF")) == "SOC 255 is outside 0 … 100 (raw 0xFF)"


def test_the_documents_sample() -> None:
    word = int.from_bytes(bytes.fromhex("F8FF4009"), "little")
    assert decode_word(VOLTS_AMPS, word, 4, 7.0) == {
        "voltage_v": Measurement(23.68, 7.0),
        "current_a": Measurement(-0.08, 7.0),
    }


def test_not_available_is_no_value_and_no_fault() -> None:
    expected: dict[str, Decoded] = {
        "time_to_empty_min": None,
        "soc_pct": Measurement(80, 1.0),
        "soh_pct": Measurement(99, 1.0),
    }
    assert decode_word(TIMES, 0xFFFF_50_63, 4, 1.0) == expected


def test_a_value_outside_its_range_is_a_sentence_and_its_neighbours_stay() -> None:
    assert decode_word(TIMES, 0x0010_FF_64, 4, 1.0) == {
        "time_to_empty_min": Measurement(16, 1.0),
        "soc_pct": outside("soc_pct", 255.0, 0, 100, "0xFF"),
        "soh_pct": Measurement(100, 1.0),
    }
    assert decode_word(VOLTS_AMPS, 0x1771_8000, 4, 1.0) == {
        "voltage_v": outside("voltage_v", 60.01, 0, 60, "0x1771"),
        "current_a": outside("current_a", -327.68, -60, 60, "0x8000"),
    }


@pytest.mark.parametrize(("width", "raw"), [(1, "1"), (8, "01"), (9, "001"), (12, "001"), (13, "0001"), (16, "0001")])
def test_raw_bits_are_shown_with_all_their_digits(width: int, raw: str) -> None:
    narrow = entry(bits("status", 0, width, range=Range(2, 3)))
    assert decode_word(narrow, 1, 4, 0.0) == {"status": outside("status", 1.0, 2, 3, f"0x{raw}")}


def test_both_ends_of_a_range_belong_to_it() -> None:
    assert decode_word(VOLTS_AMPS, 0x1770_E890, 4, 0.0) == {
        "voltage_v": Measurement(60, 0.0),
        "current_a": Measurement(-60, 0.0),
    }


@pytest.mark.parametrize("size", [1, 2])
def test_a_reply_of_another_size_believes_no_field(size: int) -> None:
    why = Cause.of("size_differs", index=0x6002, sub=0, size=size, expected=4)
    assert decode_word(TIMES, 0x00105063, size, 0.0) == dict.fromkeys(("time_to_empty_min", "soc_pct", "soh_pct"), why)


def test_signed_fields_of_any_width_use_their_own_top_bit() -> None:
    narrow = entry(bits("temperature_c", 4, 12, signed=True, scale=0.1, offset=-40.0), size=2)
    assert decode_word(narrow, 0x8000, 2, 0.0) == {"temperature_c": Measurement(-244.8, 0.0)}
    assert decode_word(narrow, 0x7FFF, 2, 0.0) == {"temperature_c": Measurement(164.7, 0.0)}


def test_decimal_scales_give_decimal_values() -> None:
    for raw in range(6001):
        decoded = decode_word(VOLTS_AMPS, raw << 16, 4, 0.0)
        assert decoded["voltage_v"] == Measurement(float(f"{raw // 100}.{raw % 100:02d}"), 0.0)


@pytest.mark.parametrize(
    ("scale", "raw", "value"), [(0.1, 5258217, 525821.7), (0.01, 52439619, 524396.19), (0.001, 524443695, 524443.695)]
)
def test_large_words_have_no_more_digits_than_their_scale(scale: float, raw: int, value: float) -> None:
    """The tenth digit after the point is the last of such a float, and wrong."""
    row = bits("available_wh", 0, 32, scale=scale)
    assert decode_word(entry(row), raw, 4, 0.0) == {"available_wh": Measurement(value, 0.0)}


@given(st.integers(0, 31), st.integers(1, 32), st.booleans(), st.integers(0, 0xFFFFFFFF))
def test_bits_are_cut_as_a_string_of_bits_would_be(first_bit: int, width: int, signed: bool, word: int) -> None:
    width = min(width, 32 - first_bit)
    row = bits("status", first_bit, width, signed=signed)
    digits = f"{word:032b}"[::-1][first_bit : first_bit + width][::-1]
    assert raw_bits(row, word) == int(digits, 2)
    expected = int(digits, 2) - (int(digits[0]) << width if signed else 0)
    assert decode_word(entry(row), word, 4, 3.0) == {"status": Measurement(expected, 3.0)}


def test_the_names_that_a_map_may_use_are_those_of_the_reading() -> None:
    assert len(READING_FIELDS) == 10
    assert BatteryReading(**dict.fromkeys(READING_FIELDS, Measurement(1.0, 0.0)))
