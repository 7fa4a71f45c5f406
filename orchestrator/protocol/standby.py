"""The stop, and the proof that it was obeyed, as bytes: all that a process of last resort needs, quick to import."""

#: 0x10 rest 0: to standby, whatever the charger is doing, in manual and in automatic mode (§3.3.4, §1.3.1).
STOP_FRAME = bytes.fromhex("AF FA 90 04 10 90 00 34 AF A0")
#: 0x02 push 0x01 value 0: so that a later resume does not run on; acted on in manual mode only (§3.3.2).
OPERATION_STOP_FRAME = bytes.fromhex("AF FA 90 05 02 90 01 00 28 AF A0")
#: Kinds 0x13 and 0x1F: volts, amps, control mode, operation, limit, mode, precharge, connection (§3.3.1).
STATUS_REQUEST = bytes.fromhex("AF FA 90 05 01 90 13 1F 58 AF A0")

#: How its answer begins: address, length (16 bytes of data + 3), command 0x03, order (§3.3.3).
_REPLY_HEAD = bytes.fromhex("AF FA 90 13 03 90")
_REPLY_END = bytes.fromhex("AF A0")
_DATA_BYTES = 16
_CURRENT, _OPERATION = slice(2, 4), slice(6, 8)
#: In 0.01 A: standby may show so much, as everywhere else.
_STANDBY_CENTIAMPS = 50


def stands_by(data: bytes) -> bool | None:
    """What the newest good status reply in `data` says: True for standby, False for running, None where there is none.

    Standby is operation 0 and at most 0.5 A.
    """
    said = None
    at = data.find(_REPLY_HEAD)
    while at >= 0:
        values = data[at + len(_REPLY_HEAD) : at + len(_REPLY_HEAD) + _DATA_BYTES]
        tail = data[at + len(_REPLY_HEAD) + _DATA_BYTES :]
        if len(tail) >= 3 and tail[0] == sum(data[at + 2 : at + 6] + values) & 0xFF and tail[1:3] == _REPLY_END:
            amps = int.from_bytes(values[_CURRENT], "big")
            said = int.from_bytes(values[_OPERATION], "big") == 0 and amps <= _STANDBY_CENTIAMPS
        at = data.find(_REPLY_HEAD, at + 1)
    return said
