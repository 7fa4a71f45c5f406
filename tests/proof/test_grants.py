"""Never over, in small: random events, every state of three bays, every path of a charger; broken rules are found."""

from collections.abc import Callable
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.core import allocate as allocation
from orchestrator.core import ledger, order
from orchestrator.core.supply import Held, Load, Priority, Supplies, Supply, Want
from tests.proof.charger_paths import explored
from tests.proof.grants import TOP, one_allocation, play, three

Patch = pytest.MonkeyPatch


def test_a_hundred_thousand_events_and_not_a_watt_over() -> None:
    """`python -m tests.proof grants` plays ten million."""
    worlds = [play(seed, 128, 30_000, 90) for seed in range(3)] + [play(seed, 5, 1_000, 8) for seed in range(12)]
    assert sum(world.events for world in worlds) >= 100_000
    assert sum(world.raised for world in worlds) > 1_000


def test_every_state_of_three_bays() -> None:
    """The long form has every combination of them, more wants and more limits."""
    looked = 0
    for one in three(((TOP, 1, TOP),), (1000,), ordered=True):
        one_allocation(*one)
        looked += 1
    assert looked == 27 * 28 * 29 // 6


def test_every_path_of_a_charger_under_any_grants() -> None:
    """Commands and statuses late or lost, lines cut, restarts: always within what it counts with."""
    assert explored(levels=2) > 500


wants = st.builds(
    Want,
    top=st.integers(0, TOP),
    priority=st.sampled_from(Priority),
    laxity_s=st.floats(),
    keeps=st.booleans(),
)
times = st.none() | st.floats(0, 2000)
anything = st.tuples(st.integers(0, TOP), st.integers(0, TOP), st.booleans(), times, times, times).map(
    lambda x: Held(max(x[:2]) if x[2] else TOP, min(x[:2]), x[2], room_s=x[3], turn_s=x[4], waits_s=x[5])
)


@st.composite
def sites(draw: st.DrawFn) -> Supplies:
    """Up to six bays of any watts somewhere in a tree."""
    above = [None, *(draw(st.integers(0, n)) for n in range(draw(st.integers(0, 2))))]
    tree = [
        Supply(f"s{n}", draw(st.integers(0, 9000)), None if one is None else f"s{one}") for n, one in enumerate(above)
    ]
    steps = st.lists(st.integers(0, 2000), min_size=TOP + 1, max_size=TOP + 1).map(lambda watts: tuple(sorted(watts)))
    bays = range(draw(st.integers(1, 6)))
    return Supplies.of(tree, [Load(f"b{n}", f"s{draw(st.integers(0, len(tree) - 1))}", draw(steps)) for n in bays])


@settings(max_examples=100, deadline=None)
@given(sites(), st.data())
def test_whatever_is_wanted_no_sum_rises_above_its_limit(supplies: Supplies, data: st.DataObject) -> None:
    count = len(supplies.loads)
    held = data.draw(st.lists(anything, min_size=count, max_size=count))
    asked = data.draw(st.lists(wants, min_size=count, max_size=count))
    before_w = ledger.used_w(supplies, held)
    made = allocation.allocate(supplies, asked, held, 1000.0)
    after_w = ledger.used_w(supplies, [one.held for one in made])
    for before, after, limit in zip(before_w, after_w, supplies.limits_w, strict=True):
        assert after <= max(before, limit)
    for was, want, one in zip(held, asked, made, strict=True):
        assert one.level <= want.top
        assert one.held.counted == max(was.counted, one.level)
        assert was.known or not one.level


@settings(max_examples=15, deadline=None)
@given(sites(), st.randoms(use_true_random=False))
def test_whoever_may_charge_is_charged_in_the_end(supplies: Supplies, chance: Random) -> None:
    """With every charger in hand: nobody whose lowest step fits waits for ever, and once settled nothing flaps."""
    asked = [Want(chance.randint(1, TOP), laxity_s=chance.choice((float("inf"), 60.0))) for _ in supplies.loads]
    held, served = [Held(0, known=True)] * len(asked), set[int]()
    idle_w = ledger.used_w(supplies, held)
    for minute in range(20 * len(asked)):
        made = allocation.allocate(supplies, asked, held, 60.0 * minute)
        served |= {bay for bay, one in enumerate(made) if one.level}
        held = [ledger.observed(one.held, TOP, ledger.Seen(one.level, 60.0 * minute + 1)) for one in made]
    for bay, (load, path) in enumerate(zip(supplies.loads, supplies.paths, strict=True)):
        fits = ledger.no_room(idle_w, supplies.limits_w, path, load.draw_w[1] - load.draw_w[0]) is None
        assert fits == (bay in served)


# --- the rules themselves: each one broken, and found -----------------------------------------------------------------


def rise_without_room(patch: Patch) -> None:
    patch.setattr(ledger, "no_room", lambda used, limits_w, path, more_w: None)


