"""Bays that change when a test says so, for what follows their status."""

from dataclasses import dataclass, field

from orchestrator.model import Cause, Decision, State

IDLE, TRIPPED = (Decision(state, Cause(state.lower())) for state in (State.IDLE, State.TRIPPED))


@dataclass
class Bay:
    """One that counts how often it is described."""

    name: str
    decision: Decision | None = IDLE
    volts: float = 50.0
    age_s: float = 0.0
    old: bool = False
    more: dict[str, object] = field(default_factory=dict)
    described: int = 0

    def status(self) -> dict[str, object]:
        self.described += 1
        state = self.decision.state if self.decision else "STARTING"
        charger = {"voltage_v": self.volts, "age_s": self.age_s, "t_s": self.age_s, "old": self.old}
        battery = {"age_s": {"soc_pct": self.age_s}, "old": ["soc_pct"] if self.old else []}
        return {"name": self.name, "state": state, "charger": charger, "battery": battery, **self.more}


class Hall:
    """Many of them."""

    def __init__(self, bays: int) -> None:
        self.bays = [Bay(f"bay-{number + 1}") for number in range(bays)]

    def change(self) -> None:
        """All of them, at once."""
        for bay in self.bays:
            bay.decision = TRIPPED if bay.decision is IDLE else IDLE
