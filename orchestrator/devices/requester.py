"""Decides which request goes to a BMU next, and when: one at a time, as the bus's budget and other masters allow."""

from collections.abc import Callable
from math import inf

from orchestrator.devices.bmu_setup import HEARTBEAT, BmuSetup, TimerWrite
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.devices.other_masters import OtherMasters
from orchestrator.devices.polled import Polled
from orchestrator.devices.read_plan import ReadPlan
from orchestrator.devices.sdo_client import Key, SdoClient
from orchestrator.devices.serial_number import SERIAL, SerialNumber
from orchestrator.protocol.sdo import NMT_COB_ID, NmtCommand, nmt_frame, read_request, request_cob_id

Send = Callable[[int, bytes], None]

SILENT_S = 0.5  #: pause between requests to a node that is not online, so that it does not take the others' time


class Requester:
    """Reads one BMU's objects and serial number, sets its timers and starts it. Belongs to the thread of its bus."""

    __slots__ = (
        "_budget", "_client", "_node_id", "_not_before_s", "_others", "_plan", "_serial", "_setup", "_slot_s",
    )  # fmt: skip

    def __init__(
        self,
        node_id: int,
        budget: BusBudget,
        *,
        plan: ReadPlan,
        client: SdoClient,
        setup: BmuSetup,
        serial: SerialNumber,
        others: OtherMasters,
    ) -> None:
        self._node_id, self._budget = node_id, budget
        self._plan, self._client, self._setup, self._others = plan, client, setup, others
        self._serial = serial
        self._not_before_s = -inf  # when a silent node may be queried again
        self._slot_s: float | None = None  # when the bus's budget lets the next request go out, if reserved

    def hurry(self) -> None:
        """The node answers, or has just booted: do not wait any longer."""
        self._not_before_s = -inf

    def due_s(self, now_s: float) -> float:
        """When the next request is due, with none in flight. A request that is due already gets its slot."""
        if not self._setup.settled:
            return now_s
        due_s = self._plan.due_s
        if due_s > now_s:
            return max(now_s, min(due_s, self._serial.due_s)) if self._client.may_ask(SERIAL) else due_s
        if self._slot_s is None:
            self._slot_s = self._budget.reserve(now_s)
        return self._slot_s

    def fail(self, now_s: float) -> float:
        """The request is lost; returns when the node may be queried again."""
        self._client.drop()
        self._slot_s = None
        self._not_before_s = now_s + SILENT_S
        return self._not_before_s

    def ask(self, now_s: float, send: Send, *, online: bool) -> float:
        """Send the next request if one is due, and return when to call this again."""
        if self._client.pending is not None:
            return self._client.deadline_s
        if now_s < self._not_before_s:
            return self._not_before_s
        if self._setup.start_due:
            self._setup.start_due = False
            send(NMT_COB_ID, nmt_frame(NmtCommand.START, self._node_id))
            return now_s
        write = self._setup.next_write(now_s) if online else None
        if write is not None and self._client.may_ask(write.key):
            return self._request(write, now_s, send, online=online)
        if self._setup.check_due and online and self._client.may_ask(HEARTBEAT):
            return self._request(HEARTBEAT, now_s, send, online=online)
        chosen = self._plan.choose(now_s, self._client)
        if isinstance(chosen, Polled):
            return self._request(chosen, now_s, send, online=online)
        if not online or not self._client.may_ask(SERIAL):
            return chosen
        if now_s < self._serial.due_s:
            return min(chosen, self._serial.due_s)
        return self._request(SERIAL, now_s, send, online=online)

    def _request(self, what: TimerWrite | Polled | Key, now_s: float, send: Send, *, online: bool) -> float:
        if self._slot_s is None:
            self._slot_s = self._budget.reserve(now_s)
        begin_s = max(self._slot_s, self._others.wait_until_s(now_s))
        if now_s < begin_s:
            return begin_s
        self._slot_s = None
        if isinstance(what, Polled):
            key, frame = what.key, read_request(*what.key)
            self._plan.asked(what, now_s)
        elif isinstance(what, TimerWrite):
            key, frame = what.key, what.frame()
            self._setup.sent(now_s)
        else:
            key, frame = what, read_request(*what)
            (self._serial.asked if what == SERIAL else self._setup.checking)(now_s)
        self._client.ask(key, now_s, write=isinstance(what, TimerWrite))
        if not online:
            self._not_before_s = now_s + SILENT_S
        send(request_cob_id(self._node_id), frame)
        return self._client.deadline_s
