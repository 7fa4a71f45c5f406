"""Hand-written files: whatever is in them, the result is a printable finding or a valid record."""

import os
import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from unittest.mock import patch
from zlib import crc32

from orchestrator.config import load, ports
from orchestrator.config.station import Station
from orchestrator.config.yaml import tree
from orchestrator.config.yaml.reader import MAX_FINDINGS
from orchestrator.config.yaml.tree import MAX_FINDINGS as MAX_YAML_FINDINGS
from orchestrator.errors import ConfigError, Finding
from tests.fuzz.target import Target, kind_of_word, scratch

MAX_TEXT = 6000  #: characters of a finding: room for a path of 4096 bytes, and all keys of a record
#: A token of our files: a comment, a quoted string, a word or number, one character, an indentation.
TOKEN = re.compile(rb"\n *(?:- )?|#[^\n]*|\"[^\"\n]*\"|'[^'\n]*'|[\w./-]+|.", re.DOTALL)


#: One of each kind, as short as possible: small is quick, and the optional parts are among the words.
STATION = b"""station: s
can: {can0: {interface: virtual, channel: c}}
bays:
  - name: b
    charger: {port: /dev/x, control: manual, steps_a: [2, 5, 8, 11, 14]}
    battery: {can: can0, node_id: 16, map: map.yaml}
    limits: {voltage_v: 58.4, current_a: 15, temperature_c: [0, 45]}
    policy: policy.yaml
control: {socket: s.sock}
journal: {directory: j}
"""
POLICY = b"""policy: p
pack: {cells_in_series: 13, voltage_v: [39, 55.2], temperature_c: [0, 45], soh_min_pct: 60}
start: {soc_below_pct: 98}
recharge: {soc_below_pct: 95}
current:
  raise_after_s: 60
  temperature_c: [{from: 0, to: 45, step: 4}]
finish: {soc_pct: 100, max_hours: 12, max_ah: 44}
"""
MAP = b"""map: m
objects:
  - {index: 0x6000, size: 4, sweep: fast, fields: [
      {name: voltage_v, first_bit: 16, width: 16, scale: 0.01, range: [0, 100], evidence: assumed},
      {name: current_a, first_bit: 0, width: 16, signed: true, scale: 0.01, range: [-99, 99], evidence: assumed}]}
  - {index: 0x6001, size: 4, sweep: fast, fields: [
      {name: status, first_bit: 16, width: 16, range: [0, 127], evidence: assumed},
      {name: temperature_c, first_bit: 0, width: 16, signed: true, scale: 0.1, range: [-39, 124], evidence: assumed}]}
  - {index: 0x6002, size: 2, sweep: slow, fields: [
      {name: soc_pct, first_bit: 8, width: 8, range: [0, 100], evidence: assumed},
      {name: soh_pct, first_bit: 0, width: 8, range: [0, 100], evidence: assumed}]}
"""
OPTIONAL = [
    b"\n  soc_pct: [{from: 0, to: 90, step: 4}, {from: 90, to: 100, step: 2}]",
    b"\n  voltage_v: [{from: 0, to: 60, step: 1}]",
    b"\nprecharge: {below_v: 40, pulse: {until_v: 39.5, max_min: 10}, continuous: {max_min: 20}, "
    b"rise: {volts: 0.3, within_min: 5}}\n", b", taper: {below_a: 1, above_v: 53, for_s: 120}",
    b"\nfaults: {temperature_trip_c: 55}\n", b", sweep_s: 0.1", b", heartbeat_s: null", b", tpdo_s: 0.1",
    b", rs485: kernel", b", unavailable: 0xFFFF", b", offset: -40", b"\ntpdos: [{number: 1, objects: [0x6000]}]\n",
]  # fmt: skip

DIRECTORY = scratch()
FILE = DIRECTORY / "file.yaml"
LOADERS: tuple[Callable[[Path], object], ...] = (load.load_policy, load.load_map, load.load_station)
for name, text in (("policy.yaml", POLICY), ("map.yaml", MAP)):
    (DIRECTORY / name).write_bytes(text)


#: The same bytes are parsed only once for all readers.
parse = lru_cache(maxsize=16)(tree.parse)


