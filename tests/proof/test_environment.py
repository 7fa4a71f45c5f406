"""The short form of the environment's campaign, and the judge: no findings here, and every planted bug is found."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from orchestrator.core import decide, faults, latches, next_transition, outofcontrol, persisted
from orchestrator.core.facts import Facts
from orchestrator.lastresort import lastline
from orchestrator.model import Cause
from orchestrator.sim.charger_frames import Kind
from tests.proof.environment import play, smallest
from tests.proof.hazards import BEGIN_S, Bay, Hazard, Script
from tests.proof.lives import live
from tests.proof.scenes import SCENES

#: Scenes and random scripts played each time; `make campaign` plays all scenes and a thousand scripts.
SHORT: tuple[str | int, ...] = (
    "nothing happens", "another speed, then killed", "locked by a stranger", "charging, then the disk is torn",
    "crossed cables, hot", "says standby now and then", "half dead adapter, estop", "stopped while it ends",
    "the lock cannot be closed", "a port whose closing fails", "automatic, both killed", "contactor, does not obey",
    "another program runs it at rest", "the BMU says 3 A more, stopped", 0, 3, 58,
)  # fmt: skip
Patch = pytest.MonkeyPatch


@pytest.mark.parametrize("name", SHORT)
def test_nothing_is_found(name: str | int) -> None:
    _, lived = play(name)
    assert not lived.wrong, "again: python -m tests.proof.environment --scene … or --seed … -v"
    assert lived.charged, "a station in which nobody charges proves nothing"


def test_a_script_is_its_json_and_plays_the_same_again() -> None:
    script = Script.of_seed(3)
    again = Script.from_json(script.to_json())
    assert again == script
    first, second = live(script), live(again)
    assert (first.wrong, first.said) == (second.wrong, second.said)


def test_scenes_and_random_scripts_begin_with_a_service() -> None:
    for script in (*SCENES.values(), *map(Script.of_seed, range(50))):
        assert script.hazards[0] == Hazard(0.0, "boot")
        assert script.end_s > max(one.t_s for one in script.hazards)


def scene(*hazards: Hazard, end_s: float = BEGIN_S + 16, bays: tuple[Bay, ...] = (Bay(),) * 3) -> Script:
    return Script(1, bays, (Hazard(0.0, "boot"), *hazards), end_s, systemd=False)


def forgets(patch: Patch) -> None:
    memory = persisted.Persisted.memory
    patch.setattr(persisted.Persisted, "memory", lambda kept, now_s: memory(replace(kept, running=False), now_s))


def one_port_only(patch: Patch) -> None:
    write = lastline.LastLine.write
    patch.setattr(lastline.LastLine, "write", lambda one, frame: write(one, frame) if one.name[-1] == "1" else None)


KILLED = (Hazard(BEGIN_S, "kill both"), Hazard(BEGIN_S + 2, "boot"))
#: The invariant → a bug that breaks it, and a script that shows it.
BUGS: dict[str, tuple[Callable[[Patch], None], Script]] = {
    "by itself": (forgets, scene(*KILLED)),
    "not understood": (one_port_only, scene(Hazard(BEGIN_S, "kill"), Hazard(BEGIN_S + 1, "kill guardian"))),
}


@pytest.mark.parametrize("name", BUGS)
def test_a_bug_is_found_and_its_script_made_small(name: str, monkeypatch: Patch) -> None:
    bug, script = BUGS[name]
    assert not live(script).wrong, "the bug must be what breaks it"
    bug(monkeypatch)
    assert name in live(script).kinds
    assert len(smallest(script).hazards) <= len(script.hazards)


def never_opens(patch: Patch) -> None:
    patch.setattr(decide, "closes", lambda *_, **__: True)


def lets_others_run(patch: Patch) -> None:
    others = tuple(row for row in faults.FAULTS if row.id not in ("rogue_run", "current_without_order"))
    patch.setattr(latches, "FAULTS", others)


def blames(patch: Patch) -> None:
    def disobeys(f: Facts) -> Cause:
        return Cause.of("uncontrollable", port="", since_s=3.0, why=outofcontrol._witnesses(f))

    patch.setattr(next_transition, "out_of_control", disobeys)


#: The invariant → a bug that breaks it, and a variant that shows it and is clean without the bug.
MORE_BUGS: dict[str, tuple[Callable[[Patch], None], str]] = {
    "isolated": (never_opens, "contactor, does not obey"),
    "latched": (lets_others_run, "another program runs it at rest"),
    "false words": (blames, "the BMU says 3 A more, stopped"),
}


@pytest.mark.parametrize("name", MORE_BUGS)
def test_a_bug_is_found_by_a_variant(name: str, monkeypatch: Patch) -> None:
    bug, variant = MORE_BUGS[name]
    bug(monkeypatch)
    assert name in live(SCENES[variant]).kinds


def test_who_says_standby_while_current_flows_is_believed_only_where_nobody_knows_better() -> None:
    """Both witnesses tell the same lie: undetectable, so nothing is required."""
    lies = tuple(Hazard(8.0, "lie", 0, 0.0, f"{kind.name}:1") for kind in (Kind.CURRENT, Kind.OPERATION))
    deaf = Hazard(8.0, "fault", 0, None, "ignore_stop")
    blind = (*lies, Hazard(8.0, "bmu", 0, 0.0, "current_a:is:1"))
    assert not live(scene(*blind, deaf, end_s=24.0)).wrong
