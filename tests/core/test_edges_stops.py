"""What proves a stop, and what both witnesses remember, at their edges: the whole record."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.core import safestop
from orchestrator.core.alarm import alarm
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Memory, Stop
from orchestrator.core.safestop import gives_up
from orchestrator.core.witnesses import followed
from orchestrator.core.witnesses.followed import Frozen, Sample, Witnessed
from orchestrator.core.witnesses.standby import current_without_order, proved
from orchestrator.model import Alarm, Cause, ChargeMode, Measurement, Operation, Session, State
from tests.core.edges import BMU, NOW_S, Edge, ago, raised, witnessed
from tests.core.said import cause
from tests.core.world import remembering

S = State
UNHEARD = {"t_s": ago(9)}
STANDS_BY = {"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL, "current_a": 0.0}

# --- whether a stop is proved -----------------------------------------------------------------------------------------


def seen(amps: float, age_s: float) -> dict[str, Any]:
    """The BMU's newest current, so old."""
    return {"battery": replace(BMU, current_a=Measurement(amps, ago(age_s)))}


PROOF = {"stop_sent_s": ago(1)}
PROVED = (
    Edge(proved, True, state=S.STOPPING, charger=STANDS_BY, charger_link=PROOF),
    Edge(proved, False, state=S.STOPPING, charger_link=PROOF),
    Edge(proved, True, state=S.STOPPING, charger=STANDS_BY, charger_link=PROOF, snapshot=seen(0.0, 1.0)),
    Edge(proved, False, state=S.STOPPING, charger=STANDS_BY, charger_link=PROOF, snapshot=seen(0.0, 1.25)),
    Edge(proved, False, state=S.STOPPING, charger=STANDS_BY, charger_link=PROOF, snapshot=seen(1.25, 0.0)),
    Edge(proved, True, state=S.STOPPING, charger=STANDS_BY, charger_link=PROOF, bmu={"current_a": None}),
    Edge(current_without_order, Cause.of("current_unheard", pack_a=10.0), witnessed(unordered_s=2.0), S.OFFLINE,
         bmu={"current_a": 10.0}, charger=UNHEARD),
    Edge(gives_up, True, {"unverified": True}, S.STARTING, 3.0, charger=UNHEARD),
    Edge(gives_up, False, {"unverified": True}, S.STARTING, 2.9, charger=UNHEARD),
    Edge(gives_up, False, state=S.STARTING, state_s=3.0, charger=UNHEARD),
)  # fmt: skip

# --- how it was stopped -----------------------------------------------------------------------------------------------

WHY, EARLIER = cause("the reason"), cause("the reason before")


def on_to(after: State) -> Any:
    """The record of the stop when the bay is about to be in this state."""

    def stop(f: Facts) -> Stop:
        return safestop.update(f, after, WHY)

    stop.__name__ = f"to {after}"
    return stop


def tried(seconds: float, verified_s: float | None = None, returns: int = 0) -> dict[str, Any]:
    verified = ago(verified_s) if verified_s is not None else None
    return {"stop_cause": EARLIER, "stopping_s": ago(seconds), "verified_s": verified, "returns": returns}


