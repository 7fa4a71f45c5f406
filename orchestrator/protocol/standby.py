"""The stop, and the proof that it was obeyed, as bytes: all that a last-resort process needs, and quick to import."""

#: 0x10 rest 0: to standby from any activity, in manual and in automatic mode (§3.3.4, §1.3.1).
STOP_FRAME = bytes.fromhex("AF FA 90 04 10 90 00 34 AF A0")
#: 0x02 push 0x01 value 0: keeps a later resume from running the charger; acted on in manual mode only (§3.3.2).
OPERATION_STOP_FRAME = bytes.fromhex("AF FA 90 05 02 90 01 00 28 AF A0")
#: Kinds 0x12 and 0x01: current, control mode, operation (§3.3.1). The service requests eight values or more, so a reply
#: to the service's own request, perhaps from before the stop, cannot be mistaken for a reply to this one. The control
#: mode is there only to change the checksum: without it, the frame would have the checksum of `run`.
QUESTION = bytes.fromhex("AF FA 90 05 01 90 12 01 39 AF A0")

#: The beginning of its answer: address, length (6 bytes of data + 3), command 0x03, order (§3.3.3).
_ANSWER_HEAD = bytes.fromhex("AF FA 90 09 03 90")
_ANSWER_END = bytes.fromhex("AF A0")
_DATA_BYTES = 6
ANSWER_BYTES = len(_ANSWER_HEAD) + _DATA_BYTES + 1 + len(_ANSWER_END)
_CURRENT, _OPERATION = slice(0, 2), slice(4, 6)
#: In 0.01 A: the most that standby may show, as everywhere else.
_STANDBY_CENTIAMPS = 50


def stands_by(data: bytes) -> bool | None:
    """The newest good answer to QUESTION in `data`: True for standby, False for running, None if there is none.

    Standby is operation 0 and at most 0.5 A.
    """
    said = None
    at = data.find(_ANSWER_HEAD)
    while at >= 0:
        answer = data[at : at + ANSWER_BYTES]
        values = answer[len(_ANSWER_HEAD) : len(_ANSWER_HEAD) + _DATA_BYTES]
        checksum, end = answer[-3:-2], answer[-2:]
        if len(answer) == ANSWER_BYTES and end == _ANSWER_END and checksum[0] == sum(answer[2:-3]) & 0xFF:
            amps = int.from_bytes(values[_CURRENT], "big")
            said = int.from_bytes(values[_OPERATION], "big") == 0 and amps <= _STANDBY_CENTIAMPS
        at = data.find(_ANSWER_HEAD, at + 1)
    return said
