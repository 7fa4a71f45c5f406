"""The guardian: parent of the controller; it stops the chargers if the controller cannot.

Theory of operation. `orchestrator run` is this process; it starts the controller and then only waits. The controller
hands it a duplicate of every serial port and contactor line that it opens (SCM_RIGHTS), and sends a heartbeat once
*all* of its loops have made progress. No heartbeat for SILENCE_S, or the end of the connection, means that nothing
controls the chargers: the guardian kills what is left, stops the charger on every port it was ever given,
verifies the stops, and exits with an error, so that systemd restarts the service. A charger that runs again meanwhile
was not verified, and is stopped again. Contactors open after the first round of stops; `lastopen.py` explains why not
before. The guardian answers each heartbeat; a controller without answers knows that its guardian is gone, stops the
chargers, and ends.

Standard library and `protocol/standby.py` only: what is not imported cannot fail. Nothing here waits for anything but
the controller: not for systemd, not for a reader of the log, not for a slow driver.
"""

import contextlib
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Sequence
from functools import partial
from types import FrameType

from orchestrator.lastresort.bareport import drop_port
from orchestrator.lastresort.contactors import HANGS, Contactors, aside
from orchestrator.lastresort.lastopen import open_contactor
from orchestrator.lastresort.laststop import LastStop
from orchestrator.lastresort.notify import Systemd, say
from orchestrator.lastresort.terminal import has_terminal
from orchestrator.lastresort.unheld import report, stop_unheld, unheld_ports

#: Messages from the controller: one letter, then a name. PORT carries a port's descriptor, CONTACTOR that of a GPIO
#: line, or none if the controller has released the line.
BEAT, PORT, DROP, CONTACTOR, DONE = b"B", b"P", b"D", b"C", b"E"
#: The guardian's answer to each BEAT.
ALIVE = b"A"
#: Five missed heartbeats: the controller hangs (the goal: stop within 0.6 s).
SILENCE_S = 0.5
#: Waking this late means that the scheduler did not run us.
LATE_S = 0.1
#: Enough for the controller to import its libraries and read its files, even on a slow and busy machine.
STARTUP_S = 20.0
#: A controller that has verified its chargers closes everything and ends within this.
END_S = 10.0
#: How long to wait for the chargers' standby, and watch it. The restarted service continues from there.
VERIFY_S = 5.0
#: How long contactors get to open if there is no charger to stop.
OPEN_S = 0.5
#: A killed process is gone within this, if anything can end it.
KILLED_S = 1.0
#: How often to tell systemd that we are alive; the unit allows a multiple of it.
WATCHDOG_S = 0.5
#: Exit status if the guardian had to act.
ACTED = 70
MESSAGE = 4096
#: -P: a file in the working directory must not be imported in place of a library with the same name.
CONTROLLER = ("-P", "-m", "orchestrator.service.controller")

#: Requests to end: systemd or `kill`, Ctrl-C, a closed terminal (if there is one), Ctrl-\.
ENDS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
#: Ctrl-Z and the like would freeze guardian and controller together while the chargers run.
FREEZES = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)


