"""Values that replace those of a file are read, checked and located like the ones in the file."""

import pytest

from orchestrator.config.load import load_policy
from orchestrator.errors import ConfigError


def test_a_value_is_read_as_if_it_stood_there() -> None:
    policy = load_policy("li-ion-48v", changes={"finish.target_soc_pct": "99", "pack.voltage_v[1]": "55"})
    assert policy.finish.target_soc_pct == 99
    assert policy.pack.voltage_v.high == 55
    assert load_policy("li-ion-48v").finish.target_soc_pct == 100


def test_rows_of_a_table_are_counted_from_0() -> None:
    rows = "current.soc_pct.rows"
    changes = {f"{rows}[0].to": "70", f"{rows}[1].from": "70", f"{rows}[1].max_a": "5"}
    table = load_policy("li-ion-48v", changes=changes).current.soc_pct
    assert table is not None
    assert [(row.from_, row.to, row.max_a) for row in table.rows] == [(0, 70, None), (70, 100, 5)]


def test_a_key_that_is_left_out_is_added_with_its_group() -> None:
    changes = {"faults.amps_differ_a": "0.5", "start.soc_below_pct": "50"}
    policy = load_policy("lfp-48v", changes=changes)
    assert (policy.faults.amps_differ_a, policy.start.soc_below_pct) == (0.5, 50)


def test_lines_stay_those_of_the_file() -> None:
    policy = load_policy("li-ion-48v", changes={"finish.target_soc_pct": "99"})
    at = "finish.target_soc_pct"
    assert policy.source.at(at) == load_policy("li-ion-48v").source.at(at)


@pytest.mark.parametrize(
    ("path", "text", "says"),
    [
        (
            "finish.target_soc_pct",
            "101",
            "policies/li-ion-48v.yaml:70:19: error: finish.target_soc_pct: 101 % is too high",
        ),
        ("finish.target_soc_pct", "99 %", "only the number, without a unit"),
        ("finish.hold_mni", "99", "unknown key 'hold_mni' in finish; did you mean hold_min?"),
        ("current.soc_pct.rows[0].to", "80", "current.soc_pct.rows[1].from: 90 leaves a gap"),
        ("current.soc_pct.rows[2].to", "80", "current.soc_pct.rows[2].to: there is no row [2]; the first one is [0]"),
        ("current[0]", "80", "current[0]: there is no row [0]"),
        ("finish", "80", "finish is not one value: name a key below it"),
        ("finish.hold_min.to", "80", "finish.hold_min.to: there is no to"),
        ("", "80", " is not one value"),
    ],
)
def test_what_may_not_stand_there_is_a_finding(path: str, text: str, says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_policy("li-ion-48v", changes={path: text})
    assert says in str(caught.value)
