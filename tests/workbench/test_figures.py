"""The figures match the moments and spans they are drawn from."""

from dataclasses import replace

import pytest

from orchestrator.columns import aligned, width_of
from orchestrator.config.load import load_policy
from orchestrator.config.scenario import Visit
from orchestrator.model import Cause, State
from orchestrator.workbench.simulate.compare import differences
from orchestrator.workbench.simulate.figures import clock, compared, figures, table
from orchestrator.workbench.simulate.simulation import Run, simulate
from orchestrator.workbench.simulate.trail import Moment, Span, Trail, bounds, clock_s
from tests.workbench.scenarios import battery, scenario

POLICY = load_policy("li-ion-48v")


def moment(hours: float, state: State = State.CHARGING, volts: float = 50.0, celsius: float = 20.0) -> Moment:
    return Moment(hours * 3600, 50.0 + hours, volts, 8.0, celsius, 20.0, 2, state)


def span(from_h: float, to_h: float, state: State, step: int | None = None, *faults: str) -> Span:
    return Span(from_h * 3600, to_h * 3600, state, step, None, Cause(f"{state}"), faults)


def run(moments: list[Moment], spans: list[Span], hours: float = 4.0, **changes: object) -> Run:
    return Run(POLICY, scenario(hours, **changes), Trail(moments, spans), 12.0, 600.0, 100)


def test_a_charge_with_everything_in_it() -> None:
    moments = [
        moment(0.5),
        moment(1.0, celsius=31.5),
        moment(1.5, State.SUSPENDED),
        moment(2.0, volts=53.1),
        moment(2.5, volts=53.5),
        moment(3.0, State.FULL, volts=53.4),
        moment(4.0, State.FULL, volts=53.2),
    ]
    spans = [
        span(0, 0.5, State.CHARGING, 4),
        span(0.5, 1.0, State.CHARGING, 2, "status_limit"),
        span(1.0, 1.01, State.STOPPING, None, "over_temperature"),
        span(1.01, 1.5, State.SUSPENDED, None, "over_temperature"),
        span(1.5, 2.99, State.CHARGING, 2),
        span(2.99, 3.0, State.STOPPING),
        span(3.0, 4.0, State.FULL),
    ]
    found = figures(run(moments, spans))
    assert (found.policy, found.visits, found.full, found.full_h) == ("li-ion-48v", 1, 1, 3.0)
    assert (found.left_pct, found.peak_c, found.charged_ah, found.charged_wh) == (54.0, 31.5, 12.0, 600.0)
    assert found.high_voltage_h == pytest.approx(1.25)  # 13 × 4.1 V is 53.3 V: from 2.25 to 3.5
    assert (found.stops, found.step_changes) == (1, 1)
    assert found.faults == {"status_limit": 1, "over_temperature": 1}
    assert found.state_h[State.CHARGING] == pytest.approx(2.49)
    assert sum(found.state_h.values()) == pytest.approx(4.0)


def test_time_to_full_is_of_each_battery_from_its_arrival() -> None:
    visits = (Visit(battery="a", from_h=0, to_h=1, soc_pct=50), Visit(battery="b", from_h=1, to_h=2, soc_pct=50),
              Visit(battery="a", from_h=2, used_pct=10))  # fmt: skip
    moments = [moment(0.5, State.FULL), moment(1.5), moment(2.25), moment(2.75, State.FULL)]
    found = figures(
        run(moments, [span(0, 3, State.IDLE)], 3.0, visits=visits, batteries={"a": battery(), "b": battery()})
    )
    assert (found.visits, found.full) == (3, 2)
    assert found.full_h == pytest.approx(0.625)


def test_nothing_charged_has_dashes() -> None:
    found = figures(run([], [span(0, 4, State.IDLE)]))
    rows = dict(table([found]))
    assert rows["time to full, h:min"] == rows["peak temperature"] == "–"
    assert rows["faults"] == "none"


def test_a_column_for_each_policy_and_a_row_for_each_state_that_lasts() -> None:
    first = figures(run([], [span(0, 3, State.CHARGING), span(3, 3.0001, State.STOPPING), span(3.0001, 4, State.FULL)]))
    second = replace(first, policy="other", state_h={State.SUSPENDED: 4.0})
    head, *rows = table([first, second])
    assert head == ["", "li-ion-48v", "other"]
    assert [row for row in rows if row[0].startswith("time CHARGING")] == [
        ["time CHARGING, h:min:s", "3:00:00", "0:00:00"]
    ]
    assert not [row for row in rows if "STOPPING" in row[0]]
    assert len({line.index("other") for line in [aligned([head, *rows]).splitlines()[0]]}) == 1


