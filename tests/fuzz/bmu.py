"""The CAN bus: any frames with a BMU's ids, at any time, between the node's requests."""

from orchestrator.config.load import load_map
from orchestrator.devices.other_masters import MOST_OPEN
from orchestrator.model import BatteryReading, Cause, Measurement
from orchestrator.model.moment import moment
from orchestrator.protocol.pages import parse_page
from orchestrator.protocol.sdo import NMT_COB_ID, SdoMalformed, parse_reply
from orchestrator.protocol.words import decode_word
from tests.core.said import say
from tests.devices.bmu_bench import EMERGENCY, HEARTBEAT, NODE_ID, REPLY, REQUEST, Bench, config
from tests.fuzz.target import Target, cut_records, kind_of_record, record, records
from tests.protocol.vectors import BMU

#: Events: a frame on one of several ids, an answer to the newest request, time, trouble with the bus, and bytes
#: for parsers outside the node.
SDO, HEART, EMCY, ELSE, ANSWER, PAUSE, TROUBLE, PARSE = range(8)
#: Chosen by the first byte of ELSE: a TPDO, or another master's request or NMT command.
ELSE_COB_IDS = (0x190, 0x290, 0x390, REQUEST, NMT_COB_ID)
OTHERS, NMT = b"\3", b"\4"
COMMANDS = (0x43, 0x43, 0x4B, 0x4F, 0x60, 0x80, 0x41, 0xFF)
#: From another master: reads, writes, aborts, segments and blocks.
REQUESTS = (
    "4000600000000000", "2b17100088130000", "8000600000000405", "6000000000000000", "a00060007f000000",
    "a300000000000000", "c200600004000000", "0100000000000000", "40081000", "2b00180564000000",
)  # fmt: skip
MAPS = (load_map("tabos"), load_map("tabos-lsb"))
#: Chosen by an input's first byte: heartbeat and TPDO periods, and the map.
CONFIGS = tuple(
    config(heartbeat_s=heartbeat_s, tpdo_s=tpdo_s, object_map=object_map)
    for heartbeat_s in (None, 0.5)
    for tpdo_s in (None, 0.1)
    for object_map in MAPS
)
MAX_EVENTS = 16
MAX_TEXT = 300  #: characters in any message about a battery


class Session:
    """A node on a bench, and a clock; each event may be hostile."""

    def __init__(self, choice: int) -> None:
        settings = CONFIGS[choice % len(CONFIGS)]
        self.bench = Bench(settings)
        self._objects = settings.map.objects
        self._ranges = {field.name: field.range for entry in self._objects for field in entry.fields}
        self._shown: object = None
        self._keys = len(self._objects) + 1 + len(settings.map.tpdos)  # all that can be asked for

    def event(self, kind: int, content: bytes) -> None:
        """The next event on the bus."""
        bench = self.bench
        if kind == PAUSE:
            bench.run(content[0] / 100 if content else 0.02)
        elif kind == TROUBLE:
            bench.node.trouble = Cause("can_passive") if content else None
            bench.node.fail(Cause("can_not_open"), bench.now_s)
        elif kind == PARSE:
            self._parse(content)
        elif kind == ANSWER:
            self._answer(content)
        else:
            ids = {SDO: REPLY, HEART: HEARTBEAT, EMCY: EMERGENCY}
            self._frame(ids.get(kind, ELSE_COB_IDS[content[0] % 5 if content else 0]), content[kind == ELSE :])
        self._is_honest()

    def _answer(self, content: bytes) -> None:
        """An answer to the newest request or the next one: well-formed, except where the content breaks it."""
        self.bench.step(self.bench.now_s + 0.6)
        asked = [data for cob_id, data in self.bench.sent[-1:] if cob_id == REQUEST]
        command = COMMANDS[content[0] % len(COMMANDS)] if content else 0x43
        for data in asked:
            if data[0] != 0x40 and not content:
                command = 0x60
            self._frame(REPLY, bytes((command,)) + data[1:4] + content[1:5].ljust(4, b"\0"))

    def _frame(self, cob_id: int, data: bytes) -> None:
        if cob_id in self.bench.node.cob_ids:  # the bus passes on no others
            self.bench.node.on_frame(cob_id, data, self.bench.now_s)
        elif cob_id == NMT_COB_ID:
            self.bench.node.on_nmt(data, self.bench.now_s)

    def _parse(self, content: bytes) -> None:
        reply = parse_reply(content)
        assert not isinstance(reply, SdoMalformed) or len(say(reply.cause)) <= MAX_TEXT
        for value in parse_page(NODE_ID, content).values():
            assert value is None or isinstance(value, (Measurement, Cause))
        for entry in self._objects:
            for name, value in decode_word(entry, int.from_bytes(content, "little"), len(content), 0.0).items():
                assert not isinstance(value, Measurement) or value.value in self._ranges[name]

    def _is_honest(self) -> None:
        """Readings are in range and in the past; nothing grows; every frame goes to this node."""
        bench, link = self.bench, self.bench.link
        assert len(bench.node._client._answers) <= self._keys
        assert len(bench.node._others._open) <= MOST_OPEN
        assert all(cob_id in (NMT_COB_ID, REQUEST) and len(data) <= 8 for cob_id, data in bench.sent)
        del bench.sent[:-1]
        if bench.node.view is self._shown:
            return
        self._shown = bench.node.view
        for name in BatteryReading.__slots__:
            value = getattr(bench.reading, name)
            assert value is None or (value.value in self._ranges[name] and value.t_s <= moment(bench.now_s)), name
        assert link.online == (say(link.problem) == "")
        assert set(link.implausible) <= set(self._ranges)
        for text in (
            link.problem,
            link.abort,
            link.emergency,
            link.other_master,
            link.heartbeat_set,
            *link.implausible.values(),
        ):
            assert len(say(text)) <= MAX_TEXT and say(text).isprintable(), text


