"""The direction of the code, as tables: who imports whom, who owns a library, who may touch the outside world.

The rules read the source, so an import inside a function or only for typing counts like any other.
"""

import ast
import re
import sys
from collections.abc import Callable, Iterator
from graphlib import TopologicalSorter

import pytest

from tests.sources import PACKAGE, Module, product

#: Part of the package → the parts, or single modules of them, it may import besides itself.
EDGES: dict[str, tuple[str, ...]] = {
    "keys": (),
    "model": (),
    "errors": ("model",),
    "extras": (),
    # Core makes causes; only the edges turn them into sentences.
    "text": ("model",),
    "protocol": ("errors", "keys", "model"),
    "config": ("errors", "keys", "model", "protocol.objects"),
    "interlock": ("config.policy", "config.station", "errors", "keys", "model"),
    "core": ("config.amperes", "config.policy", "config.station", "errors", "keys", "model"),
    # What must work when nothing else does. Only the station file needs PyYAML.
    # It is folded from the core's decisions by their states alone, and read without any of the core.
    "record": ("columns", "core.states", "errors", "model", "show", "text"),
    "lastresort": ("config.ports", "errors", "protocol.standby"),
    "link": ("errors", "extras", "keys", "lastresort.line_settings", "lastresort.port_owner", "model", "protocol"),
    # The devices know the link only as a typing.Protocol: they run on anything that sends and receives.
    "devices": ("config.policy", "config.station", "errors", "interlock", "keys", "model", "protocol"),
    "service": (
        "columns", "config", "core", "devices", "errors", "gist", "interlock", "keys", "lastresort", "link", "model",
        "page", "protocol", "record", "show", "text",
    ),
    "commissioning": (
        "config", "devices", "errors", "keys", "link", "model", "protocol", "service.socketfile", "text",
    ),
    # The emulators share no encoder or decoder with the product: a mistake in one could hide in the other.
    "sim": ("model", "protocol.objects"),
    # It checks and tries the core itself, on the models of the emulators, without any line in between.
    "workbench": (
        "columns", "config", "core", "errors", "extras", "keys", "model", "protocol.objects", "record.utc",
        "service.journal_files", "service.parts", "service.records", "service.rows", "service.timespan", "sim.charger",
        "sim.chemistry", "sim.pack", "text",
    ),
    "columns": (),
    "show": ("model", "text"),
    "gist": ("model", "show"),
    "page": ("columns", "gist", "model", "show", "text"),
    "output": ("model", "show", "text"),
    "demo": ("config", "errors", "keys", "lastresort.asking", "model", "service", "show", "sim", "text"),
    # A process of its own, which knows the controller by its sockets and the record by its files.
    "northbound": (
        "config", "errors", "extras", "lastresort.asking", "model", "record", "service.history_verb", "show", "text",
    ),
    "cli": (
        "columns", "commissioning", "config", "core", "demo", "devices", "errors", "interlock", "keys", "lastresort",
        "link", "model", "northbound", "output", "protocol", "record", "service", "shell", "show", "sim", "text",
        "workbench",
    ),
    "shell": ("lastresort.asking", "service.where", "workbench.verbs"),
    "__main__": ("cli", "lastresort.estop", "lastresort.guardian"),
}  # fmt: skip
#: Third-party library → its owners; nobody else imports it, and no other library is imported.
OWNERS: dict[str, tuple[str, ...]] = {
    "can": ("link.can", "sim"),
    "canopen": ("link.can",),
    "cattrs": ("workbench.replay.converting",),
    "distributed": ("workbench.simulate.sweep",),
    "durand": ("sim",),
    "gpiod": ("link.gpio",),
    "h11": ("northbound.connection",),
    "jinja2": ("workbench.draw.page",),
    "matplotlib": ("workbench.draw.plot", "workbench.draw.tradeoff"),
    "msgpack": ("link.can_socket",),
    "pygraphviz": ("workbench.draw.drawing",),
    "rich": ("demo",),
    "serial": ("link.serial",),
    "shtab": ("shell.completion",),
    "starlette": ("northbound",),
    "transitions": ("core.machine",),
    "uvicorn": ("northbound.connection", "northbound.server"),
    "yaml": ("config",),
}
#: These always give the same answer to the same arguments: of the standard library they may use only LIBRARY.
PURE = ("core", "errors", "interlock", "keys", "model", "protocol", "text")
LIBRARY = frozenset({
    "abc", "bisect", "collections", "contextlib", "dataclasses", "decimal", "enum", "fractions", "functools", "heapq",
    "itertools", "math", "operator", "re", "statistics", "string", "struct", "types", "typing",
})  # fmt: skip
#: … and none of these built-in functions.
IMPURE_CALLS = frozenset({"__import__", "breakpoint", "eval", "exec", "input", "open", "print"})
CLOCK_READERS = (
    "cli",
    "commissioning",
    "demo",
    "lastresort",
    "northbound",
    "record.utc",
    "service",
    "sim",
    "workbench.verbs",
)
CLOCKS = frozenset({
    "clock_gettime", "clock_gettime_ns", "ctime", "gmtime", "localtime", "monotonic", "monotonic_ns", "perf_counter",
    "perf_counter_ns", "process_time", "process_time_ns", "strftime", "thread_time", "thread_time_ns", "time",
    "time_ns",
})  # fmt: skip
MAX_FILE_LINES = 250
#: Longer for now, until they are split.
LONGER: dict[str, int] = {"core.course": 280, "core.track": 270}
MAX_FUNCTION_LINES = 40


