"""What a contactor must and must not do, checked against the plant.

1. It closes only onto a charger in standby, or one we told to run.
2. It opens without current, unless the charger was told to stop and had time to obey.
3. Where it can be driven, it ends current without a command, even if the charger disobeys.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from tests.proof.gateway import CHIP

if TYPE_CHECKING:
    from tests.proof.judge import Charger, Judge

#: A charger that obeys is without current within this after the first stop (`lastline.ROUND_S` less what a byte takes).
OBEYS_S = 0.4
#: A contactor ends current without a command within this: noticed, stopped, not verified, plus margins.
ISOLATED_S = 2.0 + 3.0 + 1.4
BREAKS_A = 1.0

Finding = tuple[str, str]  #: the invariant, the observation


def contactor_moves(judge: "Judge", charger: "Charger", *, closed: bool) -> Iterator[Finding]:
    """It is about to close or open."""
    model, now_s = charger.rig.bay.charger, judge.time.now_s
    chip = judge.gateway.kernel.chips[CHIP]
    if closed and model.running and charger.meant != "run" and charger.seen and now_s - charger.strange_s > OBEYS_S:
        yield "closes", "its contactor closes, and the charger runs"
    stops_s = now_s - charger.told_s if charger.meant == "stop" else 0.0
    reached = now_s - charger.deaf_s > OBEYS_S and judge.booted_s is not None
    driven = chip.present and reached and not _troubled(judge)
    if not closed and charger.current_a > BREAKS_A and stops_s < OBEYS_S and driven:
        yield "breaks a load", f"its contactor opens {stops_s:.2f} s after the stop, and {charger.current_a:.1f} A flow"


def isolates(judge: "Judge", charger: "Charger") -> bool:
    """Whether its contactor can be driven by a process that is there and sees the reason."""
    breaker, chip = charger.rig.breaker, judge.gateway.kernel.chips[CHIP]
    alive = judge.gateway.alive(judge.gateway.controller) and judge.booted_s is not None and not judge.frozen
    return (
        breaker is not None and not breaker.stuck and chip.present and alive and charger.seen and not _troubled(judge)
    )


def left_on(judge: "Judge", charger: "Charger") -> Iterator[Finding]:
    """Current without a command, for longer than a contactor allows."""
    since_s, now_s = charger.since_s.get("no order"), judge.time.now_s
    if since_s is None or charger.current_a < BREAKS_A or judge.entry(charger) is None or charger.rig.breaker is None:
        return
    lasts_s = now_s - max(since_s, judge.booted_s or 0.0, charger.strange_s) - charger.rig.breaker.slow_s
    if lasts_s > ISOLATED_S:
        yield "isolated", f"{charger.current_a:.1f} A flow without an order for {lasts_s:.2f} s, by a closed contactor"


def _troubled(judge: "Judge") -> bool:
    now_s = judge.time.now_s
    return any(one.place == CHIP and now_s < one.until_s + one.delay_s for one in judge.gateway.kernel.calls.troubles)
