"""One charger behind its serial port: polls it, hands it the standing order, and above all stops it.

Theory of operation. One thread owns the port. The control loop leaves it a standing order and the evidence for it (a
grant); the thread repeats the order until the control loop, seeing the read-back, leaves another. `Schedule` says whose
turn it is, `Dialogue` what an answer is, the interlock what may go out. A stop wakes the thread at once. Whatever
breaks, the thread lives on: it reopens the port, then once a second, and begins with a stop, without being told.
What another program has set the port to is set right before a stop needs it.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from threading import Event, Lock, Thread
from typing import Protocol

from orchestrator.config.station import ChargerConfig, Limits
from orchestrator.devices.dialogue import SILENCE, Dialogue, Heard
from orchestrator.devices.line_quality import LineQuality
from orchestrator.devices.schedule import Schedule, Turn
from orchestrator.errors import LinkError
from orchestrator.interlock import Grant, permit
from orchestrator.model import STOP, ChargerLink, ChargerReading, Command, ControlMode, Sent
from orchestrator.protocol.charger import OPERATION_STOP_FRAME, STOP_FRAME, encode

#: The wire takes 20 ms, an FTDI adapter holds the last bytes back for 16 ms; the rest is the charger's.
REPLY_DEADLINE_S = 0.12
#: So many polls in a row without an answer are silence: with one frame in a hundred lost, three come every seven hours,
#: five once in two years. Five take 1.12 s of the 2.0 s that a silent device may go on for (DESIGN §6).
MISSES_UNTIL_SILENT = 5
#: Answers that come late are no accident: what is asked for repeats after three, and a late one would pass for fresh.
LATE_UNTIL_SILENT = 3
#: Without a turn for so long the loop hangs: a write may take 0.2 s, a poll 0.12 s.
STALL_S = 0.5
#: A port is opened at most this often …
REOPEN_S = 1.0
#: … and one that just failed after this pause: the guardian must let go of it first, and its charger is running.
LET_GO_S = 0.1
#: Longer than a whole stop takes: operation 0 follows one slot behind rest 0.
CLOSE_S = 1.0
#: The line's settings and its lock are looked at this often, and besides before each stop and after each miss.
LOOK_S = 1.0
#: More reads than this find no end of old input: then somebody is sending without a pause.
MAX_STALE_READS = 16


class Line(Protocol):
    """The open port, as `link.serial.SerialLine` is. Every method but `close` may raise LinkError."""

    def write(self, data: bytes) -> None:
        """Hand over a frame."""

    def read(self, timeout_s: float, expected: int = 0) -> bytes:
        """What came in, as soon as `expected` bytes had their time on the wire; b"" after the time-out."""

    def restore(self) -> str:
        """Set the port up again if another program has changed it; what was found, "" where all was well."""

    def locked_by(self) -> str:
        """Which program holds the port's lock instead of us, "" where it is ours."""

    def close(self) -> None:
        """Give the port back."""


