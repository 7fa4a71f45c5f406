"""The table that `orchestrator status` prints."""

from collections.abc import Mapping

from orchestrator.show import figure, table


def bay(**changes: object) -> dict[str, object]:
    return {
        "name": "bay-1",
        "state": "CHARGING",
        "reason": "step 1 (5.0 A): temperature 8.4 °C in 0 … 10 °C",
        "step": 1,
        "step_current_a": 5.0,
        "charger": {"current_a": 4.98},
        "battery": {"soc_pct": 54.6, "voltage_v": 48.123, "temperature_c": 8.4},
        "faults": [],
        **changes,
    }


EMPTY = bay(
    name="a-bay-with-a-long-name",
    state="IDLE",
    reason="no battery",
    step=None,
    step_current_a=None,
    charger={"current_a": None},
    battery={"soc_pct": None, "voltage_v": None, "temperature_c": None},
)


def test_a_line_a_bay_with_units() -> None:
    assert table([bay(), EMPTY]) == (
        "BAY                     STATE     SOC   PACK     CURRENT  TEMP    STEP     WHY\n"
        "bay-1                   CHARGING  55 %  48.12 V  4.98 A   8.4 °C  1 (5 A)  "
        "step 1 (5.0 A): temperature 8.4 °C in 0 … 10 °C\n"
        "a-bay-with-a-long-name  IDLE      –     –        –        –       –        no battery"
    )


def test_no_bays_is_only_the_head() -> None:
    assert table([]) == "BAY  STATE  SOC  PACK  CURRENT  TEMP  STEP  WHY"


def fault(text: str) -> Mapping[str, object]:
    return {"id": "x", "effect": "WARN", "text": text, "since": 0.0}


def test_a_fault_that_is_not_the_reason_stands_below() -> None:
    told = bay(reason="stopped: too hot", faults=[fault("too hot"), fault("a noisy line")])
    assert table([told]).splitlines()[2:] == ["  WARN: a noisy line"]


def test_a_policy_that_waits_is_told() -> None:
    told = bay(policy={"name": "mine", "sha256": "0123", "waiting_sha256": "4567"})
    assert table([told]).splitlines()[2:] == ["  POLICY: a changed one comes into force when this bay stands by"]
    assert len(table([bay(policy={"waiting_sha256": ""})]).splitlines()) == 2


def test_figures() -> None:
    assert figure(0, "{:.1f} A") == "0.0 A"
    assert figure(None, "{:.1f} A") == "–"