def one(data: bytes) -> None:
    """A few seconds with one BMU."""
    session = Session(data[0] if data else 0)
    for number, (kind, content) in enumerate(records(data[1:])):
        session.event(kind, content)
        if number == MAX_EVENTS:
            break


def _cut(data: bytes) -> list[bytes]:
    return [data[:1], *cut_records(data[1:])]


_HEALTHY = b"".join(record(ANSWER) + record(PAUSE, b"\x02") for _ in range(6))

TARGET = Target(
    one,
    _cut,
    kind_of_record,
    [
        *(bytes((choice,)) + _HEALTHY for choice in range(len(CONFIGS))),
        *(bytes((7,)) + record(PAUSE) + record(SDO, exchange.reply) for exchange in BMU),
    ],
    [
        record(ANSWER), record(ANSWER, b"\0\x09\x40\xff\xf8"), record(ANSWER, b"\0\xff\xff\xff\xff"),
        record(ANSWER, b"\5\0\0\2\6"), record(ANSWER, b"\5\x22\0\0\x08"), record(ANSWER, b"\2\1"),
        record(ANSWER, b"\4"), record(ANSWER, b"\7"), _HEALTHY, record(SDO, bytes.fromhex("8000600000000206")),
        record(SDO, bytes.fromhex("4300600000000000")), record(SDO, bytes(7)),
        record(SDO, bytes.fromhex("6017100000000000")), record(HEART, b"\0"), record(HEART, b"\5"),
        record(HEART, b"\4"), record(HEART, b"\x7f"), record(HEART), record(EMCY, bytes(8)),
        record(EMCY, b"\x10\x42\0\0\0\0\0\0"), record(EMCY, b"\1"),
        *(record(ELSE, bytes((number,)) + content) for number in range(3) for content in (bytes(8), b"\xff" * 8)),
        record(ELSE, b"\1\1"),
        record(PAUSE, b"\x02"), record(PAUSE, b"\x32"), record(PAUSE, b"\xc8"), record(TROUBLE), record(TROUBLE, b"\1"),
        record(PARSE, b"\x70\1" + bytes(6)), record(PARSE, b"\x70\2" + b"\xff" * 6),
        record(PARSE, b"\x70\3" + bytes(6)),
        *(record(ELSE, OTHERS + bytes.fromhex(request)) for request in REQUESTS),
        record(SDO, bytes.fromhex("410810000a000000")), record(SDO, bytes.fromhex("0043006000000000")),
        record(SDO, bytes.fromhex("c60060000a000000")), record(SDO, bytes.fromhex("0143006000000000")),
        *(record(ELSE, NMT + command) for command in (b"\2\x10", b"\x81\0", b"\1", b"\xff\xff")),
    ],
    ["orchestrator/protocol/sdo.py", "orchestrator/protocol/words.py", "orchestrator/protocol/pages.py",
     "orchestrator/devices/battery.py", "orchestrator/devices/battery_view.py", "orchestrator/devices/bmu_setup.py",
     "orchestrator/devices/emergency.py", "orchestrator/devices/node_health.py", "orchestrator/devices/polled.py",
     "orchestrator/devices/read_plan.py", "orchestrator/devices/requester.py", "orchestrator/devices/sdo_client.py",
     "orchestrator/protocol/sdo_others.py",
     "orchestrator/devices/other_masters.py", "orchestrator/devices/two_answers.py",
     "orchestrator/devices/whose_answer.py"],
    max_bytes=100,
    limit_s=1.0,
)  # fmt: skip