def test_policies_of_one_name_are_told_apart_by_their_files() -> None:
    one = run([], [span(0, 4, State.IDLE)])
    copied = replace(POLICY, source=replace(POLICY.source, file="/home/me/copy.yaml"))
    other = replace(POLICY, policy="other")
    assert compared([one, replace(one, policy=copied), replace(one, policy=other)])[0] == [
        "", "li-ion-48v (policies/li-ion-48v.yaml)", "li-ion-48v (/home/me/copy.yaml)", "other",
    ]  # fmt: skip


@pytest.mark.parametrize("width", [60, 80, 100])
def test_a_table_fits_the_terminal(width: int) -> None:
    one = figures(run([], [span(0, 4, State.CHARGING, None, "over_temperature", "status_limit", "hot_pack")]))
    rows = table([replace(one, policy=f"policy-{number}") for number in range(6)])
    assert max(map(width_of, aligned(rows).splitlines())) > 100
    blocks = aligned(rows, width).split("\n\n")
    assert all(width_of(line) <= width for block in blocks for line in block.splitlines())
    assert " ".join(block.splitlines()[0] for block in blocks).split() == rows[0][1:]
    assert [block.count("time to full") for block in blocks] == [1] * len(blocks)
    assert "".join(blocks).count("hot_pack ×1") == 6
    assert aligned(rows[:3], 1000) == aligned(rows[:3])


def test_a_figure_keeps_its_unit_where_a_cell_is_folded() -> None:
    text = aligned([["", "key.of.something[2].elsewhere"], ["charged to the end", "37.8 Ah, 1894 Wh and 12.5 Ah"]], 44)
    assert [line.strip() for line in text.splitlines()] == [
        "key.of.something[2].",
        "elsewhere",
        "charged to the end  37.8 Ah, 1894 Wh and",
        "12.5 Ah",
    ]


def test_clocks() -> None:
    assert (clock(2.0833), clock(0.999), clock_s(2.0853)) == ("2:05", "1:00", "2:05:07")


def test_moments_in_a_reason_are_on_the_clock_of_the_simulation() -> None:
    told = Span(8.27 * 3600, 9 * 3600, State.HELD, None, None, Cause.of("gone", gone_t_s=29766.2)).why
    assert "8:16:06" in told
    assert "29766" not in told


def test_rules_are_gathered_whatever_was_measured() -> None:
    def because(from_h: float, cause: Cause, step: int) -> Span:
        return Span(from_h * 3600, from_h * 3600 + 60, State.CHARGING, step, 5.0, cause)

    def by(row: int, pack_c: float) -> Cause:
        return Cause.of("limit", key=f"current.temperature_c[{row}]", pack_c=pack_c)

    spans = [because(0, by(3, 34.9), 3), because(1, by(4, 35.0), 1), because(2, by(3, 34.8), 3)]
    found = bounds(spans)
    assert [(one.number, len(one.spans), one.total_s) for one in found] == [(1, 2, 120.0), (2, 1, 60.0)]


def test_policies_differ_where_state_or_step_do() -> None:
    one = [span(0, 1, State.CHARGING, 4), span(1, 1.001, State.STOPPING), span(1.001, 4, State.FULL)]
    other = [span(0, 0.5, State.CHARGING, 4), span(0.5, 2, State.CHARGING, 2), span(2, 4, State.FULL)]
    assert differences([one, other]) == [(1800.0, 7200.0)]
    assert differences([one, one]) == []
    assert differences([one]) == []


def test_a_difference_of_a_moment_is_none() -> None:
    one = [span(0, 1, State.CHARGING, 4), span(1, 2, State.FULL)]
    other = [span(0, 1.01, State.CHARGING, 4), span(1.01, 2, State.FULL)]
    assert differences([one, other]) == []


def test_the_figures_of_a_simulation_add_up() -> None:
    found = figures(simulate(POLICY, scenario(1.0)))
    assert sum(found.state_h.values()) == pytest.approx(1.0, abs=0.001)
    assert found.left_pct is not None
    assert found.charged_ah == pytest.approx((found.left_pct - 30) / 100 * 8, abs=0.001)
    assert found.full_h is not None
    assert 0.4 < found.full_h < 0.6
