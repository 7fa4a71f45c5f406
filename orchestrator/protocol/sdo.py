"""CANopen's expedited SDO exchange and the few other frames that the BMU uses, without I/O (CANopen manual §2, §3).

Reading or writing an object takes one frame each way. Segmented and block transfers, which could continue for ever, are
deliberately not supported. Everything is little-endian (§3).
"""

from dataclasses import dataclass
from enum import IntEnum

from orchestrator.model import Cause
from orchestrator.protocol.hextext import hex_of

FRAME_BYTES = 8

_READ = 0x40
_WRITE = {1: 0x2F, 2: 0x2B, 4: 0x23}  # command by size
_VALUE = {0x4F: 1, 0x4B: 2, 0x43: 4}  # size by command
_WRITTEN = 0x60
_ABORT = 0x80


class NmtCommand(IntEnum):
    """The commands of an NMT frame (COB-ID 0) (§3.7)."""

    START = 0x01
    STOP = 0x02
    PREOPERATIONAL = 0x80
    RESET_NODE = 0x81  #: the board reboots
    RESET_COMMUNICATION = 0x82  #: the node sends its boot-up frame again


class NmtState(IntEnum):
    """The state in a heartbeat (§3.8)."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PREOPERATIONAL = 0x7F


NMT_COB_ID = 0x000
_TPDO_BASES = {1: 0x180, 2: 0x280, 3: 0x380, 4: 0x480}


def request_cob_id(node_id: int) -> int:
    """The COB-ID of SDO requests to this node."""
    return 0x600 + node_id


def reply_cob_id(node_id: int) -> int:
    """The COB-ID of SDO replies from this node."""
    return 0x580 + node_id


def heartbeat_cob_id(node_id: int) -> int:
    """The COB-ID of boot-up and heartbeat from this node."""
    return 0x700 + node_id


def tpdo_cob_id(number: int, node_id: int) -> int:
    """The COB-ID of TPDO 1 … 4 from this node."""
    return _TPDO_BASES[number] + node_id


def nmt_frame(command: NmtCommand, node_id: int) -> bytes:
    """The data of an NMT frame, for COB-ID 0."""
    return bytes((command, node_id))


def _multiplexer(index: int, sub: int) -> bytes:
    if not (0 <= index <= 0xFFFF and 0 <= sub <= 0xFF):
        raise ValueError(f"object 0x{index:X} sub {sub}: an index has 16 bits, a sub-index 8")
    return index.to_bytes(2, "little") + bytes((sub,))


def read_request(index: int, sub: int) -> bytes:
    """The frame that reads an object."""
    return bytes((_READ,)) + _multiplexer(index, sub) + bytes(4)


def write_request(index: int, sub: int, value: int, size: int) -> bytes:
    """The frame that writes an unsigned value of 1, 2 or 4 bytes; ValueError if it does not fit."""
    if size not in _WRITE or not 0 <= value < 1 << 8 * size:
        raise ValueError(f"{value} in {size} bytes: an expedited write takes an unsigned value of 1, 2 or 4 bytes")
    return bytes((_WRITE[size],)) + _multiplexer(index, sub) + value.to_bytes(4, "little")


@dataclass(frozen=True, slots=True)
class SdoValue:
    """An object was read."""

    index: int
    sub: int
    value: int  #: unsigned
    size: int  #: bytes declared by the reply: 1, 2 or 4


@dataclass(frozen=True, slots=True)
class SdoWritten:
    """An object was written."""

    index: int
    sub: int


@dataclass(frozen=True, slots=True)
class SdoAbort:
    """The node is there but refuses."""

    index: int
    sub: int
    code: int

    @property
    def cause(self) -> Cause:
        """What it refuses, and why: the code's meaning is a word of the catalogue (CiA 301, table 22)."""
        meaning = f"sdo_{self.code:08X}" if self.code in ABORTS else "sdo_undocumented"
        return Cause.of("sdo_abort", index=self.index, sub=self.sub, code=self.code, meaning=meaning)


@dataclass(frozen=True, slots=True)
class SdoMalformed:
    """A reply that we do not understand; it counts as no reply."""

    cause: Cause


SdoAnswer = SdoValue | SdoWritten | SdoAbort
SdoReply = SdoAnswer | SdoMalformed


def parse_reply(data: bytes | bytearray) -> SdoReply:
    """Decode a frame on a node's reply COB-ID. Never raises. (python-can delivers bytearrays.)"""
    if len(data) != FRAME_BYTES:
        return SdoMalformed(Cause.of("sdo_length", size=len(data), expected=FRAME_BYTES, data=hex_of(data)))
    command, index, sub = data[0], data[1] | data[2] << 8, data[3]
    size = _VALUE.get(command)
    if size is not None:
        return SdoValue(index, sub, int.from_bytes(data[4 : 4 + size], "little"), size)
    if command == _WRITTEN:
        return SdoWritten(index, sub)
    if command == _ABORT:
        return SdoAbort(index, sub, int.from_bytes(data[4:], "little"))
    return SdoMalformed(Cause.of("sdo_command", command=command, data=hex_of(data)))


#: The codes that CiA 301 knows (table 22).
ABORTS = frozenset({
    0x05030000, 0x05040000, 0x05040001, 0x05040002, 0x05040003, 0x05040004, 0x05040005, 0x06010000,
    0x06010001, 0x06010002, 0x06020000, 0x06040041, 0x06040042, 0x06040043, 0x06040047, 0x06060000,
    0x06070010, 0x06070012, 0x06070013, 0x06090011, 0x06090030, 0x06090031, 0x06090032, 0x06090036,
    0x060A0023, 0x08000000, 0x08000020, 0x08000021, 0x08000022, 0x08000023, 0x08000024,
})  # fmt: skip
