"""One bay's contactor in the running service: carries out the core's decision, and reports to the next one.

Its line is taken when the first decision is carried out, so after the port's first stop. A line that fails is released
and taken again every second; it is then open, and stays open until a decision closes it.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from orchestrator.errors import LinkError
from orchestrator.model import Cause, ChargerReading

REOPEN_S = 1.0
#: Within this a contactor has closed and the charger's measurement has followed. An earlier reading proves nothing.
CLOSING_S = 0.3


class Output(Protocol):
    """The GPIO line, as in `link.gpio.OutputLine`. When taken, it holds the contactor open."""

    def drive(self, *, closed: bool) -> None:
        """Close the contactor, or open it. May raise LinkError."""

    def close(self) -> None:
        """Release the line."""


class Contactor:
    """Used by the control loop's thread only; `open_output` takes the line (LinkError if it cannot)."""

    def __init__(self, open_output: Callable[[], Output]) -> None:
        self.problem: Cause | None = None  #: why it cannot be driven
        self.closed_s: float | None = None  #: since when it has been closed; None: it is open
        self._open_output = open_output
        self._output: Output | None = None
        self._retry_s = 0.0

    def connects(self, reading: ChargerReading | None) -> bool:
        """Whether it was closed at the time of this reading."""
        return self.closed_s is not None and reading is not None and reading.t_s >= self.closed_s + CLOSING_S

    def drive(self, now_s: float, *, closed: bool) -> None:
        """Drive it as the newest decision says. Written each time, to restore anything that the driver has lost."""
        if self._output is None and now_s < self._retry_s:
            return
        try:
            if self._output is None:
                self._output = self._open_output()
            self._output.drive(closed=closed)
        except LinkError as error:
            self.give_back()
            self.problem, self._retry_s = error.cause, now_s + REOPEN_S
            return
        self.problem = None
        self.closed_s = (self.closed_s or now_s) if closed else None

    def give_back(self) -> None:
        """Open it and release the line."""
        output, self._output, self.closed_s = self._output, None, None
        if output is not None:
            with suppress(LinkError):
                output.drive(closed=False)
            output.close()
