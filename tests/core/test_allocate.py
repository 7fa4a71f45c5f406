"""Who may charge how fast: each rule of the allocation with its exact grants and causes."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf, nan

import pytest

from orchestrator.core import ledger
from orchestrator.core.allocate import allocate
from orchestrator.core.order import RAISE_EVERY_S, RAISE_HOLD_S, TURN_S
from orchestrator.core.supply import Grant, Held, Load, Priority, Supplies, Supply, Want
from orchestrator.model import Cause
from orchestrator.text.catalogue import say

DRAW_W = (10, 100, 200, 300, 400, 500)
NOW_S = 10_000.0
FULL = Want(top=5)


def site(count: int, limit_w: int, *supplies: Supply, on: Sequence[str] = ()) -> Supplies:
    """Bays on a hall; the first ones of them on what is within it."""
    loads = [Load(f"bay-{n + 1}", on[n] if n < len(on) else "hall", DRAW_W) for n in range(count)]
    return Supplies.of((Supply("hall", limit_w, place="s.yaml:3"), *supplies), loads)


def has(level: int = 0, counted: int | None = None, **more: object) -> Held:
    """A charger in hand, settled on this level for long."""
    long_s = NOW_S - 2 * TURN_S
    placed: dict[str, object] = {"turn_s": long_s, "rose_s": long_s} if level else {}
    most = level if counted is None else counted
    return replace(Held(most, level, known=True, **placed), **more)  # type: ignore[arg-type]  # its fields


READY = has(room_s=NOW_S - RAISE_HOLD_S)  #: may have its first level now


def levels(supplies: Supplies, wants: Sequence[Want], held: Sequence[Held]) -> list[int]:
    return [grant.level for grant in allocate(supplies, wants, held, NOW_S)]


def settled(supplies: Supplies, wants: Sequence[Want], held: Sequence[Held], minutes: int = 10) -> list[Grant]:
    """What it comes to while every charger follows at once."""
    now, grants = list(held), allocate(supplies, wants, held, NOW_S)
    for tens in range(1, minutes * 6):
        t_s = NOW_S + 10 * tens
        now = [ledger.observed(one.held, 5, ledger.Seen(one.level, t_s)) for one in grants]
        grants = allocate(supplies, wants, now, t_s)
    return list(grants)


# --- the supplies -----------------------------------------------------------------------------------------------------


def test_a_bay_counts_in_all_supplies_above_it() -> None:
    tree = site(3, 900, Supply("rack", 500, "hall"), Supply("shelf", 300, "rack"), on=("shelf", "rack"))
    assert tree.paths == ((2, 1, 0), (1, 0), (0,))
    assert ledger.used_w(tree, [has(1), has(2), has(3)]) == [600, 300, 100]


def test_a_lower_limit_holds_for_now_and_no_limit_widens_the_files() -> None:
    tree = site(1, 900, Supply("rack", 500, "hall"))
    assert tree.limited({"hall": 400, "rack": 800}).limits_w == (400, 500)
    assert tree.limited({"hall": 400}).limited({}).limits_w == (900, 500)


# --- the ledger -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("held", "seen", "after"),
    [
        (Held(5), None, Held(5)),  # a start: it may be running
        (Held(5), ledger.Seen(0, 1.0), Held(0, known=True)),
        (has(2), None, has(2, 5, known=False)),
        (has(2), ledger.Seen(2, NOW_S), has(2)),
        (has(2), ledger.Seen(1, NOW_S), has(2)),  # it counts with what it may use
        (has(2, 4), ledger.Seen(3, NOW_S), has(2, 3)),
        (has(2, 4), ledger.Seen(1, NOW_S), has(2)),
        (has(2), ledger.Seen(4, NOW_S), has(2, 4)),  # a charger on more than it was told
        (has(1, 4, lowered_s=NOW_S), ledger.Seen(1, NOW_S), has(1, 4, lowered_s=NOW_S)),  # said before it was told
        (has(1, 4, lowered_s=NOW_S), ledger.Seen(5, NOW_S), has(1, 5, lowered_s=NOW_S)),
        (has(1, 4, lowered_s=NOW_S), ledger.Seen(1, nan), has(1, 4, lowered_s=NOW_S)),
        (has(1, 5, known=False), ledger.Seen(1, NOW_S), has(1)),
    ],
)
def test_only_a_later_status_disproves_a_level(held: Held, seen: ledger.Seen | None, after: Held) -> None:
    assert ledger.observed(held, 5, seen) == after


def test_what_changes_nothing_is_the_same_object() -> None:
    for held, seen in (
        (Held(5), None),
        (has(2), ledger.Seen(2, NOW_S)),
        (has(2, lowered_s=NOW_S), ledger.Seen(2, 0.0)),
    ):
        assert ledger.observed(held, 5, seen) is held


def test_a_lower_grant_frees_nothing_and_a_higher_one_counts_at_once() -> None:
    assert ledger.lowered(has(3, room_s=1.0), 1, NOW_S) == has(1, 3, lowered_s=NOW_S)
    assert ledger.raised(has(1, room_s=1.0), 2, NOW_S) == has(2, turn_s=has(1).turn_s, rose_s=NOW_S)
    assert ledger.raised(has(1, 4), 2, NOW_S).counted == 4


def test_room_is_what_is_left_up_to_the_last_watt() -> None:
    assert ledger.no_room([900, 300], [1000, 400], (1, 0), 100) is None
    assert ledger.no_room([900, 300], [1000, 400], (1, 0), 101) == 1
    assert ledger.no_room([901, 300], [1000, 400], (1, 0), 100) == 0
    assert ledger.no_room([1000], [1000], (0,), 0) is None
    assert ledger.no_room([1001], [1000], (0,), 0) == 0
    assert ledger.more_w(DRAW_W, 2, 3) == 100
    assert ledger.more_w(DRAW_W, 4, 3) == 0


# --- reserve before use, down verified before up ----------------------------------------------------------------------


def test_down_is_seen_before_another_goes_up() -> None:
    hall, wants = site(2, 510), (FULL, Want(top=1, priority=Priority.FIRST))
    first = allocate(hall, wants, (has(5), READY), NOW_S)
    assert [grant.level for grant in first] == [4, 0]
    assert first[0].held.counted == 5
    assert say(first[1].cause) == (
        "supply hall: 510 of 510 W are still counted (s.yaml:3); waits until less is seen at bay-1"
    )
    still = [ledger.observed(first[0].held, 5, ledger.Seen(5, NOW_S + 1)), first[1].held]
    assert [one.level for one in allocate(hall, wants, still, NOW_S + 1)] == [4, 0]
    seen = [ledger.observed(first[0].held, 5, ledger.Seen(4, NOW_S + 2)), still[1]]
    assert [one.level for one in allocate(hall, wants, seen, NOW_S + 2)] == [4, 1]


def test_after_a_start_nothing_is_granted_until_every_charger_is_seen() -> None:
    hall, wants = site(2, 1000), (FULL, FULL)
    start = [ledger.unproved(5)] * 2
    grants = allocate(hall, wants, start, NOW_S)
    assert [grant.level for grant in grants] == [0, 0]
    assert say(grants[0].cause) == (
        "its charger is not in hand, so it counts with 500 W in supply hall until its standby is seen"
    )
    one_seen = (ledger.observed(grants[0].held, 5, ledger.Seen(0, NOW_S + 1)), grants[1].held)
    assert settled(hall, wants, one_seen, minutes=1)[0].level == 1


def test_a_charger_not_in_hand_counts_with_its_highest_step_and_the_others_go_down() -> None:
    hall = site(3, 1000)
    lost = ledger.observed(has(1), 5, None)
    grants = allocate(hall, (FULL, FULL, FULL), (lost, has(4), has(4)), NOW_S)
    assert [grant.level for grant in grants] == [0, 3, 2]
    assert say(grants[2].cause) == (
        "supply hall: 1,300 of 1,000 W are promised (s.yaml:3); "
        "counted with their highest steps, their chargers not being in hand: bay-1"
    )


def test_a_level_that_still_counts_may_be_granted_again_without_more_room() -> None:
    assert levels(site(2, 600), (FULL, Want()), (has(2, 5, room_s=NOW_S - RAISE_HOLD_S), has(0))) == [3, 0]


def test_a_level_that_counts_for_want_of_knowledge_is_no_room() -> None:
    """A late status says that the first one runs: it counts, and must not be told to run for that reason."""
    counts = ledger.observed(replace(READY, lowered_s=NOW_S), 5, ledger.Seen(1, NOW_S - 1))
    assert levels(site(2, 190), (FULL, Want()), (counts, has(0, 1))) == [0, 0]
    assert levels(site(2, 200), (FULL, Want()), (counts, has(0, 1))) == [1, 0]


# --- who gets it ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("limit_w", "wants", "after"),
    [
        (5000, (FULL, FULL, FULL), [5, 5, 5]),
        (1500, (FULL, FULL, FULL), [5, 5, 5]),  # exactly
        (1499, (FULL, FULL, FULL), [5, 5, 4]),
        (900, (FULL, FULL, FULL), [3, 3, 3]),
        (1000, (FULL, FULL, FULL), [4, 3, 3]),
        (1000, (FULL, Want(top=1), FULL), [5, 1, 4]),
        (1000, (Want(), FULL, FULL), [0, 5, 4]),
        (500, (FULL, Want(top=2), Want(top=2)), [3, 1, 1]),  # the share of what is wanted
        (600, (FULL, replace(FULL, priority=Priority.FIRST), FULL), [0, 5, 0]),
        (600, (FULL, replace(FULL, priority=Priority.LAST), FULL), [3, 1, 2]),
        (210, (Want(5, laxity_s=50.0), Want(5, laxity_s=40.0), Want(5, laxity_s=-3.0)), [0, 1, 1]),
        (210, (Want(5, laxity_s=50.0), Want(5, laxity_s=inf), Want(5, laxity_s=nan)), [1, 1, 0]),
        (99, (FULL, FULL, FULL), [0, 0, 0]),
    ],
)
def test_the_shares(limit_w: int, wants: tuple[Want, ...], after: list[int]) -> None:
    assert [one.level for one in settled(site(3, limit_w), wants, [has()] * 3)] == after


def test_every_supply_above_limits() -> None:
    tree = site(3, 900, Supply("rack", 400, "hall"), on=("rack", "rack"))
    grants = settled(tree, (FULL, FULL, FULL), [has()] * 3)
    assert [one.level for one in grants] == [2, 2, 5]
    assert grants[2].cause is None
    assert say(grants[0].cause) == "supply rack: 400 of 400 W are promised"


def test_a_precharge_or_tail_is_not_interrupted_for_others_of_its_class() -> None:
    hurried = Want(5, laxity_s=-100.0)
    running = (has(1), has())
    assert levels(site(2, 150), (replace(FULL, keeps=True), hurried), running) == [1, 0]
    assert levels(site(2, 150), (FULL, hurried), running) == [0, 0]
    assert levels(site(2, 150), (replace(FULL, keeps=True), replace(hurried, priority=Priority.FIRST)), running) == [
        0,
        0,
    ]
    assert levels(site(2, 150), (replace(FULL, keeps=True), hurried), (has(0), READY)) == [0, 1]


# --- when -------------------------------------------------------------------------------------------------------------


def test_up_after_a_hold_and_one_step_a_minute() -> None:
    hall, held, raises = site(1, 1000), [has()], []
    for second in range(0, 400, 2):
        t_s = NOW_S + second
        (grant,) = allocate(hall, (FULL,), held, t_s)
        if grant.level > held[0].granted:
            raises.append(second)
            told = grant.cause.id if grant.cause is not None else None
            assert told == {0: "supply_raise", 5: None}.get(grant.level, "supply_rises")
        if second == 0:
            assert grant.cause == Cause(
                "supply_raise",
                (("supply", "hall"), ("raise_t_s", NOW_S + RAISE_HOLD_S)),
                "supplies.hall.limit_w",
                "s.yaml:3",
            )
        held = [ledger.observed(grant.held, 5, ledger.Seen(grant.level, t_s + 0.5))]
    assert raises == [10 + 60 * n for n in range(5)]
    assert RAISE_EVERY_S == 60


def test_room_that_goes_again_is_no_room() -> None:
    hall = site(1, 1000)
    waits = has(1, room_s=NOW_S - RAISE_HOLD_S + 1)
    (grant,) = allocate(hall, (Want(top=1),), (waits,), NOW_S)
    assert grant.held.room_s is None


def test_a_lower_want_lowers_at_once() -> None:
    (grant,) = allocate(site(1, 1000), (Want(top=2),), (has(5),), NOW_S)
    assert grant.held == has(2, 5, turn_s=has(5).turn_s, rose_s=has(5).rose_s, lowered_s=NOW_S)
    assert grant.cause is None


# --- turns ------------------------------------------------------------------------------------------------------------


def test_a_turn_lasts_a_quarter_of_an_hour_and_then_the_next_one_comes() -> None:
    hall = site(2, 110)
    begun = has(1, turn_s=NOW_S - TURN_S + 1)
    grants = allocate(hall, (FULL, replace(FULL, laxity_s=-9.0)), (begun, has()), NOW_S)
    assert [one.level for one in grants] == [1, 0]
    assert grants[1].cause == Cause(
        "supply_turn",
        (("supply", "hall"), ("used_w", 110), ("limit_w", 110), ("other", "bay-1"), ("turn_t_s", NOW_S + 1)),
        "supplies.hall.limit_w",
        "s.yaml:3",
    )
    later = allocate(hall, (FULL, FULL), [one.held for one in grants], NOW_S + 1)
    assert [one.level for one in later] == [0, 0]
    assert later[0].held.waits_s == NOW_S + 1
    assert later[1].held.turn_s == NOW_S + 1  # its place is kept while the other stops
    assert later[1].held.waits_s is None


def test_one_with_less_time_to_spare_keeps_its_place_until_another_has_waited_for_a_turn() -> None:
    hall, wants = site(2, 110), (Want(5, laxity_s=10.0), FULL)
    waiting = has(waits_s=NOW_S - TURN_S + 1)
    grants = allocate(hall, wants, (has(1), waiting), NOW_S)
    assert [one.level for one in grants] == [1, 0]
    assert grants[1].cause is not None
    assert grants[1].cause.param("turn_t_s") == NOW_S + 1
    assert allocate(hall, wants, (has(1), waiting), NOW_S + 1)[0].level == 0


def test_each_turn_that_ends_is_told_to_one_of_those_who_wait() -> None:
    hall = site(4, 220)
    held = (has(1, turn_s=NOW_S - 100), has(1, turn_s=NOW_S - 200), has(), has())
    grants = allocate(hall, (FULL,) * 4, held, NOW_S)
    told = [(one.cause.param("other"), one.cause.param("turn_t_s")) for one in grants[2:] if one.cause]
    assert told == [("bay-2", NOW_S + 700), ("bay-1", NOW_S + 800)]
    more = allocate(site(5, 230), (FULL,) * 5, (*held, has()), NOW_S)
    assert more[4].cause is not None
    assert more[4].cause.id == "supply_line"


def test_a_lowest_step_that_no_supply_can_feed() -> None:
    (_, grant) = allocate(site(2, 109), (Want(), FULL), (has(), has()), NOW_S)
    assert say(grant.cause) == ("supply hall has 109 W (s.yaml:3), too little for the lowest step: that needs 110 W")


def test_everyone_has_a_turn() -> None:
    hall, wants = site(7, 7 * 10 + 2 * 90), (Want(5, laxity_s=5.0), *(FULL,) * 6)
    held, served = [has()] * 7, dict.fromkeys(range(7), 0)
    for minute in range(4 * 60):
        t_s = NOW_S + 60 * minute
        grants = allocate(hall, wants, held, t_s)
        for bay, one in enumerate(grants):
            served[bay] += one.level > 0
        assert sum(one.level for one in grants) <= 2
        held = [ledger.observed(one.held, 5, ledger.Seen(one.level, t_s + 1)) for one in grants]
    assert min(served.values()) >= 30


def test_the_room_that_a_large_charger_waits_for_goes_to_no_newcomer() -> None:
    """Two small chargers hold what a large one needs, and small ones arrive all the time."""
    small, large = (0, 100, 200), (0, 200, 400)
    loads = (Load("a", "hall", small), Load("b", "hall", small), Load("c", "hall", small), Load("big", "hall", large))
    hall = Supplies.of((Supply("hall", 200),), loads)
    wants = (Want(1), Want(1), Want(1, laxity_s=-1.0), Want(1))
    ends = has(1, turn_s=NOW_S - 100)
    starving = has(waits_s=NOW_S - TURN_S)
    grants = allocate(hall, wants, (has(1), ends, READY, starving), NOW_S)
    assert [one.level for one in grants] == [1, 1, 0, 0]
    over = allocate(hall, wants, [one.held for one in grants], NOW_S + TURN_S)
    assert [one.level for one in over] == [0, 0, 0, 0]
    assert over[3].held.turn_s == NOW_S + TURN_S


def test_a_large_charger_that_can_never_have_it_keeps_nothing_from_others() -> None:
    loads = (Load("small", "hall", (0, 100)), Load("big", "hall", (0, 300)))
    hall = Supplies.of((Supply("hall", 200),), loads)
    held = (READY, has(waits_s=NOW_S - TURN_S))
    assert levels(hall, (Want(1), Want(1)), held) == [1, 0]


# --- beyond the usual -------------------------------------------------------------------------------------------------


def test_a_charger_that_draws_nothing_is_no_error() -> None:
    hall = Supplies.of((Supply("hall", 0),), (Load("a", "hall", (0, 0, 0)),))
    assert levels(hall, (Want(2),), (replace(READY, granted=0),)) == [1]


def test_the_highest_level_is_the_last_draw() -> None:
    assert Load("a", "hall", DRAW_W).top == 5


def test_a_turn_that_is_not_known_begins_now() -> None:
    (grant,) = allocate(site(1, 1000), (Want(1),), (has(1, turn_s=None),), NOW_S)
    assert grant.held.turn_s == NOW_S
