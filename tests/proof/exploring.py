"""The checker of `orchestrator.workbench` on the standard test bay, with all input classes or a quick test's few."""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace

from orchestrator.config.load import load_policy
from orchestrator.config.shipped import shipped_names
from orchestrator.core.machine import TABLE
from orchestrator.core.rules import Rules
from orchestrator.model import ControlMode, State
from orchestrator.workbench.prove.endings import ENDINGS
from orchestrator.workbench.prove.exhaustive import prove
from orchestrator.workbench.prove.explore import Walk
from orchestrator.workbench.prove.inputs import StationInputs
from orchestrator.workbench.prove.properties import PROPERTIES
from tests.proof.report import say
from tests.proof.virtual_service import station

#: All shipped policies.
POLICIES = shipped_names("policies")
#: Left out of the quick form: the neighbours of every bound. Its jumps still pass every kind of timer.
NEIGHBOURS = ("just above", "just below")
QUICK_JUMPS_S = {ControlMode.MANUAL: (3.1, 70.1, 1200.1, 108000.1), ControlMode.AUTOMATIC: (3.1, 108000.1)}
SMALL_CHARGERS = (
    "obeys", "stands by, whatever it is told", "runs, whatever it is told", "stands by, no stop written yet",
    "full by itself", "stopped by an error", "silent", "never heard",
)  # fmt: skip
SMALL_BATTERIES = (
    "healthy", "full", "absent", "silent", "takes nothing", "old temperature", "implausible SOC",
    "voltage_v just below", "temperature_c at 45", "temperature_c at 55", "beyond the station's voltage",
    "hotter than the station allows", "measured differently", "deeply discharged",
    "another current than the charger's",
)  # fmt: skip
#: Unreachable states of the table: none, since even a service that has just started may know of a full battery.
NEVER: dict[tuple[State, State], str] = {}


def rules(policy: str = "li-ion-48v", control: ControlMode = ControlMode.MANUAL, current_a: float = 15.0) -> Rules:
    bay = station([control], [load_policy(policy)], current_a).bays[0]
    return Rules.of(bay)


def quick(of: Rules) -> StationInputs:
    """Fewer neighbours and jumps; every kind of class keeps at least one."""
    whole = StationInputs.of(of)
    batteries = {name: shown for name, shown in whole.batteries.items() if not any(w in name for w in NEIGHBOURS)}
    below = {name: shown for name, shown in whole.batteries.items() if "just below" in name and "_v" in name}
    return StationInputs(of, QUICK_JUMPS_S[of.bay.charger.control], whole.chargers, batteries | below)


def small(of: Rules) -> StationInputs:
    """One class of each kind: enough to reach everything and to show an existing bug."""
    whole = quick(of)
    chargers = {name: whole.chargers[name] for name in SMALL_CHARGERS}
    batteries = {
        name: shown for name, shown in whole.batteries.items()
        if name in SMALL_BATTERIES or any(name.startswith(start) for start in SMALL_BATTERIES)
    }  # fmt: skip
    return replace(whole, chargers=chargers, batteries=batteries)


def few(of: Rules) -> StationInputs:
    """The batteries that the endings speak of and those that are too warm: enough to come to all kinds of places."""
    whole = small(of)
    named = {ending.battery for ending in ENDINGS}
    batteries = {
        name: one for name, one in whole.batteries.items() if name in named or "temperature" in name or "hot" in name
    }
    return replace(whole, batteries=batteries)


def walk_on(inputs: StationInputs) -> Walk:
    return Walk(inputs.rules, inputs, PROPERTIES)


def changes_of_table() -> set[tuple[State, State]]:
    """Every transition in the machine's table."""
    pairs = {(source, target) for _, sources, target in TABLE if target for source in sources}
    return {(source, target) for source, target in pairs if source is not target}


def main(argv: Sequence[str] | None = None) -> int:
    """The whole exploration, for `make campaign`."""
    parser = argparse.ArgumentParser(description="Explore everything that the core can come to.")
    parser.add_argument("--policy", choices=POLICIES, action="append")
    names = parser.parse_args(argv).policy or POLICIES
    bad = 0
    for name in names:
        for control in ControlMode:
            began_s = time.monotonic()
            proof = prove(rules(name, control), lambda _: None)
            say(
                f"{name:14} {control.name.lower():9} {proof.memories:5} memories {proof.steps:9,} steps "
                f"{time.monotonic() - began_s:5.0f} s  {len(proof.counterexamples)} counterexamples"
            )
            bad += len(proof.counterexamples)
            for found in proof.counterexamples:
                say(found)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
