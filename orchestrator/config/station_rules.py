"""What must hold between the keys of one station, and between it and the policies and maps that it names."""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path

from orchestrator.config.amperes import DIGITS
from orchestrator.config.can_rules import bus_problems, filter_problems, shared_port_problems
from orchestrator.config.names import name_problem
from orchestrator.config.policy import Policy
from orchestrator.config.rules import Problems, Rule, problems
from orchestrator.config.supply_rules import supply_problems
from orchestrator.config.yaml.scalars import did_you_mean
from orchestrator.keys import Range
from orchestrator.protocol.objects import ObjectMap

MAX_BAYS = 128
STEPS = 5  #: the charger has five current-limit steps (protocol 2/2, §4.2)
SOCKET_PATH_MAX = 107  #: bytes, Linux' sun_path without its closing 0
Values = Mapping[str, object]


def station_problems(values: Values) -> Problems:
    """All that the rules find in one station; what is a finding already is left out."""
    yield from problems(_STATION_RULES, values)
    yield from _viewers_without_socket(values)
    bays = bays_of(values)
    for path, bay in bays.items():
        for at, text in problems(_BAY_RULES, bay):
            yield f"{path}.{at}", text
    if len(bays) > MAX_BAYS:
        yield "bays", f"{len(bays)} bays; one gateway serves at most {MAX_BAYS}"
    yield from supply_problems(values, [str(name) for bay in bays.values() if (name := bay.get("name")) is not None])
    for name, identity, text in _UNIQUE:
        yield from _unique(bays, name, identity, text)
    if isinstance(buses := values.get("can"), Mapping):
        for path, bay in bays.items():
            if (bus := bay.get("battery.can")) is not None and bus not in buses:
                yield f"{path}.battery.can", f"the station has no CAN bus {bus!r}; {did_you_mean(str(bus), buses)}"
        yield from filter_problems(buses, bays)
        yield from shared_port_problems(buses, bays)


def bays_of(values: Values) -> dict[str, dict[str, object]]:
    """The values of each bay by their paths below it."""
    bays: dict[str, dict[str, object]] = {}
    for path, value in values.items():
        if match := re.fullmatch(r"(bays\[\d+\])\.(.+)", path):
            bays.setdefault(match[1], {})[match[2]] = value
    return bays


# --- between bays ----------------------------------------------------------------------------------------------------


def _name(bay: Values) -> Iterator[object]:
    if (name := bay.get("name")) is not None:
        yield str(name).casefold()


def _port(bay: Values) -> Iterator[object]:
    """The device behind the port's name, so that two names of one adapter are found out."""
    if (port := bay.get("charger.port")) is not None:
        yield os.path.realpath(str(port))


def _node(bay: Values) -> Iterator[object]:
    bus, node_id = bay.get("battery.can"), bay.get("battery.node_id")
    if bus is not None and node_id is not None:
        yield bus, node_id


def _line(bay: Values) -> Iterator[object]:
    chip, line = bay.get("contactor.chip"), bay.get("contactor.line")
    if chip is not None and line is not None:
        yield os.path.realpath(str(chip)), line


_UNIQUE: tuple[tuple[str, Callable[[Values], Iterable[object]], str], ...] = (
    ("name", _name, "{bay} has this name already; each bay needs its own"),
    ("charger.port", _port, "{bay} is on this port already; each charger needs its own port (its address is fixed)"),
    ("battery.node_id", _node, "{bay} has this node id on the same bus already; set the BMU's switch to another"),
    ("contactor.line", _line, "{bay} has this line already; each contactor needs its own line"),
)


def _unique(bays: Mapping[str, Values], at: str, identity: Callable[[Values], Iterable[object]], text: str) -> Problems:
    seen: dict[object, str] = {}
    for path, bay in bays.items():
        for key in identity(bay):
            first = seen.setdefault(key, path)
            if first != path:
                name = bays[first].get("name")
                yield f"{path}.{at}", text.format(bay=f"{first} ({name})" if name else first)


# --- one station -----------------------------------------------------------------------------------------------------


def _station_name(name: str) -> Problems:
    if problem := name_problem(name):
        yield "station", problem


def _socket(socket: Path, name: str = "socket") -> Problems:
    length = len(os.fsencode(socket.absolute()))
    if length > SOCKET_PATH_MAX:
        yield f"control.{name}", f"the whole path has {length} bytes; Linux allows a socket {SOCKET_PATH_MAX}"


def _view_socket(socket: Path) -> Problems:
    yield from _socket(socket, "view_socket")


def _two_sockets(socket: Path, view_socket: Path) -> Problems:
    if os.path.normpath(socket) == os.path.normpath(view_socket):
        yield "control.view_socket", "this is the control socket; give viewers another one"


