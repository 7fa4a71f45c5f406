"""The configuration of a BMU: the periods of its heartbeat and its TPDOs, each a 16-bit timer (manual §2.5, §2.6).

The BMU forgets them with every boot. Nothing else is ever written to it (`link/can_gate.py` ensures that).
"""

from dataclasses import dataclass
from math import inf
from typing import Any

from orchestrator.config.station import BatteryConfig
from orchestrator.devices.sdo_client import Key
from orchestrator.model import Cause
from orchestrator.protocol.sdo import NmtState, SdoAnswer, SdoWritten, write_request

HEARTBEAT: Key = (0x1017, 0)
_TPDO_TIMER = 0x17FF  #: + the TPDO's number: 0x1800, 0x1801, 0x1802 (§2.5 has a misprint: 0x1082)
_TPDO_TIMER_SUB = 5

CHECK_PERIODS = 3  #: after this many missed heartbeats read back the period, well before it counts as lost (core: 4.5)
ODD = (0.6, 1.5)  #: the normal interval between two heartbeats, in periods …
MOST_ODD = 3  #: … after this many abnormal ones in a row, the period is also read back

#: The contents, timing and COB-IDs of TPDO 1 … 4; only the timer's value does not change the meaning of a frame.
TPDO_SETTINGS = (*range(0x1800, 0x1804), *range(0x1A00, 0x1A04))

RETRY_S = 1.0  #: after this, an unanswered write is repeated, and a period may be read back again
LOST_PERIODS = 5  #: a node that still answers but missed this many heartbeats has booted without our noticing


@dataclass(frozen=True, slots=True)
class TimerWrite:
    """One timer and the period to write to it."""

    key: Key
    period_s: float

    def frame(self) -> bytes:
        """The SDO request."""
        return write_request(*self.key, round(self.period_s * 1000), 2)


def timer_writes(config: BatteryConfig) -> tuple[TimerWrite, ...]:
    """The timers requested by this bay's station file, in the order of writing."""
    writes = []
    if config.heartbeat_s is not None:
        writes.append(TimerWrite(HEARTBEAT, config.heartbeat_s))
    if config.tpdo_s is not None:
        timers = ((_TPDO_TIMER + tpdo.number, _TPDO_TIMER_SUB) for tpdo in config.map.tpdos)
        writes += [TimerWrite(timer, config.tpdo_s) for timer in timers]
    return tuple(writes)


