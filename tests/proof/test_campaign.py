"""The short form of the campaign, and the campaign itself: it replays, finds what is broken, and shrinks it."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from orchestrator.config.station import BayConfig
from orchestrator.core import decide as decide_module
from orchestrator.core import latches
from orchestrator.core.faults import FAULTS
from orchestrator.core.machine import Trigger, fire
from orchestrator.core.rules import Rules
from orchestrator.devices import charger as charger_module
from orchestrator.devices import charger_view
from orchestrator.devices import dialogue as dialogue_module
from orchestrator.model import State
from tests.proof.campaign import kinds, play_seed, smallest, table, unseen
from tests.proof.play import Injected, play
from tests.proof.script import BaySetup, Happening, Script

Patch = pytest.MonkeyPatch


@pytest.mark.parametrize("first", range(0, 48, 12))  # `make campaign` plays a thousand
def test_no_random_script_breaks_anything(first: int) -> None:
    all_played = [play_seed(seed) for seed in range(first, first + 12)]
    broken = {played.script.seed: played.violations for played in all_played if played.violations}
    assert not broken, "again: python -m tests.proof.campaign --seed …"
    assert len(table(one for played in all_played for one in played.injected)) > 2


def test_a_script_is_its_json_and_plays_the_same_again() -> None:
    script = Script.of_seed(8)
    again = Script.from_json(script.to_json())
    assert again == script
    first, second = play(script), play(again)
    assert first == second
    assert first.injected


def without(*names: str) -> Callable[[Patch], None]:
    return lambda patch: patch.setattr(latches, "FAULTS", tuple(row for row in FAULTS if row.id not in names))


def skips_qualifying(patch: Patch) -> None:
    leads = {(State.SUSPENDED, Trigger.QUALIFY): State.CHARGING}
    patch.setattr(decide_module, "fire", lambda state, trigger: leads.get((state, trigger)) or fire(state, trigger))


def no_limits(patch: Patch) -> None:
    of: Callable[[BayConfig], Rules] = Rules.of
    patch.setattr(Rules, "of", lambda bay: replace(of(bay), top_step=4))
    patch.setattr(charger_module, "permit", lambda *_: None)


def deaf_to_silence(patch: Patch) -> None:
    without("charger_silent")(patch)
    patch.setattr(charger_view, "MISSES_UNTIL_SILENT", 10_000)


def breaks_on_noise(patch: Patch) -> None:
    def break_(*_: object) -> None:
        raise SystemExit("a bug that no boundary holds")

    patch.setattr(dialogue_module.Dialogue, "_complaint", break_)


def charged(*happenings: tuple[float, str], **setup: object) -> Script:
    """One or two bays in mid-charge, and events at the second one among others."""
    bays = (BaySetup(), BaySetup(line="perfect", **setup))  # type: ignore[arg-type]  # its fields
    befalls = (Happening(8.0, 0, "status_bits", 1.0), *(Happening(t_s, 1, name) for t_s, name in happenings))
    return Script(0, bays, befalls, 24.0, None, limit_a=9.0)


#: The invariant → a bug that breaks it, a script that shows it, the events left in the smallest script.
BUGS: dict[str, tuple[Callable[[Patch], None], Script, list[str]]] = {
    "BMU silent": (
        without("bmu_silent", "stale_reading", "heartbeat_lost"),
        charged((8.5, "bmu_silent")),
        ["bmu_silent"],
    ),
    "hot": (
        without("over_temperature", "hot_trip", "temperature_invalid"),
        charged((8.5, "over_temperature")),
        ["over_temperature"],
    ),
    "port gone": (deaf_to_silence, charged((8.5, "port_gone")), ["port_gone"]),
    "resumed": (
        skips_qualifying,
        charged((8.2, "pause"), (8.5, "frozen_temperature"), (10.0, "start")),
        ["pause", "start"],
    ),
    "limits": (no_limits, charged((8.5, "frozen_temperature")), []),
    "exception": (breaks_on_noise, charged((8.5, "charger_error_frames")), ["charger_error_frames"]),
}


@pytest.mark.parametrize("name", BUGS)
def test_a_bug_is_seen_and_its_script_made_small(name: str, monkeypatch: Patch) -> None:
    bug, script, essence = BUGS[name]
    assert not play(script).violations, "the bug must be what breaks it"
    bug(monkeypatch)
    assert name in kinds(play(script))
    small = smallest(script)
    assert [one.name for one in small.happenings] == essence
    assert len(small.bays) == 1
    assert small.bays[0].line == "real"
    assert small.end_s < script.end_s


def test_what_was_there_for_long_and_changed_nothing_is_unseen() -> None:
    injected = [
        Injected("frozen_temperature", 8.0, lasted_s=9.0),
        Injected("frozen_temperature", 8.0, lasted_s=1.0),
        Injected("bmu_silent", 8.0, fault="bmu_silent", lasted_s=9.0),
        Injected("bmu_reboot", 8.0, verified=True, lasted_s=9.0),
    ]
    assert [unseen(one) for one in injected] == [True, False, False, False]
    assert table(injected)[-2].split()[:4] == ["frozen_temperature", "2", "0", "1"]