def _viewers_without_socket(values: Values) -> Problems:
    """A rule that a missing key fails: rules skip those."""
    if values.get("control.view_group") is not None and values.get("control.view_socket") is None:
        yield "control.view_group", "there is no control.view_socket; name one, or leave this out"


_STATION_RULES: tuple[Rule, ...] = (
    Rule(_station_name, ("station",)),
    Rule(bus_problems, ("can",)),
    Rule(_socket, ("control.socket",)),
    Rule(_view_socket, ("control.view_socket",)),
    Rule(_two_sockets, ("control.socket", "control.view_socket")),
)


# --- one bay ---------------------------------------------------------------------------------------------------------


def _bay_name(name: str) -> Problems:
    if problem := name_problem(name):
        yield "name", problem


def step_problems(steps_a: tuple[float, ...]) -> Problems:
    """The five current-limit steps of a charger, below the key `charger`."""
    if len(steps_a) != STEPS:
        commas = " (a decimal has a point, 2.5, not a comma)" if len(steps_a) > STEPS else ""
        yield (
            "charger.steps_a",
            f"{len(steps_a)} values; the charger has {STEPS} current-limit steps, lowest first{commas}",
        )
    for i, (lower, upper) in enumerate(pairwise(steps_a), start=1):
        if upper <= lower:
            yield (
                f"charger.steps_a[{i}]",
                f"{upper:g} A is not above the step before, {lower:g} A: write the lowest first",
            )
            return  # steps from the highest down are one mistake


def lowest_step_problems(steps_a: tuple[float, ...], current_a: float) -> Problems:
    """At least one of them may be used."""
    if steps_a[0] > current_a:
        yield (
            "charger.steps_a[0]",
            f"even the lowest step, {steps_a[0]:g} A, is above limits.current_a, {current_a:g} A: "
            "no step would be allowed",
        )


def _tolerance(steps_a: tuple[float, ...], tolerance_pct: float, current_a: float) -> Problems:
    """At least one of them may be used whatever flows on it."""
    most_a = round(steps_a[0] * (1 + tolerance_pct / 100), DIGITS)
    if steps_a[0] <= current_a < most_a:
        yield (
            "charger.tolerance_pct",
            f"even on the lowest step, {steps_a[0]:g} A, {most_a:g} A may flow, above limits.current_a, "
            f"{current_a:g} A: no step would be allowed",
        )


def _draw(draw_w: tuple[float, ...], idle_w: float) -> Problems:
    """What a charger draws on its steps, below the key `charger`."""
    if len(draw_w) != STEPS:
        yield "charger.draw_w", f"{len(draw_w)} values; the charger has {STEPS} current-limit steps, lowest first"
    if draw_w[0] < idle_w:
        yield "charger.draw_w[0]", f"{draw_w[0]:g} W are less than it draws in standby, {idle_w:g} W (idle_w)"
    for number, (lower, upper) in enumerate(pairwise(draw_w), start=1):
        if upper < lower:
            yield f"charger.draw_w[{number}]", f"{upper:g} W are less than on the step before, {lower:g} W"
            return


def _voltage(policy: Policy, voltage_v: float) -> Problems:
    if policy.pack.voltage_v.high > voltage_v:
        yield (
            "policy",
            f"{policy.policy} allows {policy.pack.voltage_v.high:g} V ({policy.source.at('pack.voltage_v')}), "
            f"this bay's limits.voltage_v only {voltage_v:g} V",
        )


def _temperature(policy: Policy, limits: Range) -> Problems:
    pack = policy.pack.temperature_c
    if pack.low < limits.low or pack.high > limits.high:
        yield (
            "policy",
            f"{policy.policy} allows {pack} °C ({policy.source.at('pack.temperature_c')}), "
            f"this bay's limits.temperature_c only {limits} °C",
        )


def _tpdos(object_map: ObjectMap, _tpdo_s: float) -> Problems:
    if not object_map.tpdos:
        yield (
            "battery.tpdo_s",
            f"the object map {object_map.map} ({object_map.source.file}) does not say what the TPDOs carry; "
            "write null, or add `tpdos` to a map of your own",
        )


_BAY_RULES: tuple[Rule, ...] = (
    Rule(_bay_name, ("name",)),
    Rule(step_problems, ("charger.steps_a",)),
    Rule(_draw, ("charger.draw_w", "charger.idle_w")),
    Rule(lowest_step_problems, ("charger.steps_a", "limits.current_a")),
    Rule(_tolerance, ("charger.steps_a", "charger.tolerance_pct", "limits.current_a")),
    Rule(_voltage, ("policy", "limits.voltage_v")),
    Rule(_temperature, ("policy", "limits.temperature_c")),
    Rule(_tpdos, ("battery.map", "battery.tpdo_s")),
)