STOP = (
    # verified: what was tried before stays known for a while
    Edge(on_to(S.IDLE), Stop(EARLIER, ago(20), NOW_S), {**tried(20), "unverified": True}, S.STOPPING,
         charger=STANDS_BY, charger_link=PROOF),
    Edge(on_to(S.IDLE), Stop(EARLIER, ago(20), unverified=True), {**tried(20), "unverified": True}, S.STOPPING),
    Edge(on_to(S.IDLE), Stop(), state=S.STARTING),
    Edge(on_to(S.IDLE), Stop(stopping_s=ago(60)), raised("found_running"), S.STARTING),
    Edge(on_to(S.IDLE), Stop(EARLIER, ago(20)), {**tried(20), **raised("found_running")}, S.STARTING),
    # nothing is stopped, and nothing is proved, from one rest to the next
    Edge(on_to(S.QUALIFYING), Stop(), state=S.IDLE, charger=STANDS_BY, charger_link=PROOF),
    Edge(on_to(S.QUALIFYING), Stop(EARLIER, ago(20), ago(9)), tried(20, 9), S.IDLE, charger=STANDS_BY,
         charger_link=PROOF),
    # a stop begins, anew or in continuation of one that did not last
    Edge(on_to(S.STOPPING), Stop(WHY, NOW_S)),
    Edge(on_to(S.STOPPING), Stop(WHY, ago(20), ago(9.9), 3), tried(20, 9.9, 2), S.IDLE),
    Edge(on_to(S.STOPPING), Stop(WHY, NOW_S, ago(10)), tried(20, 10, 2), S.IDLE),
    Edge(on_to(S.STOPPING), Stop(WHY, NOW_S, ago(2)), tried(20, 2, 2), S.IDLE, charger=STANDS_BY),
    Edge(on_to(S.STOPPING), Stop(WHY, NOW_S), tried(20, None, 2), S.IDLE),
    Edge(on_to(S.STOPPING), Stop(WHY, NOW_S, ago(2)), {"verified_s": ago(2)}, S.IDLE),
    # out of control
    Edge(on_to(S.UNCONTROLLABLE), Stop(EARLIER, ago(20), returns=2), tried(20, None, 2), S.STOPPING),
    Edge(on_to(S.UNCONTROLLABLE), Stop(EARLIER, ago(20)), tried(20), S.STOPPING, charger=STANDS_BY, charger_link=PROOF),
    Edge(on_to(S.UNCONTROLLABLE), Stop(stopping_s=ago(60)), state=S.STARTING),
    # current is to flow: nothing is proved any more
    Edge(on_to(S.CHARGING), Stop(EARLIER, returns=2, unverified=True), tried(20, 9, 2), S.QUALIFYING),
)  # fmt: skip


@pytest.mark.parametrize(
    ("state", "unverified", "level"),
    [
        (S.STARTING, True, Alarm.DANGER),
        (S.OFFLINE, True, Alarm.DANGER),
        (S.STARTING, False, Alarm.NONE),
        (S.CHARGING, True, Alarm.NONE),
        (S.STOPPING, True, Alarm.NONE),
        (S.UNCONTROLLABLE, False, Alarm.DANGER),
    ],
)
def test_a_charger_that_may_run_unseen_is_a_danger(state: State, unverified: bool, level: Alarm) -> None:
    assert alarm(remembering(Memory(), state=state, unverified=unverified), ()) is level


# --- what both witnesses have shown -----------------------------------------------------------------------------------


def followed_on(f: Facts) -> Witnessed:
    """What is remembered a quarter of a second later."""
    return followed.update(f, 0.25)


def sent(age_s: float) -> dict[str, Any]:
    return {"stop_sent_s": ago(age_s)}


def sample(age_s: float) -> Sample:
    return Sample(ago(age_s), 48.0, 10.0, 48.0, 10.0)


