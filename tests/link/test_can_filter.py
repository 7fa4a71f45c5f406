"""The kernel's receive filters, and the interfaces that get one."""

import can
import pytest

from orchestrator.link import can as can_module
from orchestrator.link.can import CanBus
from orchestrator.link.can_filter import MOST, Filter, filters

REMOTE = 0x4000_0000


def passes(chosen: list[Filter], can_id: int) -> bool:
    """As in the kernel (net/can/af_can.c), with its flags in the upper bits of the id."""
    extended = 0x8000_0000
    return any((can_id ^ one["can_id"]) & (one["can_mask"] | extended) == 0 for one in chosen)


def test_exactly_our_ids_pass() -> None:
    chosen = filters([0x590, 0x710, 0x590])
    assert [can_id for can_id in range(0x800) if passes(chosen, can_id)] == [0x590, 0x710]
    assert not passes(chosen, 0x590 | REMOTE)
    assert not passes(chosen, 0x590 | 0x8000_0000)


def test_what_the_kernel_has_no_room_for_is_told_by_function_code() -> None:
    cob_ids = [base + node for node in range(1, 128) for base in (0x080, 0x180, 0x280, 0x580, 0x600, 0x700)]
    chosen = filters(cob_ids)
    assert len(cob_ids) > MOST
    assert len(chosen) == 6
    assert all(passes(chosen, cob_id) for cob_id in cob_ids)
    assert not any(passes(chosen, 0x480 + node) for node in range(128))
    assert not passes(chosen, 0x590 | REMOTE)


class Driver(can.BusABC):
    """A SocketCAN interface without a wire, since this machine may have none. It records the kernel's filters."""

    def __init__(self) -> None:
        self.chosen: list[object] = []
        super().__init__(channel="can0", can_filters=None)

    def _apply_filters(self, filters: object) -> None:
        self.chosen.append(filters)

    def send(self, msg: can.Message, timeout: float | None = None) -> None: ...


def chosen_by(monkeypatch: pytest.MonkeyPatch, settings: dict[str, object], *, filtered: bool = True) -> object:
    driver = Driver()
    monkeypatch.setattr(can_module, "_open_bus", lambda _settings: driver)
    bus = CanBus("can0", settings, [0x10], filtered=filtered)
    for cob_id in (0x590, 0x610):
        bus.subscribe(cob_id, lambda _cob_id, _data: None)
    bus.open()
    bus.close()
    return driver.chosen[-1]


SOCKETCAN: dict[str, object] = {"interface": "socketcan", "channel": "can0", "bitrate": 250_000}


def test_socketcan_gets_them(monkeypatch: pytest.MonkeyPatch) -> None:
    assert chosen_by(monkeypatch, SOCKETCAN) == filters([0x590, 0x610])


@pytest.mark.parametrize(
    ("settings", "filtered"),
    [
        (SOCKETCAN | {"can_filters": [{"can_id": 0x590, "can_mask": 0x7FF}]}, True),  # the station file has priority
        (SOCKETCAN, False),  # a probe looks for any node
        ({"interface": "slcan", "channel": "/dev/ttyACM0", "bitrate": 250_000}, True),  # python-can would filter itself
    ],
    ids=["station file", "probe", "software"],
)
def test_others_are_left_alone(monkeypatch: pytest.MonkeyPatch, settings: dict[str, object], filtered: bool) -> None:
    assert chosen_by(monkeypatch, settings, filtered=filtered) is None
