"""The schemas for editors: fresh, right, and as strict as a schema can be."""

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from orchestrator.cli import main
from orchestrator.config.files import KINDS, STATION, Kind
from orchestrator.config.json_schema import json_schema

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = sorted((*ROOT.glob("policies/*.yaml"), *ROOT.glob("configs/*/*.yaml")))
GOOD = sorted(ROOT.glob("tests/config/good/*.yaml"))
BROKEN = ROOT / "tests/config/broken"
MODELINE = re.compile(r"# yaml-language-server: \$schema=(\S+)\n")

#: Mistakes visible without knowing another key; the others are for `orchestrator check`.
SEEN = (
    "booleans", "map-fields", "misplaced-key", "missing-keys", "no-value", "numbers", "other-kind",
    "out-of-bounds", "station-half-a-bay", "station-empty-bays", "unknown-keys", "words", "wrong-shape",
)  # fmt: skip


class Loader(yaml.SafeLoader):
    """YAML 1.2, as editors read it: `off` and `no` are strings."""


Loader.yaml_implicit_resolvers = {
    first: [one for one in resolvers if one[0] != "tag:yaml.org,2002:bool" or first in "tTfF"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def read(path: Path) -> Any:
    return yaml.load(path.read_text(encoding="utf-8"), Loader)


def kind_of(document: Any) -> Kind | None:
    return next((kind for kind in KINDS if kind.mark in document), None)


def complaints(path: Path, kind: Kind) -> list[str]:
    validator = jsonschema.Draft7Validator(json_schema(kind))
    return [f"{error.json_path}: {error.message}" for error in validator.iter_errors(read(path))]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.key)
def test_the_shipped_schema_is_fresh_and_valid(kind: Kind, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", kind.key]) == 0
    shipped = (ROOT / "configs" / "schemas" / f"{kind.key}.json").read_text(encoding="utf-8")
    assert shipped == capsys.readouterr().out, f"orchestrator schema {kind.key} > configs/schemas/{kind.key}.json"
    jsonschema.Draft7Validator.check_schema(json.loads(shipped))


@pytest.mark.parametrize("path", [*SHIPPED, *GOOD], ids=lambda path: path.name)
def test_what_is_right_is_not_complained_about(path: Path) -> None:
    kind = kind_of(read(path))
    assert kind is not None
    assert complaints(path, kind) == []


@pytest.mark.parametrize("name", SEEN)
def test_what_can_be_seen_in_the_editor_is(name: str) -> None:
    path = BROKEN / f"{name}.yaml"
    assert complaints(path, kind_of(read(path)) or KINDS[0])


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_every_shipped_file_names_its_schema(path: Path) -> None:
    kind, named = kind_of(read(path)), MODELINE.match(path.read_text(encoding="utf-8"))
    assert kind is not None
    assert named, "the first line"
    assert (path.parent / named[1]).resolve() == ROOT / "configs" / "schemas" / f"{kind.key}.json"


def test_each_key_says_what_it_means_and_where_its_bounds_are() -> None:
    sweep = json_schema(STATION)["properties"]["bays"]["items"]["properties"]["battery"]["properties"]["sweep_s"]
    assert sweep["description"].endswith("(0.02 … 0.5 s)")
    assert (sweep["minimum"], sweep["maximum"], sweep["default"]) == (0.02, 0.5, 0.05)
