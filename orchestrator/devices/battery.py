"""One BMU on a CAN bus, without I/O: frames and the time go in, requests come out, `view` is the present knowledge.

The bus's budget decides how often each object is read. One request is in flight (`sdo_client.py` rejects late
answers), the next as soon as answer and budget allow. A silent node is queried twice a second.
"""

from collections.abc import Callable
from functools import partial
from math import inf

from orchestrator.config.station import BatteryConfig
from orchestrator.devices.attention import Attention
from orchestrator.devices.battery_view import BatteryView
from orchestrator.devices.bmu_setup import BmuSetup
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.devices.emergency import emergency_cob_id, emergency_of, is_emergency
from orchestrator.devices.node_health import NOT_OURS, NodeHealth
from orchestrator.devices.other_masters import OtherMasters
from orchestrator.devices.read_plan import ReadPlan
from orchestrator.devices.requester import Requester, Send
from orchestrator.devices.sdo_client import SdoClient, Verdict
from orchestrator.devices.serial_number import SERIAL, SerialNumber
from orchestrator.devices.whose_answer import whose_answer
from orchestrator.model import BatteryLink, BatteryReading, Cause
from orchestrator.model.moment import moment
from orchestrator.protocol.objects import TpdoEntry
from orchestrator.protocol.sdo import (
    NmtState,
    SdoAbort,
    SdoAnswer,
    SdoMalformed,
    SdoValue,
    heartbeat_cob_id,
    parse_reply,
    reply_cob_id,
    request_cob_id,
    tpdo_cob_id,
)
from orchestrator.protocol.sdo_others import Ask

ANSWER_LIMIT_S = 1.5  #: without a valid answer for this long the node is not online
TOGGLE = 0x80  #: the alternating bit of a node-guarding answer; a heartbeat has none