class BmuSetup:
    """The part of the configuration that is still to be written or checked."""

    __slots__ = (
        "_all", "_any_tpdo", "_check_s", "_heard", "_heartbeat_s", "_left", "_lost_s", "_odd", "_rearm", "_retry_s",
        "check_due", "start_due", "tpdos_changed",
    )  # fmt: skip

    def __init__(self, config: BatteryConfig) -> None:
        self._all = timer_writes(config)
        self._heartbeat_s = inf if config.heartbeat_s is None else config.heartbeat_s
        self._lost_s = LOST_PERIODS * self._heartbeat_s
        self.booted()

    def booted(self) -> None:
        """The node booted, and has forgotten all settings."""
        #: Another master changed the TPDOs' contents or COB-IDs: they must not be used until the node boots.
        self.tpdos_changed = False
        self.restart()

    def restart(self) -> None:
        """Write everything again."""
        self._left = list(self._all)
        self._retry_s = -inf
        self._any_tpdo = False
        self.start_due = False  #: an NMT start must be sent, so that the TPDOs begin
        self.check_due = False  #: the heartbeat's period must be read back
        self._check_s = -inf  # when that may be done again
        self._odd = 0
        self._heard = self._rearm = False

    @property
    def settled(self) -> bool:
        """Whether nothing is left to be written, sent or read back."""
        return not (self._left or self.start_due or self.check_due)

    def next_write(self, now_s: float) -> TimerWrite | None:
        """The next write; None if nothing is left or it is too early to try again."""
        return self._left[0] if self._left and now_s >= self._retry_s else None

    def sent(self, now_s: float) -> None:
        """The next write went out."""
        self._retry_s = now_s + RETRY_S

    def answered(self, *, written: bool) -> TimerWrite:
        """The write was answered, and so is done; a refusal is also an answer, and not repeated."""
        self._retry_s = -inf
        write = self._left.pop(0)
        self._any_tpdo |= written and write.key != HEARTBEAT
        self.start_due = self._any_tpdo and not self._left
        return write

    def configured(self, reply: SdoAnswer, now_s: float, *, armed: bool) -> dict[str, Any]:
        """As `answered`, and what the link says of the heartbeat from now on; `armed`: it was waited for already."""
        written = isinstance(reply, SdoWritten)
        write = self.answered(written=written)
        if write.key != HEARTBEAT:
            return {}
        if not written:  # not every BMU allows it: without a heartbeat there is nothing to watch
            return {"heartbeat_s": None, "heartbeat_t_s": None}
        return {} if armed and not self.rearms() else {"heartbeat_s": write.period_s, "heartbeat_t_s": now_s}

    def heard(self, nmt_state: int) -> None:
        """A heartbeat came. A node that should send TPDOs is started again: the first start, which is unconfirmed, was
        lost, or another master's NMT command has stopped it."""
        self.start_due |= self._any_tpdo and not self._left and nmt_state != NmtState.OPERATIONAL

    def interval(self, seconds: float, now_s: float) -> None:
        """A heartbeat came this long after the previous one."""
        self._heard = True
        low, high = ODD
        self._odd = 0 if low <= seconds / self._heartbeat_s <= high else self._odd + 1
        if self._odd >= MOST_ODD:
            self._odd = 0
            self._check(now_s)

    def watch(self, now_s: float, heartbeat_t_s: float) -> None:
        """The node answers: if its heartbeats are missing, read back its period, and finally write everything again."""
        age_s = now_s - heartbeat_t_s
        if age_s >= CHECK_PERIODS * self._heartbeat_s:
            self._check(now_s)
        if not self._left and age_s > self._lost_s and now_s >= self._retry_s:
            self.restart()
            self._retry_s = now_s + RETRY_S

    def touched(self, key: Key, period_ms: int | None, now_s: float) -> None:
        """Another master writes an object, which may be one of our timers or a TPDO setting."""
        index, sub = key
        if index in TPDO_SETTINGS and sub != _TPDO_TIMER_SUB:
            self.tpdos_changed = True
        mine = next((write for write in self._all if write.key == key), None)
        if mine is None or period_ms == round(mine.period_s * 1000) or mine in self._left:
            return
        if key == HEARTBEAT:
            self._check_s = -inf
            self._check(now_s)
        else:
            self._left.append(mine)
            self._retry_s = max(self._retry_s, now_s + RETRY_S)

    def checking(self, now_s: float) -> None:
        """The heartbeat's period is being read back."""
        self.check_due, self._check_s = False, now_s + RETRY_S

    def checked(self, period_ms: int) -> Cause | None:
        """What it is. None if it is ours; else what was found, and ours will be written again.

        No heartbeat at all may also be due to an unnoticed restart: then everything is written again.
        """
        if period_ms == round(self._heartbeat_s * 1000):
            return None
        heard = self._heard
        if period_ms == 0:
            self.restart()
            self._rearm = heard
            return Cause.of("heartbeat_was_off", period_s=self._heartbeat_s)
        if HEARTBEAT not in [write.key for write in self._left]:
            self._left.insert(0, self._all[0])
        self._retry_s, self._rearm = -inf, heard
        return Cause.of("heartbeat_was", found_s=period_ms / 1000, period_s=self._heartbeat_s)

    def rearms(self) -> bool:
        """Whether to start waiting for the heartbeat afresh after it was written.

        Only if another period was found, and once until a heartbeat comes: otherwise, requesting a lost one again would
        make it look alive.
        """
        rearm, self._rearm = self._rearm, False
        self._heard = self._heard and not rearm
        return rearm

    def _check(self, now_s: float) -> None:
        if now_s >= self._check_s and not self._left:
            self.check_due = True
