"""Names of values in test ids."""

from dataclasses import dataclass, field

import pytest

from orchestrator.config.load import load_policy
from orchestrator.errors import RefusedError
from orchestrator.model import Action, Command, State
from tests.ids import LONGEST, name_of


@dataclass(frozen=True)
class Thing:
    size_m: float
    colour: str = "red"
    notes: dict[str, int] = field(default_factory=dict)


NAMES: dict[str, object] = {
    "IDLE": State.IDLE,
    "AF FA": b"\xaf\xfa",
    "no bytes": b"",
    "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00..": bytes(100),
    "soc_pct=97.9 state=IDLE": {"soc_pct": 97.9, "state": State.IDLE},
    "1 2 red": (1, [2, "red"]),
    "nothing": (),
    "Thing size_m=2.0": Thing(2.0),
    "Thing size_m=2.0 colour=blue notes=a=1": Thing(2.0, "blue", {"a": 1}),
    "Command action=SET_LIMIT value=3": Command(Action.SET_LIMIT, 3),
    "li-ion-48v": load_policy("li-ion-48v"),
    "RefusedError gone": RefusedError("gone"),
    "name_of": name_of,
    "two lines": "two\nlines",
}


@pytest.mark.parametrize("name", NAMES)
def test_a_value_without_a_name_is_written_out(name: str) -> None:
    assert name_of(NAMES[name]) == name
    assert len(name) <= LONGEST


@pytest.mark.parametrize("value", ["short", "ends with a line\n", 1, 2.5, True, None, int], ids=repr)
def test_the_rest_is_as_good_as_it_is(value: object) -> None:
    assert name_of(value) is None


def test_a_long_text_is_cut() -> None:
    assert name_of("x" * 100) == "x" * (LONGEST - 2) + ".."
