"""Each rule at its boundary: the last allowed value and the first refused one (full messages: broken/)."""

from pathlib import Path

import pytest

from orchestrator.config.load import check
from orchestrator.config.map_rules import REQUIRED
from orchestrator.config.names import name_problem
from orchestrator.config.policy import Policy
from orchestrator.config.rules import Problems, Rule, problems
from orchestrator.config.station import BayConfig, Station
from orchestrator.config.yaml.schema import slots
from orchestrator.protocol.objects import READING_FIELDS, ObjectMap

GOOD = Path(__file__).parent / "good"

#: (file, text in it, replacement, the key that is then wrong or "" for none)
BOUNDARIES = [
    # policy
    ("policy", "voltage_v: [26.0, 55.2]", "voltage_v: [25.99, 55.2]", "pack.voltage_v[0]"),
    ("policy", "voltage_v: [26.0, 55.2]", "voltage_v: [26.0, 56.55]", ""),
    ("policy", "voltage_v: [26.0, 55.2]", "voltage_v: [26.0, 56.56]", "pack.voltage_v[1]"),
    ("policy", "until_v: 35.1", "until_v: 39.0", ""),
    ("policy", "until_v: 35.1", "until_v: 39.1", "precharge.pulse.until_v"),
    ("policy", "until_v: 35.1", "until_v: 26.0", ""),
    ("policy", "until_v: 35.1", "until_v: 25.9", "precharge.pulse.until_v"),
    ("policy", "below_v: 39.0", "below_v: 55.3", "precharge.below_v"),
    ("policy", "above_v: 53.6", "above_v: 55.2", ""),
    ("policy", "above_v: 53.6", "above_v: 55.3", "finish.full.taper.above_v"),
    ("policy", "{max_min: 20}", "{max_min: 20.1}", "precharge.continuous.max_min"),
    ("policy", "within_min: 5", "within_min: 30", ""),
    (
        "policy",
        "{until_v: 35.1, max_min: 10}\n  continuous: {max_min: 20}",
        "{until_v: 35.1, max_min: 3}\n  continuous: {max_min: 2}",
        "",
    ),
    (
        "policy",
        "{until_v: 35.1, max_min: 10}\n  continuous: {max_min: 20}",
        "{until_v: 35.1, max_min: 3}\n  continuous: {max_min: 1}",
        "precharge.rise.within_min",
    ),
    ("policy", "start:\n  soc_below_pct: 98", "start:\n  soc_below_pct: 100", ""),
    ("policy", "finish:\n", "finish:\n  target_soc_pct: 97\n", "start.soc_below_pct"),
    ("policy", "recharge:\n  soc_below_pct: 95", "recharge:\n  soc_below_pct: 99.9", ""),
    ("policy", "temperature_trip_c: 55", "temperature_trip_c: 45.1", ""),
    ("policy", "temperature_trip_c: 55", "temperature_trip_c: 45", "pack.temperature_c[1]"),
    ("policy", "from: 0, to: 10, max", "from: -5, to: 10, max", ""),
    ("policy", "from: 0, to: 10, max", "from: 0.1, to: 10, max", "current.temperature_c.rows[0].from"),
    ("policy", "from: 10, to: 45", "from: 10, to: 50", ""),
    ("policy", "from: 10, to: 45", "from: 10, to: 44.9", "current.temperature_c.rows[1].to"),
    ("policy", "from: 10, to: 45", "from: 10.1, to: 45", "current.temperature_c.rows[1].from"),
    ("policy", "from: 10, to: 45", "from: 9.9, to: 45", "current.temperature_c.rows[1].from"),
    ("policy", "from: 90, to: 100", "from: 90, to: 99", "current.soc_pct.rows[1].to"),
    ("policy", "from: 0, to: 90", "from: 1, to: 90", "current.soc_pct.rows[0].from"),
    ("policy", "policy: test-48v", "policy: test 48v", "policy"),
    ("policy", "max_a: 8.0", "max_a: 14.0", ""),
    ("policy", "max_a: 8.0", "max_a: 14.1", "current.soc_pct.rows[1].max_a"),
    ("policy", "max_a: 8.0", "max_a: 0", ""),
    ("policy", "below_v: 39.0\n  max_a: 2.0", "below_v: 39.0\n  max_a: 14.1", "precharge.max_a"),
    ("policy", "current_a: 14.0", "current_a: 14.0\n  capacity_ah: 20", ""),
    ("policy", "max_a: 8.0", "max_c: 0.4", "current.soc_pct.rows[1].max_c"),
    ("policy", "above_v: 53.6", "above_v: 53.0", ""),
    ("policy", "above_v: 53.6", "above_v: 52.9", "finish.full.taper.above_v"),
    ("policy", "  max_hours: 12\n", "", "finish.max_hours"),
    ("policy", "chemistry: nmc", "chemistry: lfp", "pack.chemistry"),
    # station
    ("station", "limits: {voltage_v: 58.4, ", "limits: {voltage_v: 55.2, ", ""),
    ("station", "limits: {voltage_v: 58.4, ", "limits: {voltage_v: 55.1, ", "bays[0].policy"),
    ("station", "temperature_c: [0, 45]", "temperature_c: [0.1, 45]", "bays[0].policy"),
    ("station", "temperature_c: [0, 45]", "temperature_c: [0, 44.9]", "bays[0].policy"),
    ("station", "temperature_c: [0, 45]", "temperature_c: [-5, 50]", ""),
    ("station", "steps_a: [2.0", "tolerance_pct: 20, steps_a: [2.0", ""),
    ("station", "current_a: 15.0", "current_a: 2.0", ""),
    ("station", "current_a: 15.0", "current_a: 1.99", "bays[0].charger.steps_a[0]"),
    ("station", "[2.0, 5.0, 8.0, 11.0, 14.0]", "[2.0, 5.0, 8.0, 11.0, 14.0, 15.0]", "bays[0].charger.steps_a"),
    ("station", "[2.0, 5.0, 8.0, 11.0, 14.0]", "[2.0, 5.0, 5.0, 11.0, 14.0]", "bays[0].charger.steps_a[2]"),
    ("station", "bitrate: 250000", "bitrate: 10000", ""),
    ("station", "bitrate: 250000", "bitrate: 9999", "can.can0.bitrate"),
    ("station", "bitrate: 250000", "bitrate: 1000000", ""),
    ("station", "bitrate: 250000", "bitrate: 1000001", "can.can0.bitrate"),
    ("station", "bitrate: 250000", "bitrate: true", "can.can0.bitrate"),
    ("station", "bitrate: 250000", "bitrate: 250k", "can.can0.bitrate"),
    ("station", ", bitrate: 250000", "", "can.can0"),
    ("station", "socketcan, channel: can0, bitrate: 250000", "virtual, channel: can0", ""),
    ("station", "interface: socketcan", "interface: my-own-plugin", ""),
    ("station", "interface: socketcan", "interface: null", "can.can0"),
    ("station", "run/orchestrator.sock", "/" + "s" * 106, ""),
    ("station", "run/orchestrator.sock", "/" + "s" * 107, "control.socket"),
    ("station", "map: tabos}", "map: tabos, tpdo_s: 0.1}", ""),
    ("station", "map: tabos}", "map: map-no-tpdos.yaml, tpdo_s: null}", ""),
    ("station", "map: tabos}", "map: map-no-tpdos.yaml, tpdo_s: 0.1}", "bays[0].battery.tpdo_s"),
    # map
    ("map", "size: 4\n    sweep: slow", "size: 3\n    sweep: slow", "objects[2].size"),
    ("map", "first_bit: 8, width: 8, range", "first_bit: 24, width: 8, range", ""),
    ("map", "first_bit: 8, width: 8, range", "first_bit: 25, width: 8, range", "objects[2].fields[0].width"),
    ("map", "first_bit: 8, width: 8, range", "first_bit: 7, width: 8, range", "objects[2].fields[0].first_bit"),
    ("map", "first_bit: 8, width: 8, range", "first_bit: 8, width: 8, unavailable: 0xFF, range", ""),
    (
        "map",
        "first_bit: 8, width: 8, range",
        "first_bit: 8, width: 8, unavailable: 0x100, range",
        "objects[2].fields[0].unavailable",
    ),
    ("map", "sweep: slow", "sweep: fast", ""),
    ("map", "index: 0x6002", "index: 0x6001", "objects[2].index"),
    ("map", "index: 0x6002", "index: 0x6001\n    sub: 1", ""),
    ("map", "[0x6000, 0x6001]", "[0x6000, 0x6001, 0x6002]", "tpdos[0].objects"),
    ("map", "[0x6000, 0x6001]", "[0x6003]", "tpdos[0].objects[0]"),
    ("map", "map: test", "map: -test", "map"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "written", "instead", "wrong"), BOUNDARIES)
