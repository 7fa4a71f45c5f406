"""The BMU's older protocol, with bytes written by hand from its description."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.model import Cause, Measurement
from orchestrator.protocol.objects import Evidence
from orchestrator.protocol.pages import PAGES, pages_request, pages_request_cob_id, parse_page
from orchestrator.protocol.words import Decoded
from orchestrator.text.catalogue import say


def values(data: str) -> dict[str, Decoded | float]:
    page = parse_page(0x10, bytes.fromhex(data))
    return {name: value.value if isinstance(value, Measurement) else value for name, value in page.items()}


def test_the_request() -> None:
    assert (pages_request_cob_id(0x10), pages_request(0x10)) == (0x470, b"\x70")
    assert pages_request(0x7F) == b"\xdf"


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ("70 01 40 09 F8 FF 05 00", {"voltage_v": 23.68, "current_a": -0.08, "status": 5}),
        (
            "70 02 FF FF 2C 01 33 64",
            {"time_to_full_min": None, "time_to_empty_min": 300, "soc_pct": 51, "soh_pct": 100},
        ),
        ("70 03 E8 03 CA 12 F1 FF", {"remaining_ah": 10, "available_wh": 481, "temperature_c": -1.5}),
        # The lowest and highest values believed.
        ("70 01 00 00 44 80 00 00", {"voltage_v": 0, "current_a": -327, "status": 0}),
        ("70 01 10 27 BC 7F 7F 00", {"voltage_v": 100, "current_a": 327, "status": 127}),
        (
            "70 02 00 00 FF FF 00 00",
            {"time_to_full_min": 0, "time_to_empty_min": None, "soc_pct": 0, "soh_pct": 0},
        ),
        (
            "70 02 FE FF FE FF 64 64",
            {"time_to_full_min": 65534, "time_to_empty_min": 65534, "soc_pct": 100, "soh_pct": 100},
        ),
        ("70 03 00 00 00 00 71 FE", {"remaining_ah": 0, "available_wh": 0, "temperature_c": -39.9}),
        ("70 03 FE FF FE FF E1 04", {"remaining_ah": 655.34, "available_wh": 6553.4, "temperature_c": 124.9}),
    ],
)
def test_each_page(data: str, expected: dict[str, object]) -> None:
    assert values(data) == expected


def test_a_page_is_of_no_known_time_and_so_never_fresh() -> None:
    assert parse_page(0x10, bytes.fromhex("70 01 40 09 F8 FF 05 00"))["voltage_v"] == Measurement(23.68, 0.0)


@pytest.mark.parametrize(
    ("data", "name", "sentence"),
    [
        ("70 01 11 27 00 00 00 00", "voltage_v", "pack voltage 100.01 is outside 0 … 100 (raw 0x2711)"),
        ("70 01 00 00 43 80 00 00", "current_a", "pack current -327.01 is outside -327 … 327 (raw 0x8043)"),
        ("70 01 00 00 BD 7F 00 00", "current_a", "pack current 327.01 is outside -327 … 327 (raw 0x7FBD)"),
        ("70 01 00 00 00 00 80 00", "status", "status 128 is outside 0 … 127 (raw 0x0080)"),
        ("70 02 00 00 00 00 65 00", "soc_pct", "SOC 101 is outside 0 … 100 (raw 0x65)"),
        ("70 02 00 00 00 00 00 8C", "soh_pct", "SOH 140 is outside 0 … 100 (raw 0x8C)"),
        ("70 03 FF FF 00 00 00 00", "remaining_ah", "remaining charge 655.35 is outside 0 … 655.34 (raw 0xFFFF)"),
        ("70 03 00 00 FF FF 00 00", "available_wh", "available energy 6553.5 is outside 0 … 6553.4 (raw 0xFFFF)"),
        ("70 03 00 00 00 00 70 FE", "temperature_c", "temperature -40 is outside -39.9 … 124.9 (raw 0xFE70)"),
        ("70 03 00 00 00 00 E2 04", "temperature_c", "temperature 125 is outside -39.9 … 124.9 (raw 0x04E2)"),
    ],
)
def test_what_cannot_be_is_told(data: str, name: str, sentence: str) -> None:
    why = values(data)[name]
    assert isinstance(why, Cause)
    assert say(why) == sentence


def test_nothing_on_a_page_is_documented() -> None:
    assert {field.evidence for fields in PAGES.values() for field in fields} == {Evidence.ASSUMED}


@pytest.mark.parametrize(
    "data",
    ["", "70", "71 01 00 00 00 00 00 00", "70 04 00 00 00 00 00 00", "70 00 00 00 00 00 00 00", "70 01 00 00 00 00 00"],
)
def test_any_other_frame_is_no_page(data: str) -> None:
    assert values(data) == {}


@given(st.binary(max_size=9))
def test_any_bytes_are_a_page_or_nothing(data: bytes) -> None:
    page = parse_page(0x10, data)
    assert set(page) in [set(), *({field.name for field in fields} for fields in PAGES.values())]
