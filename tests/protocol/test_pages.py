"""The BMU's older protocol, by bytes written by hand from its description."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.model import Measurement
from orchestrator.protocol.pages import PAGES, pages_request, pages_request_cob_id, parse_page
from orchestrator.protocol.words import Decoded


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
            "70 02 FF FF 2C 01 32 64",
            {"time_to_full_min": None, "time_to_empty_min": 300, "soc_pct": 50, "soh_pct": 100},
        ),
        ("70 03 E8 03 CA 12 F1 FF", {"remaining_ah": 10, "available_wh": 481, "temperature_c": -1.5}),
    ],
)
def test_each_page(data: str, expected: dict[str, object]) -> None:
    assert values(data) == expected


def test_a_page_is_of_no_known_time_and_so_never_fresh() -> None:
    assert parse_page(0x10, bytes.fromhex("70 01 40 09 F8 FF 05 00"))["voltage_v"] == Measurement(23.68, 0.0)


def test_what_cannot_be_is_told() -> None:
    assert values("70 02 00 00 00 00 8C 64")["soc_pct"] == "soc_pct 140 is outside 0 … 100 (raw 0x8C)"


@pytest.mark.parametrize(
    "data",
    ["", "70", "71 01 00 00 00 00 00 00", "70 04 00 00 00 00 00 00", "70 00 00 00 00 00 00 00", "70 01 00 00 00 00 00"],
)
def test_any_other_frame_is_no_page(data: str) -> None:
    assert values(data) == {}


@given(st.binary(max_size=9))
def test_any_bytes_are_a_page_or_nothing(data: bytes) -> None:
    page = parse_page(0x10, data)
    assert set(page) in [set(), *({field.name for field in entry.fields} for entry in PAGES.values())]
