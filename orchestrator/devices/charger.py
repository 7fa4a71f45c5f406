"""One charger behind its serial port: polls it, sends it commands, and above all stops it.

Theory of operation. One thread owns the port. The control loop gives it a command and a grant; the thread repeats the
command until the control loop sees the read-back and gives another. `Schedule` decides whose turn it is, `Dialogue`
what counts as an answer, the interlock what may go out. A stop wakes the thread at once. Whatever breaks, the thread
survives: it reopens the port at once, then once a second, and begins with a stop on its own. If another program has
changed the port's settings, they are corrected before a stop needs them.
"""

from collections.abc import Callable
from contextlib import suppress
from threading import Event, Lock, Thread

from orchestrator.config.station import ChargerConfig, Limits
from orchestrator.devices.charger_line import ChargerLine
from orchestrator.devices.charger_view import ChargerView
from orchestrator.devices.dialogue import Dialogue
from orchestrator.devices.poll import poll
from orchestrator.devices.schedule import Schedule, Turn
from orchestrator.errors import LinkError
from orchestrator.interlock import Grant, permit
from orchestrator.model import STOP, Cause, ChargerLink, ChargerReading, Command, ControlMode, Sent
from orchestrator.protocol.charger import OPERATION_STOP_FRAME, STOP_FRAME, encode

#: Without a turn for this long the loop hangs: a write may take 0.2 s, a poll 0.12 s.
STALL_S = 0.5
#: A port is opened at most this often …
REOPEN_S = 1.0
#: … and a port that just failed after this pause: the guardian must let go of it first, while its charger is running.
LET_GO_S = 0.1
#: Longer than a complete stop takes: operation 0 follows one slot after rest 0.
CLOSE_S = 1.0
#: How often the line's settings and lock are checked, in addition to before each stop and after each miss.
LOOK_S = 1.0
#: If old input does not end after this many reads, somebody is sending without a pause.
MAX_STALE_READS = 16