class Guardian:
    """Watches one controller, already started, over `link` (SOCK_SEQPACKET); `station` is its file."""

    def __init__(self, child: int, link: socket.socket, station: str = "") -> None:
        self._child, self._link, self._station = os.pidfd_open(child), link, station
        self._ports: dict[str, int | None] = {}  # None: the controller has closed it for now
        self._contactors: dict[str, int] = {}
        self._opened = Contactors()
        self._done = self._ending = self._ready = self._told = False
        self._excused = False  # since the last heartbeat
        self._deadline_s = time.monotonic() + STARTUP_S
        self._systemd = Systemd()
        self._watchdog_s = 0.0  # when systemd was last told that we are alive

    def run(self) -> int:
        """Wait for the controller to end; returns its exit status, or ACTED if the guardian stopped the chargers."""
        for number in ENDS:
            # Respect `nohup`, but never inherit deafness to `kill` or systemd from whoever starts us.
            if number is signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._pass_on)
        if not has_terminal() and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            signal.signal(signal.SIGHUP, self._pass_on_reload)
        reason = self._watch()
        if self._done:
            return self._close()
        stopping = LastStop(watch_s=VERIFY_S)
        if self._ports:
            # Do not wait for a gap: the kernel sends what the dying controller wrote first. If that was half a frame,
            # or the controller was just writing, the second stop follows 20 ms later.
            self._signal(signal.SIGKILL)
            stopping.stop(self._ports)
        if self._station and not self._ready and not self._ending:  # it has failed before it had opened every port
            unheld = unheld_ports(self._station, self._ports)
            self._ports |= unheld
            stopping.stop(unheld)
        if not self._ports:
            return self._close()
        report(stopping.finish(VERIFY_S, on_stop=partial(self._stopping, reason), on_round=self._open))
        for name in self._contactors:
            say(f"guardian: contactor {name}: {self._opened.became.get(name, HANGS)}")
        self._status(KILLED_S)
        return ACTED

    def _close(self) -> int:
        self._open(OPEN_S)
        return self._status(END_S)

    def _pass_on(self, _number: int, _frame: FrameType | None) -> None:
        """Pass the request on: the controller shuts down in an orderly way, and gets the time for it."""
        self._ending = True
        self._systemd.tell("STOPPING=1")
        self._signal(signal.SIGTERM)

    def _pass_on_reload(self, _number: int, _frame: FrameType | None) -> None:
        """Pass on the request to reread policies; a controller that is just starting reads them anyway."""
        if self._ready:
            self._signal(signal.SIGHUP)

    def _signal(self, number: signal.Signals) -> None:
        signal.pidfd_send_signal(self._child, number)  # even if it is dead: it stays a zombie, since nobody reaps it

    def _watch(self) -> str:
        """Read the controller's messages until they end; returns the reason. A hung controller is killed."""
        poll = select.poll()
        poll.register(self._link, select.POLLIN)
        while True:
            left_s = max(0.0, self._deadline_s - time.monotonic())
            if poll.poll(left_s * 1000):  # polled even if time is up: messages that arrived meanwhile count
                if not self._message():
                    return ""
            elif self._overslept():
                self._deadline_s = time.monotonic() + SILENCE_S
            else:
                self._signal(signal.SIGKILL)
                return "the controller hangs"

    def _overslept(self) -> bool:
        """Whether the whole machine stood still, us included (suspended, say): excused once per heartbeat."""
        late, self._excused = not self._excused and time.monotonic() - self._deadline_s > LATE_S, True
        return late

    def _message(self) -> bool:
        """Process one message; False at the end of the connection."""
        try:
            data, descriptors, _, _ = socket.recv_fds(self._link, MESSAGE, 1)
        except ConnectionResetError:
            return True  # raised once if a controller died with our answers unread; its last messages follow
        except OSError:
            return False
        kind, name = data[:1], data[1:].decode(errors="surrogateescape")
        if kind == BEAT:
            self._beat()
        elif kind == PORT:
            self._hold(name, descriptors.pop() if descriptors else None)
        elif kind == DROP and not self._done:
            self._hold(name, None)
        elif kind == CONTACTOR:
            self._hold_contactor(name, descriptors.pop() if descriptors else None)
        elif kind == DONE:
            self._done, self._deadline_s = True, time.monotonic() + END_S
        for fd in descriptors:
            os.close(fd)
        return bool(data)

    def _beat(self) -> None:
        now_s = time.monotonic()
        self._deadline_s, self._excused = now_s + SILENCE_S, False
        with contextlib.suppress(OSError):
            self._link.send(ALIVE, socket.MSG_DONTWAIT)
        if not self._ready:
            self._ready = True
            self._systemd.tell("READY=1")
        if now_s - self._watchdog_s >= WATCHDOG_S:
            self._watchdog_s = now_s
            self._systemd.tell("WATCHDOG=1")

    def _hold(self, name: str, fd: int | None) -> None:
        """Keep this descriptor of the port, or none; the name is kept for the stop."""
        old = self._ports.get(name)
        self._ports[name] = fd
        if old is not None:
            aside(partial(drop_port, old))

    def _hold_contactor(self, name: str, fd: int | None) -> None:
        """Keep this descriptor of the line, or none if the line is free again."""
        old = self._contactors.pop(name, None)
        if old is not None:
            aside(partial(os.close, old))
        if fd is not None:
            self._contactors[name] = fd

    def _open(self, within_s: float = 0.0) -> None:
        """Open every contactor, independently: chargers that obey have stopped by now."""
        for name in self._contactors:
            self._opened.open(name, partial(open_contactor, self._contactors[name]))
        self._opened.wait(within_s)

    def _stopping(self, reason: str) -> None:
        """Called after each round of stops; after the first one, there is time to report."""
        self._systemd.tell("WATCHDOG=1")
        if not self._told:
            self._told = True
            reason = reason or f"the controller {self._fate()[1]}"
            say(f"guardian: {reason}: stopping the chargers on {len(self._ports)} ports")
            self._systemd.tell(f"STATUS={reason}; stopping the chargers")

    def _status(self, within_s: float) -> int:
        """The controller's exit status, ACTED if it has none; a controller that does not end is killed."""
        end = select.poll()
        end.register(self._child, select.POLLIN)
        if not end.poll(within_s * 1000):
            self._signal(signal.SIGKILL)
            end.poll(KILLED_S * 1000)
        return self._fate()[0]

    def _fate(self) -> tuple[int, str]:
        """The controller's exit status, also in words. A hung driver may keep it alive: do not wait for it."""
        end = os.waitid(os.P_PIDFD, self._child, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if end is None:
            return ACTED, "does not die"
        if end.si_code == os.CLD_EXITED:
            return end.si_status, f"has ended with status {end.si_status}"
        early = self._ending and not self._ports  # SIGTERM ended it before it could handle it
        return 0 if early else ACTED, f"was ended by {signal.Signals(end.si_status).name}"


def guard(arguments: Sequence[str], controller: Sequence[str] = CONTROLLER) -> int:
    """Start the controller (`arguments`: the station file) and watch over it; returns the exit status."""
    for number in FREEZES:
        signal.signal(number, signal.SIG_IGN)  # the controller inherits this
    # Ignored and blocked signals are inherited: we might miss the child's end, or a request for ours.
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.set_inheritable(True)
    command = [sys.executable, *controller, str(theirs.fileno()), *arguments]
    try:
        child = os.posix_spawn(sys.executable, command, os.environ)
    except OSError as error:
        stop_unheld(arguments[0], error, VERIFY_S)
        return ACTED
    theirs.close()
    return Guardian(child, ours, arguments[0]).run()
