"""One charger's line in a last-resort process: stopped, queried and watched by its own thread.

Theory of operation. In rounds of half a second the charger is sent the stop twice, then operation 0, then a question.
Twice, because a controller that died in mid-frame may have left half a frame in the charger's decoder, which then
swallows the first stop. The first byte goes out before the port is queried in any way; if its settings are wrong, they
are corrected and the stop is written again. Two consecutive answers that show standby are the proof; from then on the
charger is only queried, and stopped again if it runs again. A port that fails is closed and reopened by name.

Any call to the port's driver may block for ever. Then only this thread hangs, and nobody waits for it. Standard library
only, few imports.
"""

import threading
import time
from collections.abc import Callable

from orchestrator.lastresort.bareport import HELD
from orchestrator.lastresort.descriptors import Turns
from orchestrator.lastresort.lastport import GATHER_S, LastPort
from orchestrator.protocol.standby import OPERATION_STOP_FRAME, STOP_FRAME

#: The frames of a round, by seconds from its beginning; each frame is off the wire before the next one.
STOPS: tuple[tuple[float, bytes], ...] = ((0.0, STOP_FRAME), (0.02, STOP_FRAME), (0.04, OPERATION_STOP_FRAME))
#: By then the charger has had time to obey, and is queried.
ASK_S = 0.25
ROUND_S = 0.5
#: How often a charger in standby is queried again: "200 ms or more is recommended" (protocol 2/2, §2.2.2).
AGAIN_S = 0.21
#: This many consecutive answers that show standby are a proof: a single one may be wrong.
PROOFS = 2
#: If ports take turns, a port that has had one waits this long before it asks for another.
LET_IN_S = 0.02
#: (name of a port, since when) → (which sample, "" if it shows standby, else why not) from another process in charge of
#: the port; None: there is none, and the charger must be queried. Answers at once.
Witness = Callable[[str, float], tuple[float, str] | None]

SILENT = "no proof of standby: the charger does not answer"
ONCE = "no proof of standby: the charger has shown it only once"
RUNS = "NOT stopped: the charger says that it goes on"
HANGS = "the port's driver hangs"


class LastLine:
    """One charger's line and its state; `why` is "" once standby is verified."""

    def __init__(
        self, name: str, fd: int | None, witness: Witness, *, leave_held: bool, turns: Turns | None = None
    ) -> None:
        self.name, self.why = name, SILENT
        self.tried = threading.Event()  #: the first stop is out, or could not be written
        self.shown_s: float | None = None  #: the time since which every answer has shown standby
        self._port, self._witness, self._turns = LastPort(name, fd, leave_held=leave_held), witness, turns
        self._stopped_s = 0.0  # when the first stop was written
        self._begun = False  # the thread has had its first round
        self._proofs, self._sample = 0, 0.0
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> bool:
        """Start the thread; False if that is impossible."""
        thread = threading.Thread(target=self._run, name=f"stop {self.name}", daemon=True)
        try:
            thread.start()
        except RuntimeError:
            return False
        self._thread = thread
        return True

    def first(self) -> None:
        """Write the first stop, before any other use of the port."""
        self._port.never_wait()
        self.write(STOP_FRAME)
        self._stopped_s = time.monotonic()
        self.tried.set()

    def end(self) -> None:
        """Tell the thread to close the port and end."""
        self._over.set()

    def join(self, within_s: float) -> None:
        """Wait for the thread; if it does not end, report that the port's driver hangs."""
        if self._thread is not None:
            self._thread.join(within_s)
            if self._thread.is_alive() and self.why:
                self.why = HANGS

    def _run(self) -> None:
        turns = self._turns
        if turns is None:
            self._watch()
            self._port.close()
            return
        while not self._finished:
            turns.take()
            try:
                self._take_turn() if self._crowded else self._watch()
            finally:
                self._port.close()
                turns.give()
            self._over.wait(LET_IN_S)

    @property
    def _crowded(self) -> bool:
        return self._turns is not None and self._turns.crowded

    @property
    def _finished(self) -> bool:
        """Whether to end: if ports take turns, a port whose charger is in standby makes room for others."""
        return self._over.is_set() or self.why == HELD or (self._crowded and not self.why)

    def _take_turn(self) -> None:
        """Keep the port open as briefly as possible: the first turn only stops, so that all chargers stop soon."""
        try:
            first = not self.tried.is_set()
            self._stop()
            for at_s, frame in STOPS[1:] if first else ():
                self._pause_until(self._stopped_s + at_s)
                self.write(frame)
            if first:
                self._pause_until(self._stopped_s + STOPS[-1][0] + GATHER_S)  # closing the port drops unsent bytes
                return
            self._pause_until(time.monotonic() + GATHER_S)
            while not self._finished:
                self._look()
                if not self._proofs:
                    return
                self._pause_until(time.monotonic() + (AGAIN_S if self.why else 0.0))
        except Exception as error:  # noqa: BLE001 - as in `_watch`
            self._fail(f"internal: {error!r}")

    def _watch(self) -> None:
        """Stop it, query it, and stop it again if it runs again, until told to end, or others need the descriptor."""
        while not self._finished and not self._crowded:
            began_s, stood_by = time.monotonic(), bool(self._proofs)
            try:
                self._round(began_s)
            except Exception as error:  # noqa: BLE001 - if this thread died, nobody would stop the charger
                self._fail(f"internal: {error!r}")
            if self._proofs or not stood_by:  # a charger that runs again is stopped at once
                self._pause_until(began_s + (AGAIN_S if self._proofs else ROUND_S))

    def _round(self, began_s: float) -> None:
        if not self._proofs:
            self._stop()
            for at_s, frame in STOPS[1:]:
                self._pause_until(began_s + at_s)
                self.write(frame)
            self._pause_until(began_s + ASK_S)
        self._look()

    def _stop(self) -> None:
        if not self.tried.is_set():
            self.first()
        elif self._begun:
            self.write(STOP_FRAME)
        self._begun = True
        if self._port.restored():
            self.write(STOP_FRAME)

    def _pause_until(self, at_s: float) -> None:
        left_s = at_s - time.monotonic()
        if left_s > 0:
            self._over.wait(left_s)

    def _look(self) -> None:
        """Take another sample of the charger's state."""
        seen = self._witness(self.name, self._stopped_s)
        if seen is None:
            standby = self._port.ask()
            if self._port.trouble:
                self._fail(self._port.trouble)
            self._judge(None if standby is None else "" if standby else RUNS)
        elif seen[1]:
            self._judge(seen[1])
        elif seen[0] != self._sample:
            self._sample = seen[0]
            self._judge("")

    def _judge(self, why: str | None) -> None:
        """Count a sample: "" shows standby, None is silence, which does not invalidate a proof."""
        if why == "":
            self._proofs += 1
            self.shown_s = self.shown_s or time.monotonic()
            self.why = "" if self._proofs >= PROOFS else ONCE
        elif why is not None or self._proofs < PROOFS:
            self._proofs, self.shown_s = 0, None
            self.why = why or self.why

    def write(self, frame: bytes) -> None:
        """Write without blocking, opening the port first if necessary."""
        if not self._port.is_open and self._port.open():
            self.why = SILENT
        if not self._port.write(frame):
            self._fail(self._port.trouble)

    def _fail(self, why: str) -> None:
        if self._proofs < PROOFS:
            self.why, self._proofs, self.shown_s = why, 0, None