def within(name: str, places: tuple[str, ...]) -> bool:
    return any(name == place or name.startswith(f"{place}.") for place in places)


def edges(module: Module) -> Iterator[str]:
    """Parts import only parts before them."""
    allowed = EDGES.get(module.part)
    if module.name and allowed is None:
        yield f"{module.name}: this part has no row in EDGES"
        return
    for line, name in module.imports():
        package, _, target = name.partition(".")
        if package == PACKAGE and target != "__version__" and not within(target, (module.part, *(allowed or ()))):
            yield f"{module.name}:{line}: may not import {name}"


def owners(module: Module) -> Iterator[str]:
    """One module per library; libraries without an owner are not imported."""
    for line, name in module.imports():
        library = name.partition(".")[0]
        if library in sys.stdlib_module_names or library == PACKAGE:
            continue
        if not within(module.name, OWNERS.get(library, ())):
            yield f"{module.name}:{line}: {library} belongs to {OWNERS.get(library, 'nobody')}"


def purity(module: Module) -> Iterator[str]:
    """Pure parts have no clock, log, thread, file, socket, chance or environment."""
    if not within(module.name, PURE):
        return
    for line, name in module.imports():
        library = name.partition(".")[0]
        if library in sys.stdlib_module_names and library not in LIBRARY:
            yield f"{module.name}:{line}: {library} is not for a pure part"
    for node in module.nodes():
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in IMPURE_CALLS:
            yield f"{module.name}:{node.lineno}: {node.func.id}() is not for a pure part"


def clocks(module: Module) -> Iterator[str]:
    """Time is an argument everywhere except in the loops."""
    if within(module.name, CLOCK_READERS):
        return
    for line, name in module.imports():
        library, _, what = name.partition(".")
        if library == "datetime" or (library == "time" and what in CLOCKS):
            yield f"{module.name}:{line}: {name} reads a clock"
    for node in module.nodes():
        if isinstance(node, ast.Import) and any(alias.name == "time" and alias.asname for alias in node.names):
            yield f"{module.name}:{node.lineno}: time under another name"
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):  # noqa: SIM102 - one question a line
            if node.value.id == "time" and node.attr in CLOCKS:
                yield f"{module.name}:{node.lineno}: time.{node.attr} reads a clock"


def light_packages(module: Module) -> Iterator[str]:
    """Where single modules of a part may be imported, its __init__ imports nothing else."""
    piecemeal = {target.partition(".")[0] for allowed in EDGES.values() for target in allowed if "." in target}
    if module.is_package and module.name in ("", *piecemeal):
        yield from (f"{module.name}:{line}: imports {name}" for line, name in module.imports())


def sizes(module: Module) -> Iterator[str]:
    """Files and functions small enough to keep in one's head."""
    lines = module.source.count("\n")
    allowed = LONGER.get(module.name, MAX_FILE_LINES)
    if lines > allowed:
        yield f"{module.name}: {lines} lines, allowed are {allowed}"
    for node in module.nodes():
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            length = (node.end_lineno or node.lineno) - node.lineno + 1
            if length > MAX_FUNCTION_LINES:
                yield f"{module.name}:{node.lineno}: {node.name}() has {length} lines, allowed are {MAX_FUNCTION_LINES}"


Rule = Callable[[Module], Iterator[str]]
RULES: tuple[Rule, ...] = (edges, owners, purity, clocks, light_packages, sizes)


