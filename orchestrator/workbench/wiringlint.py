"""Lints a station's wiring: names that change, ids and bit rates that no device has, limits wider than the pack's."""

import os
import re
from collections.abc import Mapping
from pathlib import Path

from orchestrator.config.can_rules import CANOPEN_BITRATES, SIMULATED, device_of, nearest_bitrate
from orchestrator.config.policy import Policy
from orchestrator.config.rules import Problems, Rule, problems
from orchestrator.config.shipped import shipped_dir
from orchestrator.config.station import Rs485
from orchestrator.config.station_rules import bays_of
from orchestrator.keys import Range, Source

#: A BMU's node id is its board's switch + this (BMU document, 2.1).
FIRST_NODE_ID = 0x10
#: Where udev names each serial port by its place, and by its adapter's serial number.
LINKS = (Path("/dev/serial/by-path"), Path("/dev/serial/by-id"))
#: The steps of the shipped examples. They differ by model, and no document has them.
EXAMPLE_STEPS_A = (2.0, 5.0, 8.0, 11.0, 14.0)
_MEASURE = (
    "these are the example's steps, not your charger's: measure each with a clamp meter and write what flows at most; "
    "if these are the figures that you measured, say so by writing tolerance_pct: 0 as well"
)

_NUMBERED = re.compile(r"/dev/tty(USB|ACM)\d+")
_USB = re.compile(r"ttyUSB|ttyACM|/serial/by-id/|usb-")
#: A name that somebody left for the reader to fill in, as the shipped examples do.
_PLACEHOLDER = re.compile(r"(^|/)CHECK(/|$)|…|\.\.\.|<.*>")


def wiring_lint(values: Mapping[str, object], written: Source) -> Problems:
    """Warnings about each bay and each CAN bus; a shipped example may keep its placeholders."""
    example = Path(os.path.realpath(written.file)).is_relative_to(os.path.realpath(shipped_dir() / "configs"))
    for path, bay in bays_of(values).items():
        yield from ((f"{path}.{at}", text) for at, text in problems(_BAY_RULES, bay))
        if not example:
            yield from ((f"{path}.{at}", text) for at, text in problems(_COPY_RULES, bay))
            if bay.get("charger.steps_a") == EXAMPLE_STEPS_A and f"{path}.charger.tolerance_pct" not in written.lines:
                yield f"{path}.charger.steps_a", _MEASURE
    buses = values.get("can")
    for name, bus in buses.items() if isinstance(buses, Mapping) else ():
        yield from ((f"can.{name}.{at}", text) for at, text in _bus(bus))


def _node_id(node_id: int) -> Problems:
    if node_id >= FIRST_NODE_ID:
        return
    switch = f"0x{FIRST_NODE_ID + node_id:02X} for switch {node_id}"
    # Two digits are a hexadecimal id without its 0x.
    write = f"{switch}, or 0x{node_id} if that was meant" if node_id >= 10 else switch
    text = f"no BMU has the id {node_id} (0x{node_id:02X}): it is the board's switch + 0x10; write {write}"
    yield "battery.node_id", text


def _port_name(port: str) -> Problems:
    if _NUMBERED.fullmatch(port):
        yield "charger.port", unstable(port)


def _placeholder(port: str) -> Problems:
    if _PLACEHOLDER.search(port):
        text = (
            "is still the example's placeholder: write the name that `ls -l /dev/serial/by-path` shows for the adapter"
        )
        yield "charger.port", f"{port} {text}"


def unstable(port: str, links: tuple[Path, ...] = LINKS) -> str:
    """Why this name is not to be relied on, and which one is; this machine's own, if the adapter is plugged in."""
    device = os.path.realpath(port)
    stable = next((link for folder in links for link in _links(folder) if os.path.realpath(link) == device), None)
    write = f"write {stable}" if stable else "write its name below /dev/serial/by-path or /dev/serial/by-id"
    return f"{port} may be another adapter after the next plug or boot: {write}"


def _links(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []


def _direction(port: str, rs485: Rs485) -> Problems:
    if rs485 is Rs485.KERNEL and (_USB.search(port) or _USB.search(os.path.realpath(port))):
        text = "USB adapters switch the line's direction by themselves, and their drivers cannot: write off"
        yield "charger.rs485", text


def _voltage(limit_v: float, policy: Policy) -> Problems:
    pack_v = policy.pack.voltage_v.high
    if limit_v > pack_v:
        yield "limits.voltage_v", _wider(f"{limit_v:g} V", policy, "voltage_v", f"{pack_v:g} V", f"{pack_v:g}")


def _current(limit_a: float, policy: Policy) -> Problems:
    pack_a = policy.pack.current_a
    if limit_a > pack_a:
        yield "limits.current_a", _wider(f"{limit_a:g} A", policy, "current_a", f"{pack_a:g} A", f"{pack_a:g}")


def _temperature(limit: Range, policy: Policy) -> Problems:
    pack = policy.pack.temperature_c
    if limit.low < pack.low or limit.high > pack.high:
        write = f"[{max(limit.low, pack.low):g}, {min(limit.high, pack.high):g}]"
        yield "limits.temperature_c", _wider(f"{limit} °C", policy, "temperature_c", f"{pack} °C", write)


def _wider(limit: str, policy: Policy, key: str, pack: str, write: str) -> str:
    place = policy.source.at(f"pack.{key}")
    return (
        f"{limit} is wider than the pack of {policy.policy} allows, {pack} ({place}): write {write}, so that the last "
        "gate before the charger holds the pack's limit as well"
    )


_BAY_RULES: tuple[Rule, ...] = (
    Rule(_node_id, ("battery.node_id",)),
    Rule(_port_name, ("charger.port",)),
    Rule(_direction, ("charger.port", "charger.rs485")),
    Rule(_voltage, ("limits.voltage_v", "policy")),
    Rule(_current, ("limits.current_a", "policy")),
    Rule(_temperature, ("limits.temperature_c", "policy")),
)


#: Rules for a station that is somebody's own.
_COPY_RULES: tuple[Rule, ...] = (Rule(_placeholder, ("charger.port",)),)


def _bus(bus: Mapping[str, object]) -> Problems:
    bitrate, device = bus.get("bitrate"), device_of(bus)
    if isinstance(bitrate, int) and bitrate not in CANOPEN_BITRATES and bus.get("interface") not in SIMULATED:
        known = ", ".join(f"{rate // 1000}" for rate in CANOPEN_BITRATES)
        text = f"{bitrate / 1000:g} kbit/s is none of CANopen's bit rates ({known} kbit/s)"
        yield "bitrate", f"{text}: was {nearest_bitrate(bitrate)} meant?"
    if _NUMBERED.fullmatch(device):
        yield "channel", unstable(device)