AT_STANDBY = (
    # the first whole stop of the state
    Edge(followed_on, Witnessed(ago(60), (NOW_S,)), witnessed(stop_s=None, proof=()), S.IDLE, charger=STANDS_BY,
         charger_link=sent(60)),
    Edge(followed_on, Witnessed(), witnessed(stop_s=None, proof=()), S.IDLE, charger=STANDS_BY,
         charger_link=sent(60.1)),
    Edge(followed_on, Witnessed(ago(60), (NOW_S,)), witnessed(stop_s=ago(60), proof=()), S.IDLE, charger=STANDS_BY,
         charger_link=sent(1)),
    Edge(followed_on, Witnessed(ago(1), (NOW_S,)), witnessed(stop_s=ago(60.1), proof=(ago(9), ago(8))), S.IDLE,
         charger=STANDS_BY, charger_link=sent(1)),
    # the first and the newest reply of an unbroken run
    Edge(followed_on, Witnessed(ago(9), (ago(8), NOW_S)), witnessed(stop_s=ago(9), proof=(ago(8),)), S.IDLE,
         charger=STANDS_BY, charger_link=sent(9)),
    Edge(followed_on, Witnessed(ago(9), (ago(8), NOW_S)), witnessed(stop_s=ago(9), proof=(ago(8), ago(1))), S.IDLE,
         charger=STANDS_BY, charger_link=sent(9)),
    Edge(followed_on, Witnessed(ago(9), (ago(8), NOW_S)), witnessed(stop_s=ago(9), proof=(ago(8), NOW_S)), S.IDLE,
         charger=STANDS_BY, charger_link=sent(9)),
    Edge(followed_on, Witnessed(ago(9), (NOW_S,)), witnessed(stop_s=ago(9), proof=(NOW_S,)), S.IDLE,
         charger=STANDS_BY, charger_link=sent(9)),
    Edge(followed_on, Witnessed(ago(1), (ago(1),)), witnessed(stop_s=ago(1), proof=()), S.IDLE,
         charger={**STANDS_BY, "t_s": ago(1)}, charger_link=sent(1)),
    Edge(followed_on, Witnessed(ago(1)), witnessed(stop_s=ago(1), proof=()), S.IDLE,
         charger={**STANDS_BY, "t_s": ago(1.1)}, charger_link=sent(1)),
    Edge(followed_on, Witnessed(ago(9)), witnessed(stop_s=ago(9), proof=(ago(8), ago(1))), S.IDLE,
         charger_link=sent(9)),
    Edge(followed_on, Witnessed(ago(9)), witnessed(stop_s=ago(9), proof=(ago(8), ago(1))), S.IDLE, charger=UNHEARD,
         charger_link=sent(9)),
    # a current that nobody ordered
    Edge(followed_on, Witnessed(ago(9), sees=True, unordered_s=2.25, before_a=1.5), bmu={"current_a": 1.5},
         memory=witnessed(stop_s=ago(9), proof=(ago(8), ago(1)), sees=True, unordered_s=2.0, before_a=1.5),
         state=S.IDLE, charger=STANDS_BY, charger_link=sent(9)),
    # what the BMU sees before the next charge
    Edge(followed_on, Witnessed(before_a=0.5), {"witnessed": Witnessed(before_a=2.0, proved=True, alone_s=2.0)},
         S.IDLE, bmu={"current_a": 0.5}, charger=STANDS_BY),
    Edge(followed_on, Witnessed(), {"witnessed": Witnessed(alone_s=2.0)}, S.IDLE, charger=STANDS_BY),
    Edge(followed_on, Witnessed(), {"witnessed": Witnessed(before_a=2.0)}, S.IDLE, bmu={"current_a": None},
         charger=STANDS_BY),
    Edge(followed_on, Witnessed(), {"witnessed": Witnessed(trail=(sample(1),))}, S.IDLE, charger=STANDS_BY),
)  # fmt: skip


def trail(*ages_s: float) -> dict[str, Any]:
    return {"witnessed": Witnessed(trail=tuple(map(sample, ages_s)), proved=True)}


def trailed(f: Facts) -> tuple[Sample, ...]:
    return followed.update(f, 0.25).trail


NOW = sample(0)
UNDER_CURRENT = (
    Edge(trailed, (sample(1), NOW), trail(1)),
    Edge(trailed, (sample(0.5), NOW), trail(0.5)),
    Edge(trailed, (sample(0.4),), trail(0.4)),
    Edge(trailed, (sample(10), sample(1), NOW), trail(10.1, 10, 1)),
    Edge(trailed, (sample(1),), trail(1), bmu={"current_a": None}),
    Edge(trailed, (sample(1),), trail(1), bmu={"voltage_v": None}),
    Edge(trailed, (sample(1),), trail(1), charger=UNHEARD),
    Edge(trailed, (), trail(1), S.STOPPING),
    Edge(trailed, (), trail(1), S.STOPPING, bmu={"voltage_v": None}),
)  # fmt: skip