def name_of(value: object) -> str:
    return getattr(value, "__name__", "")


@pytest.mark.parametrize("rule", RULES, ids=name_of)
def test_the_product_keeps_the_rule(rule: Rule) -> None:
    modules = list(product())
    assert "model" in {module.name for module in modules}, "the product was not found"
    assert [complaint for module in modules for complaint in rule(module)] == []


def test_the_edges_point_one_way() -> None:
    parts = {part: {target.partition(".")[0] for target in allowed} for part, allowed in EDGES.items()}
    assert set(TopologicalSorter(parts).static_order()) == set(EDGES)


#: (rule, module, source that breaks the rule)
BROKEN: tuple[tuple[Rule, str, str], ...] = (
    (edges, "model", "from orchestrator.errors import LinkError"),
    (edges, "core.decide", "from orchestrator.config.load import load"),
    (edges, "core.decide", "from orchestrator.config import load"),
    (edges, "core.decide", "import orchestrator.protocol.charger"),
    (edges, "core.decide", "import orchestrator"),
    (edges, "core.decide", "from orchestrator import service"),
    (edges, "core.decide", "from ..protocol import charger"),
    (edges, "core.decide", "def f():\n    from orchestrator.link.serial import Port"),
    (edges, "devices.charger", "if TYPE_CHECKING:\n    from orchestrator.link.serial import Port"),
    (edges, "sim.charger", "from orchestrator.protocol.frame import FrameDecoder"),
    (edges, "core.decide", "from orchestrator.modelling import x"),
    (edges, "weather", "x = 1"),
    (owners, "service.loop", "import serial"),
    (owners, "service.loop", "from serial.rs485 import RS485Settings"),
    (owners, "link.serial", "import can"),
    (owners, "link.canopen", "import can"),
    (owners, "sim.bmu", "import canopen"),
    (owners, "core.decide", "from transitions import Machine"),
    (owners, "cli", "import yaml"),
    (owners, "service.status", "import rich.table"),
    (owners, "service.loop", "import requests"),
    (owners, "service.loop", "from tests.waiting import wait_until"),
    (purity, "core.decide", "import time"),
    (purity, "core.decide", "from logging import getLogger"),
    (purity, "core.decide", "def f():\n    import os"),
    (purity, "core.witnesses.measured", "import threading"),
    (purity, "protocol.frame", "import socket"),
    (purity, "interlock", "import random"),
    (purity, "interlock", "open('x')"),
    (purity, "protocol.frame", "print('x')"),
    (clocks, "link.serial", "from time import monotonic"),
    (clocks, "link.serial", "import time\nnow_s = time.monotonic()"),
    (clocks, "devices.charger", "import time\nclock = time.perf_counter_ns"),
    (clocks, "devices.charger", "import time as t"),
    (clocks, "config.load", "from datetime import datetime"),
    (light_packages, "config", "from orchestrator.config.load import load"),
    (light_packages, "", "import orchestrator.cli"),
    (sizes, "core.decide", "x = 1\n" * 251),
    (sizes, "core.decide", "def f():\n" + "    x = 1\n" * 40),
)


@pytest.mark.parametrize(("rule", "name", "source"), BROKEN, ids=name_of)
def test_a_broken_rule_is_seen(rule: Rule, name: str, source: str) -> None:
    assert list(rule(Module(name, source, is_package=rule is light_packages)))


#: (module, source that keeps all rules)
KEPT: tuple[tuple[str, str], ...] = (
    ("core.decide", "from orchestrator.config.policy import Policy"),
    ("core.decide", "from orchestrator.config import policy"),
    ("core.decide", "from .machine import Machine\nfrom ..model import State\nimport math"),
    ("core.machine", "from transitions import Machine"),
    ("link.serial", "import serial.rs485\nimport time\ntime.sleep(1)"),
    ("service.loop", "import time\nfrom orchestrator import __version__\nnow_s = time.monotonic()"),
    ("demo", "from rich.live import Live"),
)


@pytest.mark.parametrize(("name", "source"), KEPT, ids=name_of)
def test_what_is_allowed_is_not_complained_about(name: str, source: str) -> None:
    assert [complaint for rule in RULES for complaint in rule(Module(name, source))] == []


