"""The emulated charger's own codec, against the bytes in the charger's document."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.model import ChargeMode, ControlMode, Precharge
from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.charger_frames import Ear, Kind, Request, complaint, status
from tests.sim.wires import framed

POLL = bytes.fromhex("AF FA 90 05 01 90 03 04 2D AF A0")  # §3.3.1
RUN = bytes.fromhex("AF FA 90 05 02 90 01 01 29 AF A0")  # §3.3.2
STOP = bytes.fromhex("AF FA 90 04 10 90 00 34 AF A0")  # §3.3.4
GOOD = {
    POLL: Request(5, 0x01, 0x90, b"\x03\x04", 0x2D, 0),
    RUN: Request(5, 0x02, 0x90, b"\x01\x01", 0x29, 0),
    STOP: Request(4, 0x10, 0x90, b"\x00", 0x34, 0),
}


@pytest.mark.parametrize(("wire", "request_"), list(GOOD.items()), ids=["poll", "run", "stop"])
def test_printed_requests_are_understood_whole_and_byte_by_byte(wire: bytes, request_: Request) -> None:
    assert Ear().hear(wire) == [request_]
    ear = Ear()
    assert [found for byte in wire for found in ear.hear(bytes((byte,)))] == [request_]
    assert not ear.waiting


@given(noise=st.binary(max_size=30).filter(lambda noise: b"\xaf" not in noise), wire=st.sampled_from(list(GOOD)))
def test_a_request_behind_noise_is_heard(noise: bytes, wire: bytes) -> None:
    assert Ear().hear(noise + wire + wire) == [GOOD[wire], GOOD[wire]]


@given(chunks=st.lists(st.binary(max_size=40)))
def test_no_bytes_break_it_or_fill_it(chunks: list[bytes]) -> None:
    ear = Ear()
    for chunk in chunks:
        ear.hear(chunk)
    assert ear.forget() <= 29


@pytest.mark.parametrize(
    ("wire", "errors"),
    [
        ("AF FA 90 05 01 90 03 04 2E AF A0", 0b1000),  # checksum
        (framed("90 05 07 90 03 04"), 0b0010),  # command
        (framed("90 05 01 91 03 04"), 0b0100),  # order
        (framed("90 06 01 90 03 04 00"), 0b0001),  # one byte too long for a poll
        ("AF FA 90 05 01 90 03 04 2D AF A1", 0b0001),  # the end is not at the place given by the length
        ("AF FA 90 02 01 90 03 04 2D AF A0", 0b0001),  # a length no request has
        ("AF FA 90 05 08 91 03 04 00 AF A0", 0b1110),
    ],
)
def test_bad_frames_have_their_error_bits(wire: str, errors: int) -> None:
    (found,) = Ear().hear(bytes.fromhex(wire))
    assert found.errors == errors


def test_a_frame_for_another_address_is_nobodys_business() -> None:
    assert Ear().hear(bytes.fromhex(framed("91 05 01 91 03 04"))) == []


def test_the_good_frame_behind_a_false_start_is_heard() -> None:
    assert Ear().hear(bytes.fromhex("AF FA 90 05") + STOP)[-1] == GOOD[STOP]


def test_the_printed_complaint_with_its_own_sum() -> None:
    # §3.3.5; the printed checksum 0x39 is not its sum, 0x68 is
    request = Request(length=0x11, command=0x10, order=0x05, data=b"", checksum=0x89, errors=3)
    assert complaint(request, 3) == bytes.fromhex("AF FA 90 07 1F 03 11 10 05 89 68 AF A0")


def test_the_printed_reply() -> None:
    # §3.3.3: 50.11 V, 23.11 A, mode 3
    charger = SimulatedCharger(voltage_v=50.11, current_a=23.11, mode=ChargeMode.PRECHARGE)
    assert status(charger, 0x03, 0x04, {}) == bytes.fromhex("AF FA 90 09 03 90 13 93 09 07 00 03 E5 AF A0")


def test_all_ten_values_come_in_the_list_s_order() -> None:
    charger = SimulatedCharger(
        voltage_v=48.0, current_a=5.0, current_step=2, mode=ChargeMode.CHARGE, precharge=Precharge.PULSE, run=True
    )
    body = "90 17 03 90 12 C0 01 F4 00 00 00 00 00 01 00 01 00 02 00 04 00 01 00 01"
    assert status(charger, 0xFF, 0xFF, {}) == bytes.fromhex(framed(body))


@given(kind1=st.integers(0, 255), kind2=st.integers(0, 255))
def test_what_is_asked_for_is_what_comes(kind1: int, kind2: int) -> None:
    lies = {kind: 0x0100 + kind for kind in Kind}
    asked = [bit for bit in range(5) if kind1 >> bit & 1] + [5 + bit for bit in range(5) if kind2 >> bit & 1]
    body = bytes((0x90, 3 + 2 * len(asked), 0x03, 0x90)) + b"".join(bytes((1, kind)) for kind in asked)
    assert status(SimulatedCharger(), kind1, kind2, lies) == bytes.fromhex(framed(body.hex()))


def test_a_charger_in_automatic_says_so() -> None:
    assert status(SimulatedCharger(ControlMode.AUTOMATIC), 0x10, 0, {}) == bytes.fromhex(framed("90 05 03 90 00 00"))
