"""`orchestrator simulate`: plays policies on a scenario and prints the table of their figures."""

from collections.abc import Callable, Sequence
from functools import partial

from orchestrator.columns import aligned
from orchestrator.config.load import load_policy, load_scenario
from orchestrator.workbench.simulate.figures import compared
from orchestrator.workbench.simulate.simulation import Run, simulate


def play(policies: Sequence[str], scenario: str, watch: Callable[[str, float], None]) -> list[Run]:
    """Play each policy on the scenario; both are shipped names or paths.

    `watch` is called regularly with a policy's name and the share of it that is done. Raises ConfigError for errors in
    the files, UnsuitableError for a policy that does not suit the scenario's batteries.
    """
    what_happens = load_scenario(scenario)
    loaded = [load_policy(name) for name in policies]
    return [simulate(policy, what_happens, watch=partial(watch, policy.policy)) for policy in loaded]


def as_table(runs: Sequence[Run], width: int = 0) -> str:
    """All figures, for a terminal of this width; 0: unlimited."""
    return aligned(compared(runs), width)
