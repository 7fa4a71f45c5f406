"""What must hold for the CAN buses of one station, and for the filters that it may put on them."""

import os
import re
from collections.abc import Callable, Mapping

from orchestrator.config.rules import Problems
from orchestrator.config.yaml.numbers import MAX_DIGITS, digits_meant
from orchestrator.config.yaml.scalars import nearest

BITRATES = (10_000, 1_000_000)  #: bit/s, CiA 301
#: bit/s, those that CANopen devices know (CiA 301, 5.3).
CANOPEN_BITRATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
SIMULATED = ("virtual", "udp_multicast")  #: buses without a wire, hence without a bit rate
#: python-can's own; others may come from its plug-ins, so that an unlike name is let through.
INTERFACES = (
    "canalystii",
    "cantact",
    "etas",
    "gs_usb",
    "iscan",
    "ixxat",
    "kvaser",
    "neousys",
    "neovi",
    "nican",
    "nixnet",
    "pcan",
    "robotell",
    "seeedstudio",
    "serial",
    "slcan",
    "socketcan",
    "socketcand",
    "systec",
    "udp_multicast",
    "usb2can",
    "vector",
    "virtual",
)
#: What people call them.
ALIASES = {"peak": "pcan", "pcan-usb": "pcan", "candlelight": "gs_usb", "canable": "slcan", "lawicel": "slcan"}

#: A network interface's name in place of its kind.
_NETWORK = re.compile(r"v?can\d*|socket|native|linux")
_RATE = re.compile(r"(\d[\d ,._]*?) *([km])? *(?:bit/s|bits/s|bps|bit|baud|bd|b/s)?")
_FACTORS = {"k": 1000, "m": 1_000_000}
_SDO_ANSWERS = 0x580  #: + the node id


def bus_problems(buses: Mapping[str, Mapping[str, object]]) -> Problems:
    """Each bus has an interface and a bit rate, and stands in the file once."""
    seen: dict[object, str] = {}
    for name, bus in buses.items():
        yield from ((f"can.{name}{at}", text) for at, text in _bus(bus))
        first = seen.setdefault(repr((bus.get("interface"), bus.get("channel"))), name)
        if first != name:
            yield f"can.{name}", f"is the same interface and channel as {first}: name each bus once"


def _bus(bus: Mapping[str, object]) -> Problems:
    interface, bitrate = bus.get("interface"), bus.get("bitrate")
    if not isinstance(interface, str):
        yield "", "the key 'interface' is missing: which of python-can's interfaces, e.g. socketcan"
    elif interface not in INTERFACES and (meant := _interface_meant(interface)):
        yield ".interface", f"{interface!r} is not an interface of python-can; {meant}"
    if bitrate is None:
        if interface not in SIMULATED:
            yield "", "the key 'bitrate' is missing: the bus's bit/s (the BMU's document does not say it), e.g. 250000"
    elif isinstance(bitrate, bool) or not isinstance(bitrate, int) or not BITRATES[0] <= bitrate <= BITRATES[1]:
        rate = _bitrate_meant(str(bitrate))
        write = f"write {rate}, in bit/s" if rate else f"in bit/s, {BITRATES[0]} … {BITRATES[1]}, e.g. 250000"
        quotes = ", without quotes" if bitrate == str(rate) else ""
        yield ".bitrate", f"{bitrate!r} is no bit rate; {write}{quotes}"


def _interface_meant(interface: str) -> str:
    word = interface.casefold()
    if _NETWORK.fullmatch(word):
        return "did you mean socketcan? Its channel is the name that `ip link` shows, e.g. can0"
    near = ALIASES.get(word) or nearest(interface, INTERFACES)
    return f"did you mean {near}?" if near else ""


def _bitrate_meant(text: str) -> int | None:
    """A bit rate of CANopen's that was written with a unit, in kbit/s, or with separators; None if it is none."""
    match = _RATE.fullmatch(digits_meant(text.casefold()).strip()) if len(text) <= MAX_DIGITS else None
    if match is None:
        return None
    number = re.sub(r"[ _]|,(?=\d{3}$)", "", match[1]).replace(",", ".")
    if number.count(".") > 1:
        return None
    for factor in (_FACTORS[match[2]],) if match[2] else (1, 1000, 1_000_000):
        if (rate := round(float(number) * factor)) in CANOPEN_BITRATES:
            return rate
    return None


def nearest_bitrate(bitrate: int) -> int:
    """The bit rate of CANopen's that is the fewest times larger or smaller."""
    return min(CANOPEN_BITRATES, key=lambda rate: max(rate, bitrate) / min(rate, bitrate))


def device_of(bus: Mapping[str, object]) -> str:
    """The serial port of a CAN adapter that has one (slcan's channel may end in @ and its speed); "" for others."""
    channel = bus.get("channel")
    return channel.partition("@")[0] if isinstance(channel, str) and channel.startswith("/") else ""


def shared_port_problems(
    buses: Mapping[str, Mapping[str, object]], bays: Mapping[str, Mapping[str, object]]
) -> Problems:
    """No charger is on the serial port of a CAN adapter."""
    adapters = {os.path.realpath(device): name for name, bus in buses.items() if (device := device_of(bus))}
    for path, bay in bays.items():
        port = bay.get("charger.port")
        if isinstance(port, str) and (name := adapters.get(os.path.realpath(port))) is not None:
            yield (
                f"{path}.charger.port",
                f"is the port of the CAN adapter {name} (can.{name}.channel): a charger needs a port of its own",
            )


def filter_problems(buses: Mapping[str, Mapping[str, object]], bays: Mapping[str, Mapping[str, object]]) -> Problems:
    """A filter of the station's own must let through what its BMUs say."""
    for name, bus in buses.items():
        if "can_filters" not in bus:
            continue
        at, passed = f"can.{name}.can_filters", _passed(bus["can_filters"])
        if passed is None:
            yield at, "needs a list of {can_id: 0x590, can_mask: 0x7FF}: the ids that are let through"
            continue
        for bay in bays.values():
            node_id = bay.get("battery.node_id")
            if bay.get("battery.can") == name and isinstance(node_id, int) and not passed(_SDO_ANSWERS + node_id):
                yield (
                    at,
                    f"keeps back 0x{_SDO_ANSWERS + node_id:X}, the answers of the BMU with node id 0x{node_id:02X}",
                )


def _passed(filters: object) -> Callable[[int], bool] | None:
    """Which standard ids python-can's filters let through; None if they are not as it wants them."""
    if not isinstance(filters, list) or not filters:
        return None
    pairs: list[tuple[int, int]] = []
    for one in filters:
        if not isinstance(one, Mapping) or set(one) - {"extended"} != {"can_id", "can_mask"}:
            return None
        can_id, mask = one["can_id"], one["can_mask"]
        if not (isinstance(can_id, int) and isinstance(mask, int)):
            return None
        if one.get("extended") is not True:
            pairs.append((can_id, mask))
    return lambda cob_id: any((cob_id ^ can_id) & mask == 0 for can_id, mask in pairs)