#: Parts that make causes. A sentence in them could be neither translated nor compared.
SILENT = (
    "core", "devices", "interlock", "link", "model", "protocol.sdo", "protocol.words", "service", "show",
    "gist", "northbound", "page",
)  # fmt: skip
WORD, WORDS = re.compile("[('\"]?[A-Za-z]?[a-z]+['a-z]*[.,;:)'\"]*"), 3
#: Errors of the program, of files and of the command line are for who mends them, and in English.
DIAGNOSTICS = frozenset({"ValueError", "RefusedError", "UsageError", "SerialException", "NoServiceError"})
#: Calls of argparse: what `--help` prints.
HELP = frozenset({"add_argument", "add_parser"})
#: (module, the beginning of a sentence still in it)
SAID = frozenset({
    ("core.machine", " is not possible in "),  # an error of the program
    ("devices.bus_load", ""),  # warnings of `check`: about a file
    ("link.can_driver", "Transmit buffer full"),  # python-can's own words
    ("link.can_gate", ""),  # why a frame of ours is none: an error of the program
    ("link.can_text", "ip link set "),  # a command
    ("service.sentences", ""),  # what the second format said
    ("service.stateformat", "it is nested deeper"),  # about a file
    *(("service.verbs", said) for said in (  # the command line, and a service that cannot be reached
        "let a bay charge", "stop charging", "clear latched faults", "names, or patterns",
    )),
    ("link.gpio", "used by "),  # what `probe` shows of a line
    ("service.reach", ""),  # what `check` says of a file
    ("service.journal_files", ""),  # the same, of a journal
    ("service.bay", " in "),  # where an exception of our own was raised
    ("northbound.stream", "event: "),  # no words, but what a browser reads
    ("northbound.stream", "id: "),  # the same
    ("northbound.user_verb", "# Who may log in"),  # a comment in a file
    ("northbound.verbs", "the page needs the package"),  # what is not installed
})  # fmt: skip


def sentences(module: Module) -> Iterator[str]:
    """No text of three words or more but in docstrings, diagnostics and help."""
    if not within(module.name, SILENT):
        return
    tree = ast.parse(module.source, module.name)
    free = {id(part) for node in ast.walk(tree) if is_free(node) for part in ast.walk(node)}
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if id(node) in free or id(node) in inside:
            continue
        text = " ".join(texts(node))
        said = any(module.name == name and text.startswith(begins) for name, begins in SAID)
        enough = WORDS - isinstance(node, ast.JoinedStr)  # a value is as good as a word
        if sum(bool(WORD.fullmatch(word)) for word in text.split()) >= enough and not said:
            yield f"{module.name}:{getattr(node, 'lineno', 0)}: says {text!r}"


def texts(node: ast.AST) -> Iterator[str]:
    """The texts of a string, also of one with values in it."""
    if isinstance(node, ast.JoinedStr):
        yield from (text for part in node.values for text in texts(part))
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value


def is_free(node: ast.AST) -> bool:
    """Whether what stands in it is not said of a bay: docstrings, diagnostics, help, types."""
    if isinstance(node, ast.Raise):
        return isinstance(node.exc, ast.Call) and called(node.exc) in DIAGNOSTICS
    if isinstance(node, ast.Call):
        return called(node) in HELP | {"cast"}
    if isinstance(node, ast.Subscript):
        return isinstance(node.value, ast.Name) and node.value.id == "Annotated"  # what a member of a record means
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def called(call: ast.Call) -> str:
    """The name of what is called, without what stands before a dot."""
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def test_what_is_said_of_a_bay_is_said_in_the_catalogue_alone() -> None:
    assert [complaint for module in product() for complaint in sentences(module)] == []


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("core.decide", '"""Of the module."""\nx = f"the pack has {y} V, below"\n'),
        ("service.bay", 'x = f"{bay} is {state} again"\n'),
        ("devices.charger", 'raise LinkError("the port is gone")\n'),
        ("link.serial", 'x = {1: "no such port"}\n'),
    ],
)
def test_a_sentence_elsewhere_is_seen(name: str, source: str) -> None:
    assert list(sentences(Module(name, source)))


@pytest.mark.parametrize(
    "source",
    [
        '"""Of the module, in words."""\nx = "a_word", "two words"\n',
        'raise ValueError(f"{x} is no cause of anything")\n',
        'parser.add_argument("--all", help="every bay of the station")\n',
        'x = cast("Mapping[str, Mapping[str, object]]", y)\n',
    ],
)
def test_what_is_no_sentence_about_a_bay_is_let_be(source: str) -> None:
    assert not list(sentences(Module("core.decide", source)))
