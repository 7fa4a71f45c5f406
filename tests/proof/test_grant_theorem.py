"""Never over, as a theorem: the ledger's own functions on symbolic watts, for any number of other bays.

The invariant of a supply is that what its bays count with is within its limit. Each event of one bay is applied to any
state, with any watts and any other load, and z3 looks for numbers with which it would not hold afterwards. Where a
supply is above its limit already (an unknown charger, a lowered limit), nothing may rise.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
import z3

from orchestrator.core import allocate as allocation
from orchestrator.core import ledger
from orchestrator.core.supply import Held, Load, Supplies, Supply
from tests.proof.symbolic import Paths, Watts, plain

NOW_S, TOP = 1000.0, 5
DRAW = tuple(z3.Int(f"draw_{level}") for level in range(TOP + 1))
#: What all other bays count with, and the limit, in each supply above the bay.
REST, LIMIT = ([z3.Int(f"{name}_{number}") for number in range(3)] for name in ("rest", "limit"))
#: All that is known of them: draws do not fall from step to step.
GIVEN = [DRAW[0] >= 0, *(low <= high for low, high in pairwise(DRAW)), *(w >= 0 for w in REST)]


def states() -> Iterator[Held]:
    """Each that satisfies the other half of the invariant: the grant is within what counts, unknown is the most."""
    for counted in range(TOP + 1):
        for granted in range(counted + 1):
            yield Held(counted, granted, known=True, room_s=0.0)
            yield Held(TOP, granted, known=False, room_s=0.0)


def holds(held: Held) -> bool:
    """That half."""
    return 0 <= held.granted <= held.counted <= TOP and (held.known or held.counted == TOP)


def symbolic(paths: Paths, depth: int) -> tuple[Supplies, list[Any]]:
    """A bay below so many supplies with any limits, and what counts in them besides."""
    names = [f"s{number}" for number in range(depth)]
    tree = [Supply(name, 0, above) for name, above in zip(names, [*names[1:], None], strict=True)]
    draws: Any = tuple(Watts(paths, draw) for draw in DRAW)
    limits: Any = tuple(Watts(paths, limit) for limit in LIMIT[:depth])
    return replace(Supplies.of(tree, [Load("bay", "s0", draws)]), limits_w=limits), [
        Watts(paths, rest) for rest in REST[:depth]
    ]


def counted(held: Held) -> Any:
    return DRAW[held.counted]


@pytest.mark.parametrize("depth", [1, 3])
def test_a_move_of_a_grant_keeps_every_sum_within_its_limit(depth: int) -> None:
    looked = raised = 0
    for before in states():
        for level in range(TOP + 1) if before.known else (0,):
            paths = Paths(*GIVEN)
            supplies, rest = symbolic(paths, depth)

            def run(was: Held = before, level: int = level, supplies: Supplies = supplies, rest: Any = rest) -> Any:
                used = list(rest)
                ledger.add(used, supplies.paths[0], supplies.loads[0].draw_w[was.counted])
                return allocation.moved(supplies, used, 0, was, level, NOW_S)[0], used

            for after, used in paths.of(run):
                looked, raised = looked + 1, raised + (after.granted > before.granted)
                assert holds(after)
                assert after.counted >= before.counted, "nothing is freed without a status"
                for number in range(depth):
                    assert paths.never(plain(used[number]) != REST[number] + counted(after)), "the ledger is right"
                    within = REST[number] + counted(after) <= LIMIT[number]
                    if after.granted > before.granted or after.counted > before.counted:
                        assert paths.never(z3.Not(within)), f"{before} to {after} above the limit"
    assert looked > 200
    assert raised > 15


@pytest.mark.parametrize("seen", [None, *range(TOP + 1)])
@pytest.mark.parametrize("t_s", [NOW_S - 1, NOW_S, NOW_S + 1])
def test_a_status_keeps_the_invariant_and_frees_only_what_it_disproves(seen: int | None, t_s: float) -> None:
    for before in states():
        was = replace(before, lowered_s=NOW_S)
        after = ledger.observed(was, TOP, None if seen is None else ledger.Seen(seen, t_s))
        assert holds(after)
        assert after.granted == was.granted
        if seen is None:
            assert (after.counted, after.known) == (TOP, False)
        else:
            assert after.counted >= seen, "it counts with at least what it shows"
            assert after.counted >= was.counted or t_s > was.lowered_s, "an older status frees nothing"


def test_the_sums_are_those_of_the_ledger() -> None:
    paths = Paths(*GIVEN)
    supplies, _ = symbolic(paths, 3)
    for held in states():
        assert all(paths.never(plain(used) != counted(held)) for used in ledger.used_w(supplies, [held]))


def test_the_search_finds_what_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ledger that lets one watt too much through is found out."""
    monkeypatch.setattr(ledger, "no_room", lambda used, limits_w, path, more_w: None)
    with pytest.raises(AssertionError, match="above the limit"):
        test_a_move_of_a_grant_keeps_every_sum_within_its_limit(1)