class ChargerPort:
    """The thread of one serial port. All methods may be called from any thread.

    `open_line` opens the port (LinkError if it cannot); `clock` gives monotonic seconds; `on_change` is called, from
    the port's thread, after each reading and each change of the link, and must be quick.
    """

    def __init__(
        self,
        config: ChargerConfig,
        limits: Limits,
        *,
        open_line: Callable[[], ChargerLine],
        clock: Callable[[], float],
        on_change: Callable[[], None],
    ) -> None:
        self._config = config
        self._limits = limits
        self._open_line = open_line
        self._clock = clock
        self._line: ChargerLine | None = None
        self._dialogue = Dialogue()
        self._open_at_s = 0.0
        self._turn_s = 0.0
        self._look_s = 0.0
        self._view = ChargerView(config.port, on_change)
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
        """The newest reading and the state of the link: one consistent pair."""
        return self._view.current

    def command(self, command: Command | None, grant: Grant | None = None) -> None:
        """Give the command to repeat (None: only poll) and the grant for it. A stop goes out at once.

        Call this with every decision, changed or not: a reopened port has forgotten the last command and stops.
        """
        with self._lock:
            self._grant = grant
            new_stop = self._schedule.give(command)
        if new_stop:
            self._wake.set()

    def stalled(self, now_s: float) -> bool:
        """True if the loop hangs with an open port, or has ended without being told to."""
        if self._close_by_s is not None:
            return False
        return not self._thread.is_alive() or (self._line is not None and now_s - self._turn_s > STALL_S)

    def close(self) -> None:
        """End the thread and release the port. A commanded stop is written completely first."""
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
            except Exception as error:  # noqa: BLE001 - if this thread died, nobody would stop the charger
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
            due, command, grant = self._schedule.next(), self._schedule.command, self._grant
        if due.at_s > now_s:
            self._wake.wait(due.at_s - now_s)
        elif due.turn is Turn.STOP:
            self._write(line, STOP_FRAME, STOP, due.turn, whole_stop=self._config.control is ControlMode.AUTOMATIC)
        elif due.turn is Turn.OPERATION_STOP:
            self._write(line, OPERATION_STOP_FRAME, STOP, due.turn, whole_stop=True)
        elif due.turn is Turn.ORDER and command is not None:
            self._obey(line, command, grant)
        else:
            self._poll(line)

    def _obey(self, line: ChargerLine, command: Command, grant: Grant | None) -> None:
        refused = permit(command, grant, self._clock(), self._config, self._limits)
        if refused is not None:
            self._poll(line, refused)
        else:
            self._write(line, encode(command), command, Turn.ORDER)

    def _write(
        self, line: ChargerLine, frame: bytes, command: Command, turn: Turn, *, whole_stop: bool = False
    ) -> None:
        start_s = self._clock()
        found = self._restored(line) if command == STOP else None
        line.write(frame)
        end_s = self._clock()
        self._took(turn, start_s, end_s)
        self._found(found)
        stop_sent_s = end_s if whole_stop else self._view.link.stop_sent_s
        self._view.publish(sent=Sent(command, end_s), stop_sent_s=stop_sent_s, refused=None)

    def _restored(self, line: ChargerLine) -> Cause | None:
        """The settings that had to be corrected. A failure here must not prevent a stop."""
        with suppress(LinkError):
            return line.restore()
        return None

    def _found(self, taken_over: Cause | None) -> None:
        if taken_over is not None:
            self._view.publish(taken_over=taken_over, taken_over_t_s=self._clock())

    def _look(self, line: ChargerLine) -> None:
        """Check once a second what others do to the port."""
        self._look_s = self._clock() + LOOK_S
        self._found(self._restored(line))
        self._view.publish(locked_by=line.locked_by())

    def _poll(self, line: ChargerLine, refused: Cause | None = None) -> None:
        if self._clock() >= self._look_s:
            self._look(line)
        dialogue = self._dialogue
        for _ in range(MAX_STALE_READS):
            stale = line.read(0.0)
            if not stale:
                break
            dialogue.hear(stale, self._clock())
        asked_s = self._clock()
        reading, _ = poll(line, dialogue, self._clock)
        end_s = self._clock()
        if reading is None:
            self._found(self._restored(line))
        self._took(Turn.POLL, asked_s, end_s)
        self._view.polled(reading, dialogue, self._clock(), refused)

    def _took(self, turn: Turn, start_s: float, end_s: float) -> None:
        with self._lock:
            self._schedule.took(turn, start_s, end_s)

    def _open(self, now_s: float) -> None:
        self._open_at_s = now_s + REOPEN_S
        self._line = self._open_line()
        self._dialogue, self._look_s = Dialogue(), now_s
        self._restart()
        self._view.publish(misses=0, problem=Cause.of("port_opened", port=self._config.port), bad_frames=0)

    def _restart(self) -> None:
        with self._lock:
            self._schedule.restart(self._clock())

    def _broken(self, error: Exception) -> None:
        """Close and reopen a port that failed. After any other error, stop the charger and keep polling."""
        line, locked_by = None, self._view.link.locked_by
        if isinstance(error, LinkError):
            problem, locked_by = error.cause, None
            line, self._line = self._line, None
        else:
            said = f"{type(error).__name__}: {error}"
            problem = Cause.of("charger_internal", port=self._config.port, error=said)
            self._restart()
        with suppress(Exception):  # `on_change` itself may be what fails
            self._view.publish(online=False, problem=problem, locked_by=locked_by)
        self._let_go(line)  # last: a driver may be slow, and the port must not look healthy meanwhile

    def _let_go(self, line: ChargerLine | None) -> None:
        if line is not None:
            self._open_at_s = max(self._open_at_s, self._clock() + LET_GO_S)
            with suppress(Exception):  # the line is not used any more, even if closing it fails
                line.close()