class BatteryNode:
    """A BMU. Everything but `view` and `attend` belongs to the thread of its bus.

    `view` is replaced as a whole; `on_change()` is called after each replacement with news (a heartbeat is not news).
    """

    def __init__(self, bus: str, config: BatteryConfig, budget: BusBudget, on_change: Callable[[], None]) -> None:
        self.node_id = config.node_id
        self.trouble: Cause | None = None  #: what is wrong with the bus, though it is open
        self.next_due_s = -inf  #: when `turn()` next has something to do, apart from frames
        self._config = config
        self._bus = bus
        self._plan = ReadPlan(config, budget)
        self._attention = Attention(self._plan)
        self._client = SdoClient(config.sdo_timeout_s)
        self._setup, self._serial = BmuSetup(config), SerialNumber()
        self._health, self._others = NodeHealth(), OtherMasters()
        self._answer_s = -inf  # when the newest valid answer arrived
        self._requester = Requester(
            self.node_id, budget,
            plan=self._plan, client=self._client, setup=self._setup, serial=self._serial, others=self._others,
        )  # fmt: skip
        self._view = BatteryView(Cause.of("bmu_not_asked", node_id=self.node_id, bus=bus), on_change)
        self._handlers = self._frame_handlers()

    def _frame_handlers(self) -> dict[int, Callable[[bytes, float], None]]:
        handlers: dict[int, Callable[[bytes, float], None]] = {
            reply_cob_id(self.node_id): self._on_sdo,
            request_cob_id(self.node_id): self._on_request,
            heartbeat_cob_id(self.node_id): self._on_heartbeat,
            emergency_cob_id(self.node_id): self._on_emergency,
        }
        for tpdo in self._config.map.tpdos if self._config.tpdo_s is not None else ():
            handlers[tpdo_cob_id(tpdo.number, self.node_id)] = partial(self._on_tpdo, tpdo)
        return handlers

    @property
    def cob_ids(self) -> tuple[int, ...]:
        """The COB-IDs of frames for `on_frame`."""
        return tuple(self._handlers)

    @property
    def view(self) -> tuple[BatteryReading, BatteryLink]:
        """The present reading and link. May be called from any thread."""
        return self._view.current

    def attend(self, *, closely: bool) -> None:
        """From the next turn on, watch the node closely, or as one at rest. May be called from any thread."""
        self._attention.wanted = closely
        self.next_due_s = -inf

    def on_frame(self, cob_id: int, data: bytes, now_s: float) -> None:
        """Handle a frame with one of `cob_ids`, not sent by us."""
        self._health.frame(now_s)
        self._handlers[cob_id](data, now_s)
        self._publish()

    def on_nmt(self, data: bytes, now_s: float) -> None:
        """Handle an NMT command, not sent by us."""
        if len(data) == 2 and data[1] in (0, self.node_id):
            self._others.commanded(data[0], now_s, everybody=data[1] == 0)
            self._say_others()
            self._publish()

    def turn(self, now_s: float, send: Send) -> None:
        """Do what is due: give up overdue requests, detect silence, send the next request by `send(cob_id, data)`."""
        self._watch(now_s)
        self._attention.follow(self._view.amps)
        if self._serial.given_up(now_s):
            self._view.set(serial=0)
        self.next_due_s = self._requester.ask(now_s, send, online=self._view.link.online)
        if self._view.link.online:
            self.next_due_s = min(self.next_due_s, self._answer_s + ANSWER_LIMIT_S)
        self._publish()

    def fail(self, problem: Cause, now_s: float) -> None:
        """The bus, or our own code, failed: the request is lost, and the reason is shown until an answer arrives."""
        self.next_due_s = self._requester.fail(now_s)
        self._view.set(online=False, problem=problem)
        self._publish()

    def _watch(self, now_s: float) -> None:
        asked = self._client.pending
        expired = self._client.expire(now_s)
        if expired and asked is not None:
            self._plan.unanswered(asked, now_s)
        link = self._view.link
        if link.online:
            if now_s >= self._answer_s + ANSWER_LIMIT_S:  # the same sum as in `turn`: a difference rounds differently
                # The next node to answer may be another battery, which did not send this emergency.
                self._view.set(online=False, problem=self._why_silent(), emergency=None)
            elif link.heartbeat_s is not None and link.heartbeat_t_s is not None:
                self._setup.watch(now_s, link.heartbeat_t_s)
        elif expired:
            self._view.set(problem=self._why_silent())

    def _why_silent(self) -> Cause:
        if self._view.link.nmt_state == NmtState.STOPPED:
            return Cause.of("bmu_stopped", node_id=self.node_id, bus=self._bus)
        if self.trouble is not None:
            return Cause.of("bmu_cut_off", node_id=self.node_id, bus=self._bus, why=self.trouble)
        return self._health.silence(self.node_id, self._bus, self._config.sdo_timeout_s)

    def _on_request(self, data: bytes, now_s: float) -> None:
        """Handle another master's request to the node."""
        self._health.excuse()
        request = self._others.asked(data, now_s)
        if request is not None and request.ask in (Ask.WRITE, Ask.BLOCK_WRITE):
            self._setup.touched((request.index, request.sub), request.timer_ms, now_s)
        self._say_others()

    def _say_others(self) -> None:
        said, said_s = self._others.said, self._others.said_s
        if said and said_s != self._view.link.other_master_t_s:
            self._view.set(other_master=said)
            self._view.set(other_master_t_s=said_s, news=False)

    def _on_sdo(self, data: bytes, now_s: float) -> None:
        self.next_due_s = now_s
        asked, reply = self._client.pending, parse_reply(data)
        verdict = whose_answer(reply, data, self._client, self._others, now_s)
        self._health.answer(verdict, reply.cause if isinstance(reply, SdoMalformed) else None)
        if verdict is Verdict.ACCEPTED and not isinstance(reply, SdoMalformed):
            self._accept(reply, now_s)
            return
        if verdict not in NOT_OURS:
            self._view.dropped()
        if verdict is Verdict.UNCLEAR and asked is not None:
            self._plan.unanswered(asked, now_s)
        if not isinstance(reply, SdoMalformed) and (polled := self._plan.get((reply.index, reply.sub))):
            self._view.doubted(polled.answers.other(verdict, self._client.first, reply, now_s))

    def _accept(self, reply: SdoAnswer, now_s: float) -> None:
        self._answer_s = now_s
        self._requester.hurry()
        if not self._view.link.online:
            self._serial.arrived(now_s)
            self._view.set(online=True, problem=None, serial=None)
        if self._others.active:
            self._others.ours_answered(self._client.asked_s)
        if self._client.writing:
            self._view.set(**self._setup.configured(reply, now_s, armed=self._view.link.heartbeat_s is not None))
            return
        if (polled := self._plan.get((reply.index, reply.sub))) is None:
            self._told_once(reply, now_s)
            return
        if isinstance(reply, SdoAbort):
            polled.abort = reply
        elif isinstance(reply, SdoValue):
            self._view.measured(polled.from_sdo(reply, self._client.asked_s))
        self.next_due_s = min(self._requester.due_s(now_s), now_s + ANSWER_LIMIT_S)
        if self._view.link.abort or polled.abort:
            abort = next((polled.abort for polled in self._plan.objects if polled.abort), None)
            self._view.set(abort=abort.cause if abort else None, abort_code=abort.code if abort else 0)

    def _told_once(self, reply: SdoAnswer, now_s: float) -> None:
        """The serial number was read, or the heartbeat's period was read back."""
        if (reply.index, reply.sub) == SERIAL:
            self._view.set(serial=self._serial.answered(reply))
        elif isinstance(reply, SdoValue) and (found := self._setup.checked(reply.value)):
            self._view.set(heartbeat_set=found, heartbeat_set_t_s=now_s)

    def _on_heartbeat(self, data: bytes, now_s: float) -> None:
        if len(data) != 1 or data[0] == TOGGLE:
            self._view.dropped()
        elif data[0] == NmtState.BOOT_UP:
            self._booted(now_s)
        else:
            state = data[0] & ~TOGGLE
            self._setup.heard(state)
            self._view.set(nmt_state=state)
            if state == data[0]:  # else it answers another master's node guarding, and is not a heartbeat
                if (before_s := self._view.link.heartbeat_t_s) is not None:
                    self._setup.interval(now_s - before_s, now_s)
                self._view.set(heartbeat_t_s=moment(now_s), news=False)
            if self._setup.start_due or self._setup.check_due:
                self.next_due_s = now_s

    def _booted(self, now_s: float) -> None:
        """Forget everything that was known, requested or configured before."""
        self._view.booted(now_s)
        self._client.clear()
        self._others.clear()
        self._setup.booted()
        self._serial.arrived(now_s)
        self._plan.restart(now_s)
        self._requester.hurry()
        self.next_due_s = now_s

    def _on_emergency(self, data: bytes, _now_s: float) -> None:
        if is_emergency(data):
            self._view.set(emergency=emergency_of(data))
        else:
            self._view.dropped()

    def _on_tpdo(self, tpdo: TpdoEntry, data: bytes, now_s: float) -> None:
        values = None if self._setup.tpdos_changed else self._plan.from_tpdo(tpdo, data, now_s)
        if values is None:
            self._view.dropped()
        for fields in values or ():
            self._view.measured(fields)

    def _publish(self) -> None:
        if problem := self._health.problem(self.node_id, self._bus):
            self._view.set(online=False, problem=problem)
        self._view.publish()
