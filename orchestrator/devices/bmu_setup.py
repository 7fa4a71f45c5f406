"""What is configured in a BMU: the periods of its heartbeat and its TPDOs, each a 16-bit timer (manual §2.5, §2.6).

It forgets them with every boot. Nothing else is ever written to it (`link/can_gate.py` sees to that).
"""

from dataclasses import dataclass
from math import inf

from orchestrator.config.station import BatteryConfig
from orchestrator.devices.sdo_client import Key
from orchestrator.protocol.sdo import NmtState, write_request

HEARTBEAT: Key = (0x1017, 0)
_TPDO_TIMER = 0x17FF  #: + the TPDO's number: 0x1800, 0x1801, 0x1802 (§2.5 has a misprint: 0x1082)
_TPDO_TIMER_SUB = 5

RETRY_S = 1.0  #: a write that was not answered is tried again after this
LOST_PERIODS = 5  #: so many heartbeats missed by a node that still answers: it booted and we did not hear it


@dataclass(frozen=True, slots=True)
class TimerWrite:
    """One timer and the period that it shall have."""

    key: Key
    period_s: float

    def frame(self) -> bytes:
        """The SDO request."""
        return write_request(*self.key, round(self.period_s * 1000), 2)


def timer_writes(config: BatteryConfig) -> tuple[TimerWrite, ...]:
    """The timers that this bay's station file asks for, in the order of writing."""
    writes = []
    if config.heartbeat_s is not None:
        writes.append(TimerWrite(HEARTBEAT, config.heartbeat_s))
    if config.tpdo_s is not None:
        timers = ((_TPDO_TIMER + tpdo.number, _TPDO_TIMER_SUB) for tpdo in config.map.tpdos)
        writes += [TimerWrite(timer, config.tpdo_s) for timer in timers]
    return tuple(writes)


class BmuSetup:
    """What of it is still to be done."""

    __slots__ = ("_all", "_any_tpdo", "_left", "_lost_s", "_retry_s", "start_due")

    def __init__(self, config: BatteryConfig) -> None:
        self._all = timer_writes(config)
        self._lost_s = inf if config.heartbeat_s is None else LOST_PERIODS * config.heartbeat_s
        self.restart()

    def restart(self) -> None:
        """The node booted: everything again."""
        self._left = list(self._all)
        self._retry_s = -inf
        self._any_tpdo = False
        self.start_due = False  #: an NMT start is to be sent, so that the TPDOs begin

    def next_write(self, now_s: float) -> TimerWrite | None:
        """What to write next; None if nothing is left or it is too early to try again."""
        return self._left[0] if self._left and now_s >= self._retry_s else None

    def sent(self, now_s: float) -> None:
        """The next write went out."""
        self._retry_s = now_s + RETRY_S

    def answered(self, *, written: bool) -> TimerWrite:
        """It was answered, and so is done; a refusal is an answer, too, and not asked for again."""
        self._retry_s = -inf
        write = self._left.pop(0)
        self._any_tpdo |= written and write.key != HEARTBEAT
        self.start_due = self._any_tpdo and not self._left
        return write

    def heard(self, nmt_state: int) -> None:
        """A heartbeat came. A node that is to send TPDOs is started again: the first start, which nobody confirms, was
        lost, or somebody else's NMT command has stopped it."""
        self.start_due |= self._any_tpdo and not self._left and nmt_state != NmtState.OPERATIONAL

    def watch(self, now_s: float, heartbeat_t_s: float) -> None:
        """The node answers: if its heartbeats do not come, write everything again."""
        if not self._left and now_s - heartbeat_t_s > self._lost_s and now_s >= self._retry_s:
            self.restart()
            self._retry_s = now_s + RETRY_S
