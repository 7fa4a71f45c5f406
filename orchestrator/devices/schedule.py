"""Schedules the use of a charger's port. Pure: time is an argument, so that tests can jump.

The line is used in slots of 200 ms. Without a command every slot is a poll; with one, commands and polls alternate. A
stop waits for no slot: it goes out as soon as the line is free, and again every 500 ms while it is the command. In
manual mode its second half (operation 0) always takes the next slot, whatever has been commanded meanwhile: a stop once
begun is completed, so that no resume can find the charger still set to run.
"""

from dataclasses import dataclass
from enum import Enum, auto
from math import inf

from orchestrator.model import STOP, Action, Command, ControlMode

SLOT_S = 0.2  #: "200 ms or more is recommended" (protocol 2/2, §2.2.2)
STOP_REPEAT_S = 0.5  #: the most that a lost stop costs
#: How long a command occupies the line: 11 bytes at 19200 baud take 5.7 ms; then a gap of 4 bytes, so that the charger
#: can separate the next frame from this one.
ORDER_S = 0.008


class Turn(Enum):
    """The purpose of a turn on the line."""

    POLL = auto()
    ORDER = auto()  #: the command, unless it is stop
    STOP = auto()  #: rest 0
    OPERATION_STOP = auto()  #: operation 0, the second half of a stop in manual mode


@dataclass(frozen=True, slots=True)
class Due:
    """The next turn and its time; a time in the past means now."""

    turn: Turn
    at_s: float


class Schedule:
    """The turns of one port. Not thread-safe: the port locks it."""

    __slots__ = ("_after_poll", "_free_s", "_half_stopped", "_manual", "_slot_s", "_stop_s", "_urgent", "command")

    def __init__(self, control: ControlMode) -> None:
        self._manual = control is ControlMode.MANUAL
        self._half_stopped = False  # operation 0 is still to follow
        self._after_poll = True  # the last slot was a poll
        self._stop_s = -inf  # when the last stop began
        self.restart(-inf)

    def restart(self, now_s: float) -> None:
        """The port was opened, or something unforeseen happened: stop first, whatever was commanded before.

        At most once per slot, so that a recurring error does not flood the line.
        """
        self.command: Command | None = STOP  #: the command to repeat
        self._urgent = True
        self._free_s = self._slot_s = self._stop_s = max(now_s, self._stop_s + SLOT_S)

    def give(self, command: Command | None) -> bool:
        """Replace the command. True if that is a new stop, which must wake the thread."""
        stop = command is not None and command.action is Action.STOP
        new_stop = stop and not self.stopping
        self.command = command
        self._urgent = self._urgent or new_stop
        return new_stop

    @property
    def stopping(self) -> bool:
        """Whether the command is stop."""
        return self.command is not None and self.command.action is Action.STOP

    @property
    def stop_unfinished(self) -> bool:
        """Whether a frame of a stop is still to be written."""
        return self._urgent or self._half_stopped

    def next(self) -> Due:
        """The next turn, unless a new command comes first."""
        if self._urgent:
            return Due(Turn.STOP, self._free_s)
        if self._half_stopped:
            return Due(Turn.OPERATION_STOP, self._slot_s)
        if self.stopping and self._stop_s + STOP_REPEAT_S <= self._slot_s:
            return Due(Turn.STOP, self._stop_s + STOP_REPEAT_S)
        if self.command is None or self.stopping or not self._after_poll:
            return Due(Turn.POLL, self._slot_s)
        return Due(Turn.ORDER, self._slot_s)

    def took(self, turn: Turn, start_s: float, end_s: float) -> None:
        """A turn was taken, from `start_s` to `end_s`."""
        self._slot_s = start_s + SLOT_S
        self._free_s = end_s if turn is Turn.POLL else end_s + ORDER_S
        self._after_poll = turn is Turn.POLL
        if turn is Turn.STOP:
            self._stop_s, self._urgent, self._half_stopped = start_s, False, self._manual
        elif turn is Turn.OPERATION_STOP:
            self._half_stopped = False