def only_the_own_supply(patch: Patch) -> None:
    room = ledger.no_room
    patch.setattr(ledger, "no_room", lambda used, limits_w, path, more_w: room(used, limits_w, path[:1], more_w))


def what_counts_may_rise(patch: Patch) -> None:
    room = ledger.no_room
    patch.setattr(
        ledger, "no_room",
        lambda used, limits_w, path, more_w: room(used, limits_w, path, more_w) if more_w else None,
    )  # fmt: skip


def a_grant_counts_later(patch: Patch) -> None:
    patch.setattr(ledger, "raised", lambda held, level, now_s: replace(held, granted=level, rose_s=now_s, room_s=None))


def down_is_free_at_once(patch: Patch) -> None:
    patch.setattr(
        ledger, "lowered",
        lambda held, level, now_s: replace(held, granted=level, counted=level, lowered_s=now_s, room_s=None),
    )  # fmt: skip


def any_status_disproves(patch: Patch) -> None:
    patch.setattr(
        ledger, "observed",
        lambda held, top, seen, of=ledger.observed: of(replace(held, lowered_s=-1.0), top, seen),
    )  # fmt: skip


def silence_is_standby(patch: Patch) -> None:
    patch.setattr(
        ledger, "observed",
        lambda held, top, seen, of=ledger.observed: of(held, top, seen or ledger.Seen(0, 1e9)),
    )  # fmt: skip


def a_restart_knows_that_all_stand_by(patch: Patch) -> None:
    patch.setattr(ledger, "unproved", lambda top: Held(0, known=True))


def several_in_one_supply_do_not_add_up(patch: Patch) -> None:
    patch.setattr(ledger, "add", lambda used, path, more_w: None)


def up_at_once(patch: Patch) -> None:
    patch.setattr(allocation, "raises_at_s", lambda held: 0.0)


def two_steps_at_once(patch: Patch) -> None:
    raised = ledger.raised
    patch.setattr(ledger, "raised", lambda held, level, now_s: raised(held, min(level + 1, TOP), now_s))


def turns_never_end(patch: Patch) -> None:
    patch.setattr(order, "ORDER", tuple(rule for rule in order.ORDER if rule is not order.waits_too_long))
    patch.setattr(order, "starves", lambda held, now_s: False)


def newcomers_take_what_is_spared(patch: Patch) -> None:
    patch.setattr(allocation, "starves", lambda held, now_s: False)


BUGS: tuple[Callable[[Patch], None], ...] = (
    rise_without_room, only_the_own_supply, what_counts_may_rise, a_grant_counts_later, down_is_free_at_once,
    any_status_disproves, silence_is_standby, a_restart_knows_that_all_stand_by, several_in_one_supply_do_not_add_up,
    up_at_once, two_steps_at_once, turns_never_end, newcomers_take_what_is_spared,
)  # fmt: skip


def urgent_and_patient() -> None:
    """One place; one that is always in a hurry, and one that never is."""
    supplies = Supplies.of((Supply("s", 100),), (Load("a", "s", (0, 100)), Load("b", "s", (0, 100))))
    held, served = [Held(0, known=True)] * 2, [0, 0]
    for minute in range(120):
        made = allocation.allocate(supplies, (Want(1, laxity_s=-60.0), Want(1)), held, 60.0 * minute)
        served = [count + one.level for count, one in zip(served, made, strict=True)]
        held = [ledger.observed(one.held, 1, ledger.Seen(one.level, 60.0 * minute + 1)) for one in made]
    assert min(served) > 30


def large_and_small() -> None:
    """A large charger among small ones, two of which charge at any time, in turns that overlap."""
    loads = [Load("big", "s", (0, 200)), *(Load(f"small-{n}", "s", (0, 100)) for n in range(4))]
    supplies = Supplies.of((Supply("s", 200),), loads)
    held, served = [Held(0, known=True)] * 5, 0
    for half in range(300):
        t_s = 30.0 * half
        wanted = [Want(1), *(Want(1 if half > 12 * n or half < 2 * n else 0, laxity_s=9.0) for n in range(4))]
        made = allocation.allocate(supplies, wanted, held, t_s)
        served += made[0].level
        held = [ledger.observed(one.held, 1, ledger.Seen(one.level, t_s + 1)) for one in made]
    assert served > 20


def proofs() -> None:
    """All that may find one, the quickest first."""
    urgent_and_patient()
    large_and_small()
    explored(levels=2)
    for one in list(three(((TOP, TOP, TOP),), (1000,), ordered=True))[::7]:
        one_allocation(*one)
    for seed in range(30):
        play(seed, 5, 1_500, 8)


@pytest.mark.parametrize("bug", BUGS, ids=lambda bug: bug.__name__)
def test_every_broken_rule_is_found(bug: Callable[[Patch], None], monkeypatch: Patch) -> None:
    bug(monkeypatch)
    with pytest.raises((AssertionError, IndexError)):
        proofs()


def test_none_is_found_where_none_is() -> None:
    proofs()