class ChargerPort:
    """The thread of one serial port. All methods may be called from any thread.

    `open_line` opens the port (LinkError if it cannot); `clock` gives monotonic seconds; `on_change` is called, from
    the port's thread, after each reading and each change of the link, and has to be quick.
    """

    def __init__(
        self,
        config: ChargerConfig,
        limits: Limits,
        *,
        open_line: Callable[[], Line],
        clock: Callable[[], float],
        on_change: Callable[[], None],
    ) -> None:
        self._config = config
        self._limits = limits
        self._open_line = open_line
        self._clock = clock
        self._on_change = on_change
        self._line: Line | None = None
        self._dialogue = Dialogue()
        self._quality = LineQuality()
        self._open_at_s = 0.0
        self._turn_s = 0.0
        self._look_s = 0.0
        self._view: tuple[ChargerReading | None, ChargerLink] = (
            None,
            ChargerLink(problem=f"{config.port}: not opened yet"),
        )
        self._lock = Lock()  # guards the schedule and the grant
        self._schedule = Schedule(config.control)
        self._grant: Grant | None = None
        self._wake = Event()
        self._close_by_s: float | None = None
        self._thread = Thread(target=self._run, name=f"charger {config.port}", daemon=True)

    def start(self) -> None:
        """Open the port, stop the charger and poll it from now on."""
        self._thread.start()

    @property
    def view(self) -> tuple[ChargerReading | None, ChargerLink]:
        """The newest reading and how the line is doing: one consistent pair."""
        return self._view

    def order(self, command: Command | None, grant: Grant | None = None) -> None:
        """Leave a standing order (None: only poll) and the evidence for it. A stop goes out at once.

        To be called with every decision, changed or not: an opened port has forgotten the last order and stops.
        """
        with self._lock:
            self._grant = grant
            new_stop = self._schedule.give(command)
        if new_stop:
            self._wake.set()

    def stalled(self, now_s: float) -> bool:
        """True when the loop hangs with an open port, or has ended without being told to."""
        if self._close_by_s is not None:
            return False
        return not self._thread.is_alive() or (self._line is not None and now_s - self._turn_s > STALL_S)

    def close(self) -> None:
        """End the thread and give the port back. A stop that is ordered is written whole first."""
        if self._close_by_s is None:
            self._close_by_s = self._clock() + CLOSE_S
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(2 * CLOSE_S)

    # --- the thread ------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._finished():
            try:
                self._once()
            except Exception as error:  # noqa: BLE001 - a thread that dies here is a charger that nobody stops
                self._broken(error)
        line, self._line = self._line, None
        self._let_go(line)

    def _finished(self) -> bool:
        if self._close_by_s is None:
            return False
        return self._line is None or not self._schedule.stop_unfinished or self._clock() > self._close_by_s

    def _once(self) -> None:
        """Wait for the next turn, or take it."""
        self._wake.clear()
        now_s = self._turn_s = self._clock()
        line = self._line
        if line is None:
            if now_s >= self._open_at_s:
                self._open(now_s)
            else:
                self._wake.wait(self._open_at_s - now_s)
            return
        with self._lock:
            due, order, grant = self._schedule.next(), self._schedule.order, self._grant
        if due.at_s > now_s:
            self._wake.wait(due.at_s - now_s)
        elif due.turn is Turn.STOP:
            self._write(line, STOP_FRAME, STOP, due.turn, whole_stop=self._config.control is ControlMode.AUTOMATIC)
        elif due.turn is Turn.OPERATION_STOP:
            self._write(line, OPERATION_STOP_FRAME, STOP, due.turn, whole_stop=True)
        elif due.turn is Turn.ORDER and order is not None:
            self._obey(line, order, grant)
        else:
            self._poll(line)

    def _obey(self, line: Line, order: Command, grant: Grant | None) -> None:
        refused = permit(order, grant, self._clock(), self._config, self._limits)
        if refused:
            self._poll(line, refused)
        else:
            self._write(line, encode(order), order, Turn.ORDER)

    def _write(self, line: Line, frame: bytes, order: Command, turn: Turn, *, whole_stop: bool = False) -> None:
        start_s = self._clock()
        found = self._restored(line) if order == STOP else ""
        line.write(frame)
        end_s = self._clock()
        self._took(turn, start_s, end_s)
        self._found(found)
        stop_sent_s = end_s if whole_stop else self._view[1].stop_sent_s
        self._publish(sent=Sent(order, end_s), stop_sent_s=stop_sent_s, refused="")

    def _restored(self, line: Line) -> str:
        """What had to be set right. That this fails must not keep a stop from the line."""
        with suppress(LinkError):
            return line.restore()
        return ""

    def _found(self, taken_over: str) -> None:
        if taken_over:
            self._publish(taken_over=taken_over, taken_over_t_s=self._clock())

    def _look(self, line: Line) -> None:
        """What others do to the port shows here, once a second."""
        self._look_s = self._clock() + LOOK_S
        self._found(self._restored(line))
        self._publish(locked_by=line.locked_by())

    def _poll(self, line: Line, refused: str = "") -> None:
        if self._clock() >= self._look_s:
            self._look(line)
        dialogue = self._dialogue
        for _ in range(MAX_STALE_READS):
            stale = line.read(0.0)
            if not stale:
                break
            dialogue.hear(stale, self._clock())
        asked_s = now_s = self._clock()
        request = dialogue.ask(asked_s)
        line.write(request)
        sending, reading = len(request), None
        while reading is None and (left_s := asked_s + REPLY_DEADLINE_S - now_s) > 0:
            data = line.read(left_s, sending + dialogue.missing)
            sending, now_s = 0, self._clock()
            reading = dialogue.hear(data, now_s)
        if reading is None:
            reading = dialogue.give_up(now_s)
        if reading is None:
            self._found(self._restored(line))
        self._took(Turn.POLL, asked_s, now_s)
        self._polled(reading, refused)

    def _took(self, turn: Turn, start_s: float, end_s: float) -> None:
        with self._lock:
            self._schedule.took(turn, start_s, end_s)

    # --- what is known of it ---------------------------------------------------------------------------------------

    def _polled(self, reading: ChargerReading | None, refused: str) -> None:
        dialogue, link = self._dialogue, self._view[1]
        misses = 0 if reading else link.misses + 1
        problem = "" if reading else link.problem
        silent = misses >= (LATE_UNTIL_SILENT if dialogue.heard is Heard.LATE_REPLY else MISSES_UNTIL_SILENT)
        complained = dialogue.error_t_s != link.error_t_s
        self._quality.count(self._clock(), bad=reading is None or complained)
        if silent:
            problem = f"{self._config.port}: {SILENCE[dialogue.heard]}"
        self._publish(
            reading,
            online=reading is not None or (link.online and not silent),
            misses=misses,
            problem=problem,
            refused=refused,
            error_bits=dialogue.error_bits,
            error_t_s=dialogue.error_t_s,
            bad_frames=dialogue.bad_frames,
            bad_pct=self._quality.bad_pct,
        )

    def _publish(self, reading: ChargerReading | None = None, **changes: object) -> None:
        last_reading, last_link = self._view
        link = replace(last_link, **changes)  # type: ignore[arg-type]  # the callers name the fields of ChargerLink
        if reading is None and link == last_link:
            return
        self._view = (reading or last_reading, link)
        self._on_change()

    def _open(self, now_s: float) -> None:
        self._open_at_s = now_s + REOPEN_S
        self._line = self._open_line()
        self._dialogue, self._look_s = Dialogue(), now_s
        self._restart()
        self._publish(misses=0, problem=f"{self._config.port}: open, no answer yet", bad_frames=0)

    def _restart(self) -> None:
        with self._lock:
            self._schedule.restart(self._clock())

    def _broken(self, error: Exception) -> None:
        """A port that failed is closed and opened again. After anything else the charger is stopped and polled on."""
        line, locked_by = None, self._view[1].locked_by
        if isinstance(error, LinkError):
            problem, locked_by = str(error), ""
            line, self._line = self._line, None
        else:
            problem = f"internal: {type(error).__name__}: {error}"
            self._restart()
        with suppress(Exception):  # it may be `on_change` itself that fails
            self._publish(online=False, problem=problem, locked_by=locked_by)
        self._let_go(line)  # last: a driver may take its time, and nobody must take the port for well meanwhile

    def _let_go(self, line: Line | None) -> None:
        if line is not None:
            self._open_at_s = max(self._open_at_s, self._clock() + LET_GO_S)
            with suppress(Exception):  # whatever its close has to say, the line is not used any more
                line.close()