def unordered_s(f: Facts) -> float:
    return followed.update(f, 0.25).unordered_s


def alone(f: Facts) -> tuple[bool, float]:
    """Whether the BMU has seen the charge begin, and for how long the charger has delivered without that."""
    after = followed.update(f, 0.25)
    return after.proved, after.alone_s


def before(amps: float) -> dict[str, Any]:
    return {"witnessed": Witnessed(before_a=amps, alone_s=1.0)}


BEGINS = (
    Edge(unordered_s, 0.0, {"witnessed": Witnessed(unordered_s=3.0)}),
    Edge(unordered_s, 2.9375, {"witnessed": Witnessed(unordered_s=3.0)}, S.IDLE, charger=STANDS_BY),
    Edge(alone, (False, 1.25), before(2.0), charger={"current_a": 0.5}, bmu={"current_a": 2.0}),
    Edge(alone, (False, 0.9375), before(2.0), charger={"current_a": 0.49}, bmu={"current_a": 2.0}),
    Edge(alone, (True, 0.9375), before(2.0), bmu={"current_a": 7.0}),
    Edge(alone, (False, 1.25), before(2.0), bmu={"current_a": 6.99}),
    Edge(alone, (False, 1.25), before(2.0), bmu={"current_a": 3.0}),
    Edge(alone, (False, 1.0), before(2.0), bmu={"current_a": None}),
)  # fmt: skip

#: The BMU's report as it is now, and another.
WORDS = tuple([word.value if word is not None else None for word in followed.WORDS(BMU)])
AT_REST_WORDS = tuple([0.0 if name == "current_a" else word for name, word in zip(BMU.__slots__, WORDS, strict=True)])


def frozen(f: Facts) -> Frozen | None:
    return followed.update(f, 0.25).frozen


def report(words: tuple[float | None, ...] = WORDS, *, session: bool = True) -> dict[str, Any]:
    """This report has stood for a minute of a charge."""
    known = {"witnessed": Witnessed(frozen=Frozen(ago(60), words, 47.0, 1.0))}
    return {**known, "session": Session(0.0, charged_ah=2.0) if session else None}


STOOD, ANEW = Frozen(ago(60), WORDS, 47.0, 1.0), Frozen(NOW_S, WORDS, 48.0, 2.0)
STOOD_AT_REST = Frozen(ago(60), AT_REST_WORDS, 47.0, 1.0)
FROZEN = (
    Edge(frozen, ANEW, {"session": Session(0.0, charged_ah=2.0)}),
    Edge(frozen, None),
    Edge(frozen, None, {"session": Session(0.0)}, S.SUSPENDED, charger=STANDS_BY),
    Edge(frozen, STOOD, report()),
    Edge(frozen, ANEW, report((1.0,))),
    Edge(frozen, None, report((1.0,)), charger=UNHEARD),
    Edge(frozen, None, report((1.0,), session=False)),
    Edge(frozen, None, report((1.0,)), bmu={"voltage_v": None}),
    Edge(frozen, None, report((1.0,)), S.SUSPENDED, charger=STANDS_BY),
    # at rest, only one that was found frozen
    Edge(frozen, None, report(AT_REST_WORDS), S.SUSPENDED, charger=STANDS_BY),
    Edge(frozen, STOOD_AT_REST, {**report(AT_REST_WORDS), **raised("bmu_frozen")}, S.SUSPENDED, charger=STANDS_BY),
    Edge(frozen, None, {**report((1.0,)), **raised("bmu_frozen")}, S.SUSPENDED, charger=STANDS_BY),
)  # fmt: skip

EDGES = (*PROVED, *STOP, *AT_STANDBY, *UNDER_CURRENT, *BEGINS, *FROZEN)


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: edge.name)
def test_a_stop_and_its_witnesses_at_their_edges(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says
