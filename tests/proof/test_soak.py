"""The short form of the soak, and a test that each of its verdicts can go either way."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestrator.core import latches
from orchestrator.core.checks import battery
from orchestrator.core.faults import FAULTS
from orchestrator.sim.can_noise import BUSES
from tests.proof.days import DAY_S, Days, Lived, due, script_of
from tests.proof.play import stage
from tests.proof.real_time import Real, Sample, judge
from tests.proof.script import ARRIVES, BaySetup, Happening, Script
from tests.proof.soak import grown, shares, told_of_days, told_of_real

Patch = pytest.MonkeyPatch

#: One stay with a fault, on the poor line and the poor bus.
STAY = Script(
    1,
    (BaySetup(soc_pct=97.5, line="poor"),),
    (
        Happening(60.0, 0, "battery_removed"),
        Happening(90.0, 0, ARRIVES, 60.0),
        Happening(150.0, 0, "bmu_silent"),
        Happening(160.0, 0, "heal"),
        Happening(200.0, 0, "reset"),
        Happening(205.0, 0, "start"),
    ),
    400.0,
    390.0,
    sweep_s=0.3,
)


def live(script: Script = STAY) -> Lived:
    with stage(script, BUSES["poor"]) as made:
        return Days(script, made, tell=False).run()


def test_minutes_of_a_life_on_a_poor_line() -> None:
    lived = live()
    assert (lived.violations, lived.false_stops, lived.false_latches, lived.status) == ([], [], [], 0)
    assert (lived.stays, lived.faults) == (1, 1)


def deaf(patch: Patch) -> None:
    left = [row for row in FAULTS if row.id not in ("bmu_silent", "stale_reading", "heartbeat_lost")]
    patch.setattr(latches, "FAULTS", tuple(left))


def impatient(patch: Patch) -> None:
    patch.setattr(battery, "ANSWERING_PERIODS", 1.5)


def touchy(patch: Patch) -> None:
    patch.setattr(battery, "JUMP_K", 0.001)


@pytest.mark.parametrize(
    ("bug", "shows"), [(deaf, "violations"), (impatient, "false_stops"), (touchy, "false_latches")]
)
def test_a_bug_is_seen(bug: Callable[[Patch], None], shows: str, monkeypatch: Patch) -> None:
    bug(monkeypatch)
    assert getattr(live(), shows)


def test_a_life_is_the_same_with_the_same_seed_and_has_its_nights() -> None:
    life = script_of(3, 4)
    assert life == script_of(3, 4)
    times_s = [one.t_s for one in life.happenings]
    assert times_s == sorted(times_s)
    assert {one.name for one in life.happenings} >= {"battery_removed", ARRIVES, "heal", "reset", "start"}
    nights = [one for one in life.happenings if one.t_s % DAY_S < 2 * 3600]
    assert len(nights) < len(life.happenings) / 10


def test_what_is_due_to_what_was_done() -> None:
    assert [(from_s, to_s, name) for from_s, to_s, name in due(STAY)] == [
        (0.0, 100.0, "the beginning and battery_removed"), (150.0, 170.0, "bmu_silent")
    ]  # fmt: skip


def test_the_days_are_shared_out() -> None:
    assert shares(30, 2) == [(1, 15), (2, 15)]
    assert shares(4, 3) == [(1, 2), (2, 1), (3, 1)]
    assert shares(1, 2) == [(1, 1)]
    assert shares(0, 2) == []


def samples(*mib: float) -> list[Sample]:
    return [Sample(7, 10.0 * at, one, 11, 5) for at, one in enumerate(mib)]


def test_memory_that_grows_is_found_and_memory_that_settles_is_not() -> None:
    flat, growing = Lived(3, mib=[37.0, 37.4, 37.2]), Lived(3, mib=[37.0, 38.0, 39.0])
    assert not grown([flat], None)
    assert grown([growing], None) == ["a life grew from 37.0 to 39.0 MiB"]
    settles = Real(samples={"controller": samples(30.0, 33.0, 33.1, 33.1, 33.2, 33.2, 33.1, 33.2)})
    climbs = Real(samples={"controller": samples(30.0, 33.0, 33.5, 34.0, 34.5, 35.0, 35.5, 36.0)})
    settles.samples["controller"].append(Sample(8, 80.0, 99.0, 11, 5))  # of another one, started in its place
    assert not grown([], settles)
    assert grown([], climbs) == ["the controller grew from 33.5 to 36.0 MiB"]


def journal(path: Path, *lines: tuple[float, dict[str, str]]) -> Path:
    text = "".join(json.dumps({"t": t_s, "wall": "12:00", "bay": "bay-1", **line}) + "\n" for t_s, line in lines)
    (path / "events.jsonl").write_text(text, encoding="utf-8")
    return path


CHARGES = {"kind": "transition", "from": "QUALIFYING", "to": "CHARGING", "reason": ""}
STOPS = {"kind": "transition", "from": "CHARGING", "to": "STOPPING", "reason": ""}
SILENT = {"kind": "fault", "event": "raised", "id": "bmu_silent", "effect": "STOP", "text": "no answer"}
LATCH = {"kind": "fault", "event": "raised", "id": "error_stop", "effect": "TRIP", "text": "mode 8"}


def test_what_is_due_to_nothing_is_false(tmp_path: Path) -> None:
    written = journal(tmp_path, (1.0, CHARGES), (5.0, STOPS), (5.001, SILENT), (6.0, LATCH))
    real = Real()
    judge(real, written, [])
    assert (len(real.false_stops), len(real.false_latches)) == (1, 1)
    explained = Real()
    judge(explained, written, [(4.0, 7.0)])
    assert (explained.false_stops, explained.false_latches) == ([], [])


def test_what_is_told() -> None:
    lived = Lived(2, 7, 8, 3, [], ["day 0.5, charger_silent: no answer"], [], mib=[37.0, 37.1], objects=[9, 9], cpu_s=4)
    told = "\n".join(told_of_days([lived]))
    assert "2 days in virtual time, 1 lives: 8 batteries, 7 charged full, 3 faults injected" in told
    assert "false stops: 1 (charger_silent 1)" in told
    real = Real(
        charges=5, departures=6, stops_s={"port_gone": [], "bmu_silent": [1.25]}, samples={"guardian": samples(11.0)}
    )
    told = "\n".join(told_of_real(real, 1.0))
    assert "bmu_silent               1   stop after, s: median, max  1.250  1.250" in told
    assert "port_gone                0   stop after, s: median, max no stop byte came through" in told
