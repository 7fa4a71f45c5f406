"""Reads a battery's serial number from CANopen's identity object, once each time its BMU is heard anew.

Not every BMU has the object, and the manual does not mention it. So it is read when nothing else is due, after the
values that a charge needs; a BMU that refuses, or does not answer such a request at all, is soon left alone.
"""

from math import inf

from orchestrator.devices.sdo_client import Key
from orchestrator.protocol.sdo import SdoAbort, SdoReply, SdoValue

#: CiA 301: identity object, serial number.
SERIAL: Key = (0x1018, 4)
#: It is read this long after the BMU was heard: by then it has reported everything else …
AFTER_S = 2.0
#: … and, while it is not answered or cannot be told yet, again after this, …
RETRY_S = 5.0
#: … so many times in all.
MOST_TRIES = 3
#: The class of the abort codes that say: there is no such object, or it cannot be read. Others may pass.
NO_SUCH_OBJECT = 0x06
#: No serial number: it was never set, or its memory was erased.
UNSET = (0, 0xFFFFFFFF)


class SerialNumber:
    """When to read it next. `due_s` is inf while there is nothing left to do."""

    __slots__ = ("_tries", "due_s")

    def __init__(self) -> None:
        self.due_s, self._tries = inf, 0

    def arrived(self, now_s: float) -> None:
        """The BMU answers again, or has booted: this may be another battery."""
        self.due_s, self._tries = now_s + AFTER_S, 0

    def given_up(self, now_s: float) -> bool:
        """Whether the last try was in vain; true once."""
        if now_s < self.due_s or self._tries < MOST_TRIES:
            return False
        self.due_s = inf
        return True

    def asked(self, now_s: float) -> None:
        """It is being read."""
        self._tries += 1
        self.due_s = now_s + RETRY_S

    def answered(self, reply: SdoReply) -> int | None:
        """The serial number; 0 if it has none, None if it may yet be told."""
        if isinstance(reply, SdoValue):
            self.due_s = inf
            return 0 if reply.value in UNSET else reply.value
        if isinstance(reply, SdoAbort) and reply.code >> 24 == NO_SUCH_OBJECT:
            self.due_s = inf
            return 0
        return None