def one(data: bytes) -> None:
    """`check`, `load_…` and the emergency stop's own reader on one file."""
    FILE.write_bytes(data)
    with patch.object(load, "parse", parse), patch.object(ports, "parse", parse):
        _read(data)


def _read(data: bytes) -> None:
    findings = load.check([FILE])
    lines = data.split(b"\n")
    assert len(findings) <= MAX_FINDINGS + 2 * MAX_YAML_FINDINGS
    for finding in findings:
        _is_shown_well(finding, lines)
    loaders = LOADERS if not findings else LOADERS[crc32(data) % 8 :][:1]
    loaded = [record for loader in loaders if (record := _loaded(loader, lines)) is not None]
    assert len(loaded) == (0 if findings else 1), "`check` and loading say different things"
    found = ports.wiring(FILE)
    assert b"\0" not in os.fsencode("".join(found.ports) + found.socket), "no system call takes that"
    for record in loaded:
        # More may look like a port, as in `port: /dev/my port`: trying too many is fine, missing one is not.
        assert not isinstance(record, Station) or {bay.name for bay in record.bays} <= set(found.ports.values())


def _loaded(loader: Callable[[Path], object], lines: list[bytes]) -> object:
    try:
        return loader(FILE)
    except ConfigError as error:
        assert error.findings
        for finding in error.findings:
            _is_shown_well(finding, lines)
        return None


def _is_shown_well(finding: Finding, lines: list[bytes]) -> None:
    """FILE:LINE:COLUMN: error: one line, printable on any terminal, with an existing position."""
    shown = str(finding)
    assert re.match(re.escape(finding.file) + r":[1-9]\d*:[1-9]\d*: error: .", shown), shown
    assert "\n" not in shown and shown.isprintable(), ascii(shown)
    assert len(finding.text) <= MAX_TEXT, f"{len(finding.text)} characters"
    if finding.file == str(FILE):
        assert finding.line <= len(lines) + 1, shown
        assert finding.column <= max(map(len, lines)) + 1, shown


TARGET = Target(
    one,
    TOKEN.findall,
    kind_of_word,
    [STATION, POLICY, MAP],
    [
        *OPTIONAL, *(b"\n" + b" " * spaces for spaces in (0, 2, 4, 6)), b"\n  - ", b"\n- ", b"\n---\n", b"\n...\n",
        b"%YAML 1.1\n", b"%YAML 1." + b"1" * 600 + b"\n", b"%TAG ! tag:x,2000:\n", b": ", b"? ", b"- ", b"{", b"}",
        b"[", b"]", b", ", b"&a ", b"*a", b"!!str ", b"!x ", b"<<: ", b"| \n  x", b">-\n  x", b"|9", b"'", b'"', b"''",
        b'""', b"# x", b"\t", b'"\\0"', b'"\\ud800/"', b'"\\U00110000"', b'"\\UFFFFFFFF"', b'"\\x41"', b'"\\q"',
        b'"a\\nb/c"', b'"a\\0/b"', b"null", b"~", b"true", b"yes", b"on", b"0", b"-0", b"1", b"-1", b"0x10", b"0o17",
        b"017", b"1e3", b"1_000", b".nan", b"-.inf", b"1:30", b"2,5", b"5 V", b"0.1", b"9" * 39, b"9" * 400,
        b"0." + b"1" * 37, b"100", b"127", b"policy", b"map", b"station", b"policy.yaml", b"map.yaml", b"file.yaml",
        b"../x.yaml", b"/dev/null", b"/", b".", b"x" * 200, b"/" + b"x" * 300, b"li-ion-48v", b"tabos", b"tabos-lsb",
        b"manual", b"automatic", b"kernel", b"objects", b"fields", b"tpdos", b"bays", b"charger", b"battery", b"limits",
        b"can", b"can0", b"control", b"interface: virtual", b"bitrate: 250000", b"\xff", b"\xc2\x85", b"\xc2\xa0",
        b"\xe2\x80\xa8", b"\xef\xbb\xbf", b"\xf0\x9f\x94\x8b", b"\xed\xa0\x80", b"\r\n", b"\r", b"\0",
    ],
    ["orchestrator/config/*"],
    max_bytes=800,
    limit_s=2.0,
    blind=0.1,  # most of these are not YAML
)  # fmt: skip
