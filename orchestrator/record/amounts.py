"""What a charge took: Ah and Wh by two witnesses, and how long and how much under each rule. Pure.

The charger's amounts are the core's own counters, of which only the growth counts. The core's counters may be older
after a restart than what was recorded before it; what they lack then is not subtracted.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from orchestrator.core.states import AT_REST
from orchestrator.model import CurrentStep, Session
from orchestrator.record.look import Look
from orchestrator.record.stamp import figure

#: A gap in the BMU's readings counts only up to this.
GAP_S = 1.5
#: The charger chooses its own current.
BY_ITSELF, NO_STEP = ("", "", ""), (0, 0.0)

Rule = tuple[str, str, str]  #: a cause's id, key and place
Step = tuple[int, float]  #: its number, as people count, and its amperes
Of = TypeVar("Of")
Share = tuple[Of, float, float]  #: s, Ah


@dataclass(frozen=True, slots=True)
class Counted:
    """The core's counters, as far as they are in the amounts already."""

    ah: float = 0.0
    wh: float = 0.0
    energised_s: float = 0.0
    step_changes: int = 0

    @classmethod
    def of(cls, session: Session) -> "Counted":
        """The present ones."""
        return cls(session.charged_ah, session.charged_wh, session.energised_s, session.step_changes)

    def at_most(self, session: Session) -> "Counted":
        """These, or the core's where those are older: what they lack was counted all the same."""
        now = Counted.of(session)
        return Counted(
            min(self.ah, now.ah), min(self.wh, now.wh), min(self.energised_s, now.energised_s),
            min(self.step_changes, now.step_changes),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Amounts:
    """Everything that adds up."""

    counted: Counted = Counted()
    ah: float = 0.0
    wh: float = 0.0
    bmu_ah: float = 0.0
    bmu_wh: float = 0.0
    energised_s: float = 0.0
    step_changes: int = 0
    rules: tuple[Share[Rule], ...] = ()
    binding: Rule = BY_ITSELF  #: the rule that limited the current last
    steps: tuple[Share[Step], ...] = ()
    step: Step = NO_STEP  #: the last one
    bmu_t_s: float | None = None  #: the BMU's reading up to which its current is counted


def follow(amounts: Amounts, look: Look, *, resumed: bool = False) -> Amounts:
    """Count what has come since the last decision; `resumed`: that was in an earlier run of the service."""
    session = look.session
    now = Counted.of(session) if session is not None else amounts.counted
    before = amounts.counted.at_most(session) if resumed and session is not None else amounts.counted
    ah, seconds = now.ah - before.ah, now.energised_s - before.energised_s
    bmu_ah, bmu_wh, bmu_t_s = _by_bmu(amounts.bmu_t_s, look)
    return replace(
        amounts,
        counted=now,
        ah=amounts.ah + ah,
        wh=amounts.wh + now.wh - before.wh,
        bmu_ah=amounts.bmu_ah + bmu_ah,
        bmu_wh=amounts.bmu_wh + bmu_wh,
        energised_s=amounts.energised_s + seconds,
        step_changes=amounts.step_changes + now.step_changes - before.step_changes,
        rules=_shared(amounts.rules, amounts.binding, seconds, ah) if ah or seconds else amounts.rules,
        binding=_binding(look.decision.step) if look.runs else amounts.binding,
        steps=_shared(amounts.steps, amounts.step, seconds, ah) if ah or seconds else amounts.steps,
        step=_step(look.decision.step) if look.runs else amounts.step,
        bmu_t_s=bmu_t_s,
    )


def _by_bmu(until_s: float | None, look: Look) -> tuple[float, float, float | None]:
    """The BMU's Ah and Wh since its reading of `until_s`, and its newest reading."""
    current, volts = look.snapshot.battery.current_a, look.fresh(look.snapshot.battery.voltage_v)
    amps = look.fresh(current)
    if current is None or amps is None:
        return 0.0, 0.0, until_s
    if until_s is None or current.t_s <= until_s or look.decision.state in AT_REST:
        return 0.0, 0.0, current.t_s
    ah = amps * min(current.t_s - until_s, GAP_S) / 3600
    return ah, ah * (volts or 0.0), current.t_s


def _binding(step: CurrentStep | None) -> Rule:
    return (step.rule.id, step.rule.key, step.rule.place) if step is not None else BY_ITSELF


def _step(step: CurrentStep | None) -> Step:
    return (step.number, step.current_a) if step is not None else NO_STEP


def _shared(shares: tuple[Share[Of], ...], of: Of, seconds: float, ah: float) -> tuple[Share[Of], ...]:
    """The shares, with this much more of one rule's, or of one step's."""
    for at, (known, known_s, known_ah) in enumerate(shares):
        if known == of:
            return (*shares[:at], (of, known_s + seconds, known_ah + ah), *shares[at + 1 :])
    return (*shares, (of, seconds, ah))


def as_fields(amounts: Amounts) -> dict[str, object]:
    """As they stand in a record; `counted`, `binding`, `step`: for the service, when it goes on after a restart."""
    counted = amounts.counted
    return {
        "energised_s": round(amounts.energised_s, 3),
        "charger": {"ah": round(amounts.ah, 6), "wh": round(amounts.wh, 4)},
        "bmu": {"ah": round(amounts.bmu_ah, 6), "wh": round(amounts.bmu_wh, 4)},
        "step_changes": amounts.step_changes,
        "rules": [
            {"id": id_, "key": key, "place": place, "s": round(seconds, 3), "ah": round(ah, 6)}
            for (id_, key, place), seconds, ah in amounts.rules
        ],
        "steps": [
            {"step": number, "current_a": amps, "s": round(seconds, 3), "ah": round(ah, 6)}
            for (number, amps), seconds, ah in amounts.steps
        ],
        "counted": [round(counted.ah, 9), round(counted.wh, 9), round(counted.energised_s, 6), counted.step_changes],
        "binding": list(amounts.binding),
        "step": list(amounts.step),
    }


def from_fields(record: Mapping[str, Any]) -> Amounts:
    """The inverse; raises LookupError, TypeError or ValueError for anything else."""
    ah, wh, energised_s, step_changes = map(figure, record["counted"])
    return Amounts(
        Counted(ah, wh, energised_s, int(step_changes)),
        figure(record["charger"]["ah"]),
        figure(record["charger"]["wh"]),
        figure(record["bmu"]["ah"]),
        figure(record["bmu"]["wh"]),
        figure(record["energised_s"]),
        int(figure(record["step_changes"])),
        tuple(
            (_rule(one["id"], one["key"], one["place"]), figure(one["s"]), figure(one["ah"])) for one in record["rules"]
        ),
        _rule(*record["binding"]),
        tuple(
            (_numbered(one["step"], one["current_a"]), figure(one["s"]), figure(one["ah"]))
            for one in record.get("steps", ())  # earlier versions have none
        ),
        _numbered(*record.get("step", NO_STEP)),
    )


def _rule(id_: object, key: object, place: object) -> Rule:
    return str(id_), str(key), str(place)


def _numbered(number: object, amps: object) -> Step:
    return int(figure(number)), figure(amps)