def test_a_rule_holds_up_to_its_boundary(
    name: str, written: str, instead: str, wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for good in GOOD.glob("*.yaml"):
        (tmp_path / good.name).write_text(good.read_text())
    text = (GOOD / f"{name}.yaml").read_text()
    assert written in text
    (tmp_path / "x.yaml").write_text(text.replace(written, instead, 1))
    found = [finding.text.split(": ")[0] for finding in check(["x.yaml"])]
    assert found == ([wrong] if wrong else []), check(["x.yaml"])


@pytest.mark.parametrize("missing", REQUIRED)
def test_a_map_must_hold_what_a_charge_is_supervised_by(missing: str, tmp_path: Path) -> None:
    other = next(name for name in READING_FIELDS if name not in REQUIRED)
    file = tmp_path / "x.yaml"
    file.write_text((GOOD / "map.yaml").read_text().replace(f"name: {missing}", f"name: {other}"))
    (finding,) = check([file])
    assert finding.text == f"objects: no object holds {missing}; without it no charge can be supervised"


@pytest.mark.parametrize("name", ["bay-1", "A", "7", "depot_3.west", "베이-1", "x" * 64])
def test_good_names(name: str) -> None:
    assert name_problem(name) == ""


@pytest.mark.parametrize("name", ["", "-a", ".a", "a b", "a\n", "a;b", "“bay-1”", "a/b", "$x", "x" * 65])
def test_names_that_a_command_line_does_not_take(name: str) -> None:
    assert "cannot be typed on a command line" in name_problem(name)


def test_a_rule_is_silent_about_what_is_absent_or_wrong_already() -> None:
    def test(first: int, second: int) -> Problems:
        yield "a", f"{first} {second}"

    rules = (Rule(test, ("a", "b")),)
    assert list(problems(rules, {"a": 1, "b": 2})) == [("a", "1 2")]
    assert list(problems(rules, {"a": 1})) == []
    assert list(problems(rules, {"a": 1, "b": None})) == []


def test_the_rules_name_keys_that_there_are() -> None:
    """A misspelt key in a table of rules would silently disable its rule."""
    from orchestrator.config.map_rules import MAP_RULES
    from orchestrator.config.policy_rules import POLICY_RULES
    from orchestrator.config.station_rules import _BAY_RULES, _STATION_RULES

    for record, rules in (
        (Policy, POLICY_RULES),
        (ObjectMap, MAP_RULES),
        (Station, _STATION_RULES),
        (BayConfig, _BAY_RULES),
    ):
        for rule in rules:
            for path in rule.keys:
                assert _exists(record, path), (record, path)


def _exists(record: type, path: str) -> bool:
    name, _, rest = path.partition(".")
    slot = slots(record).get(name)
    if slot is None or not rest:
        return slot is not None
    hint = getattr(slot.hint, "__args__", (slot.hint,))[0]
    return _exists(hint, rest)
