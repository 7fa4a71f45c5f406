"""Everything is tried; only what is listed here passes."""

from itertools import product

import pytest

from orchestrator.link.can_gate import refusal

NODES = (0x10, 0x11)

#: Everything that may ever be sent to node 0x10, except reads: written out again by hand.
NMT = {bytes((command, node)) for command in (0x01, 0x02, 0x80, 0x81, 0x82) for node in NODES}
TIMERS = {(0x1017, 0): range(100, 2001)} | {(0x1800 + i, 5): range(50, 1001) for i in range(3)}

INDEXES = (0, 0x1000, 0x1010, 0x1016, 0x1017, 0x1018, 0x1400, 0x1800, 0x1801, 0x1802, 0x1803, 0x1A00, 0x2150, 0x6000)
SUBS = (0, 1, 2, 5)
VALUES = (0, 1, 49, 50, 99, 100, 500, 1000, 1001, 2000, 2001, 0xFFFF, 0x10000 | 500, 0x500_0000 | 500)


def sdo(command: int, index: int, sub: int, value: int) -> bytes:
    return bytes((command,)) + index.to_bytes(2, "little") + bytes((sub,)) + value.to_bytes(4, "little")


def test_of_all_sdo_requests_only_reads_and_the_timers_pass() -> None:
    passed = 0
    for command, index, sub, value in product(range(256), INDEXES, SUBS, VALUES):
        read = command == 0x40 and value == 0 and index != 0x2150
        timer = command == 0x2B and value in TIMERS.get((index, sub), ())
        allowed = refusal(0x610, sdo(command, index, sub, value), NODES) == ""
        assert allowed == (read or timer), f"{command:02X} {index:04X}:{sub} {value}"
        passed += allowed
    assert passed == 13 * 4 + sum(value in timer for timer in TIMERS.values() for value in VALUES)


def test_on_no_other_cob_id_does_anything_pass() -> None:
    payloads = (sdo(0x40, 0x6000, 0, 0), sdo(0x2B, 0x1017, 0, 500), b"\x01\x10", b"\x81\x00", b"\x01", b"", bytes(8))
    for cob_id, data in product(range(0x800), payloads):
        expected = (cob_id in (0x610, 0x611) and data in payloads[:2]) or (cob_id == 0 and data in NMT)
        assert (refusal(cob_id, data, NODES) == "") == expected, f"{cob_id:03X} {data.hex()}"


def test_of_all_nmt_frames_only_the_five_commands_to_our_nodes_pass() -> None:
    passed = {bytes(data) for data in product(range(256), repeat=2) if not refusal(0, bytes(data), NODES)}
    assert passed == NMT  # not to node 0, which means all


@pytest.mark.parametrize("length", [0, 1, 2, 3, 4, 5, 6, 7, 9, 64])
def test_an_sdo_request_has_eight_bytes(length: int) -> None:
    assert refusal(0x610, sdo(0x40, 0x6000, 0, 0)[:length].ljust(length, b"\0"), NODES)


def test_an_extended_id_never_passes() -> None:
    assert refusal(0x1000_0610, sdo(0x40, 0x6000, 0, 0), NODES)


def test_the_older_protocol_is_asked_only_where_it_is_allowed() -> None:
    assert refusal(0x470, b"\x70", NODES)
    passed = [
        (cob_id, byte)
        for cob_id, byte in product(range(0x400, 0x500), range(256))
        if not refusal(cob_id, bytes((byte,)), NODES, pages=True)
    ]
    assert passed == [(0x470, 0x70), (0x471, 0x71)]


def test_a_refusal_shows_the_frame_and_what_would_be_allowed() -> None:
    assert refusal(0x610, sdo(0x23, 0x6000, 0, 1), NODES) == (
        "SDO request 23 00 60 00 01 00 00 00 is neither a read nor one of 0x1017:00 = 100 … 2000 ms, "
        "0x1800:05 = 50 … 1000 ms, 0x1801:05 = 50 … 1000 ms, 0x1802:05 = 50 … 1000 ms"
    )
