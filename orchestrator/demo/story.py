"""The course of a demo: its events in order, when to inject a fault, and when it is over. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import cast

from orchestrator.show import step_of

#: The state in which a fault is injected; all others are injected in mid-charge.
STAGES: Mapping[str, str] = {"precharge_no_rise": "PRECHARGE_PULSE", "rogue_run": "FULL"}
#: Faults that show only when somebody stops the bay.
SHOWN_BY_A_STOP = frozenset({"ignore_stop"})
#: Faults that come slowly: from when their first stop is counted; the others are there at once.
SINCE = {
    "over_temperature": "the pack began to heat up (its bound lies some seconds later)",
    "under_temperature": "the pack began to cool down (its bound lies some seconds later)",
}
#: How long after entering that state the fault is injected.
INJECT_AFTER_S = 4.0
#: How long the bay is watched after it has stopped.
LOOK_S = 6.0
#: A fault without effect by then has none.
NOTHING_S = 40.0
#: A demo still running by then is stuck.
LIMIT_S = 150.0
#: States in which no current flows and no stop is pending.
AT_REST = frozenset({"IDLE", "HELD", "FULL", "SUSPENDED", "TRIPPED", "OFFLINE", "UNCONTROLLABLE"})


@dataclass(slots=True)
class Story:
    """Follows the bay's status; `t_s` counts from the beginning of the demo."""

    fault: str | None
    events: list[tuple[float, str, str]] = field(default_factory=list)  #: t_s, what, why
    state: str = ""
    entered_s: float = 0.0
    step: object = None
    injected_s: float | None = None
    settled_s: float | None = None
    sessions: list[Mapping[str, object]] = field(default_factory=list)
    stopped_by: str = ""

    def look(self, t_s: float, bay: Mapping[str, object]) -> None:
        """Process one status of the bay."""
        state, step, reason = str(bay["state"]), bay["step"], str(bay["reason"])
        if state != self.state:
            self.events.append((t_s, state, reason))
            self.state, self.entered_s = state, t_s
            if state == "STOPPING":
                self.stopped_by = reason
        elif step is not None and step != self.step:
            self.events.append((t_s, f"step {step_of(step, bay['step_current_a'])}", str(bay["step_rule"])))
        self.step = step
        session = cast("Mapping[str, object] | None", bay["session"])
        if session is not None:
            self.sessions = [session]
        stopped = self.injected_s is not None and self.stopped_by and state in AT_REST
        if stopped and self.settled_s is None:
            self.settled_s = t_s

    def inject_now(self, t_s: float) -> bool:
        """Whether to inject the fault now."""
        stage = STAGES.get(self.fault or "", "CHARGING")
        if self.fault is None or self.injected_s is not None or self.state != stage:
            return False
        return t_s - self.entered_s >= INJECT_AFTER_S

    def injected(self, t_s: float, about: str) -> None:
        """The fault has just been injected."""
        self.injected_s, self.stopped_by = t_s, ""
        self.events.append((t_s, f"inject {self.fault}", about))

    def over(self, t_s: float) -> bool:
        """Whether the demo is over."""
        if t_s > LIMIT_S:
            return True
        if self.fault is None:
            return self.state == "FULL" and t_s - self.entered_s > 2.0
        if self.settled_s is not None:
            return t_s - self.settled_s > LOOK_S
        return self.injected_s is not None and t_s - self.injected_s > NOTHING_S

    @property
    def well(self) -> bool:
        """Whether it ended as it should: full, or stopped by the fault."""
        return self.state == "FULL" if self.fault is None else self.settled_s is not None
