"""The guardian: parent of the controller, and the one who stops the chargers when the controller cannot.

Theory of operation. `orchestrator run` is this process; it starts the controller and then only waits. The controller
hands it a duplicate of every serial port and contactor line it opens (SCM_RIGHTS) and sends a heartbeat when *all* its
loops have turned. No heartbeat for SILENCE_S, or the end of the connection, means that nobody is at the wheel: the
guardian kills what is left, stops the charger on every port that it was ever told of, verifies it, and ends with an
error, so that systemd starts anew. A charger that runs again meanwhile was not verified, and is stopped again.
Contactors open after the first round of stops; `lastopen.py` says why not before.
It answers each heartbeat; a controller without answers knows that its guardian is gone, stops, and ends.

Standard library and `protocol/standby.py` only: what is not imported cannot fail. Nothing here ever waits for anybody
but the controller: not for systemd, not for who reads the log, not for a driver that takes its time over a port.
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

from orchestrator.lastresort.bareport import HELD, drop_port
from orchestrator.lastresort.contactors import HANGS, Contactors, aside
from orchestrator.lastresort.lastopen import open_contactor
from orchestrator.lastresort.laststop import stop_all
from orchestrator.lastresort.notify import Systemd, say

#: Messages from the controller: one letter, then a name. PORT carries a port's descriptor, CONTACTOR that of a GPIO
#: line, or none when the controller has given the line back.
BEAT, PORT, DROP, CONTACTOR, DONE = b"B", b"P", b"D", b"C", b"E"
#: The guardian's answer to each BEAT.
ALIVE = b"A"
#: Five heartbeats missed: the controller hangs (DESIGN §6: stop within 0.6 s).
SILENCE_S = 0.5
#: Who wakes up this long after his time was not let run.
LATE_S = 0.1
#: The controller imports its libraries and reads its files within this, also on a slow and busy machine.
STARTUP_S = 20.0
#: A controller that has verified its chargers closes everything and is gone within this.
END_S = 10.0
#: How long the chargers' standby is waited for, and watched. Whoever starts the service anew goes on with it.
VERIFY_S = 5.0
#: Without a charger to stop, contactors are given this long to open.
OPEN_S = 0.5
#: A process that was killed is gone within this, if anything can make it go.
KILLED_S = 1.0
#: systemd is told that we live this often; the unit allows a multiple of it.
WATCHDOG_S = 0.5
#: Exit status when the guardian had to act.
ACTED = 70
MESSAGE = 4096
#: -P: a file of the working directory that is called as a library is must not be imported in its place.
CONTROLLER = ("-P", "-m", "orchestrator.service.controller")

#: Whoever wants us to end: systemd or `kill`, Ctrl-C, the terminal that is closed (if there is one), Ctrl-\.
ENDS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
#: Ctrl-Z and its like would freeze guardian and controller together, with the chargers running.
FREEZES = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)


class Guardian:
    """Watches one controller, already started, over `link` (SOCK_SEQPACKET)."""

    def __init__(self, child: int, link: socket.socket) -> None:
        self._child, self._link = os.pidfd_open(child), link
        self._ports: dict[str, int | None] = {}  # None: the controller has closed it, for now
        self._contactors: dict[str, int] = {}
        self._opened = Contactors()
        self._done = self._ending = self._ready = False
        self._excused = False  # since the last heartbeat
        self._deadline_s = time.monotonic() + STARTUP_S
        self._systemd = Systemd()
        self._watchdog_s = 0.0  # when systemd was last told that we live
        self._told = False

    def run(self) -> int:
        """Wait for the end of the controller; its exit status, or ACTED if the chargers had to be stopped from here."""
        for number in ENDS:
            # `nohup` stays what it is; but nobody who starts us can make us deaf to `kill`, or to systemd.
            if number is signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._pass_on)
        if not has_terminal() and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            signal.signal(signal.SIGHUP, self._pass_on_reload)
        reason = self._watch()
        if self._done or not self._ports:
            self._open(OPEN_S)
            return self._status(END_S)
        self._signal(signal.SIGKILL)
        # Without waiting for a gap: what the dying controller has written goes out first, the kernel keeps the order.
        # Was that half a frame, or was it just then in a write, the second stop comes 20 ms later.
        on_stop = partial(self._stopping, reason)
        whys = stop_all(self._ports, VERIFY_S, watch_s=VERIFY_S, on_stop=on_stop, on_round=self._open)
        running = [name for name, why in whys.items() if why not in ("", HELD)]
        if running:
            say(f"guardian: CUT THE MAINS of the chargers on {', '.join(running)}")
        for name, why in whys.items():
            say(f"guardian: {name}: {why or 'standby verified'}")
        for name in self._contactors:
            say(f"guardian: contactor {name}: {self._opened.became.get(name, HANGS)}")
        return self._status(KILLED_S) or ACTED

    def _pass_on(self, _number: int, _frame: FrameType | None) -> None:
        """The controller ends orderly by itself; it gets the time to."""
        self._ending = True
        self._systemd.tell("STOPPING=1")
        self._signal(signal.SIGTERM)

    def _pass_on_reload(self, _number: int, _frame: FrameType | None) -> None:
        """The policies are to be read anew; a controller that has just been started reads them anyway."""
        if self._ready:
            self._signal(signal.SIGHUP)

    def _signal(self, number: signal.Signals) -> None:
        signal.pidfd_send_signal(self._child, number)  # dead or not: it is there until we are gone, since nobody waits

    def _watch(self) -> str:
        """Read the controller's messages until they end; why they did. A controller that hangs is killed."""
        poll = select.poll()
        poll.register(self._link, select.POLLIN)
        while True:
            left_s = max(0.0, self._deadline_s - time.monotonic())
            if poll.poll(left_s * 1000):  # asked even when time is up: what has come meanwhile counts
                if not self._message():
                    return ""
            elif self._overslept():
                self._deadline_s = time.monotonic() + SILENCE_S
            else:
                self._signal(signal.SIGKILL)
                return "the controller hangs"

    def _overslept(self) -> bool:
        """It was the machine that stood still, us included (a suspended one, say): once, nobody is blamed for that."""
        late, self._excused = not self._excused and time.monotonic() - self._deadline_s > LATE_S, True
        return late

    def _message(self) -> bool:
        """Take one message; False at the end of the connection."""
        try:
            data, descriptors, _, _ = socket.recv_fds(self._link, MESSAGE, 1)
        except ConnectionResetError:
            return True  # said once of a controller that died with our answers unread; its last messages come now
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
        """Keep this descriptor of the port, or none; its name is remembered for the stop."""
        old = self._ports.get(name)
        self._ports[name] = fd
        if old is not None:
            aside(partial(drop_port, old))

    def _hold_contactor(self, name: str, fd: int | None) -> None:
        """Keep this descriptor of the line, or none: then the line is free again."""
        old = self._contactors.pop(name, None)
        if old is not None:
            aside(partial(os.close, old))
        if fd is not None:
            self._contactors[name] = fd

    def _open(self, within_s: float = 0.0) -> None:
        """Open every contactor, each in its own time: whoever obeys has stopped by now."""
        for name in self._contactors:
            self._opened.open(name, partial(self._open_one, name))
        self._opened.wait(within_s)

    def _open_one(self, name: str) -> str:
        return open_contactor(self._contactors[name])

    def _stopping(self, reason: str) -> None:
        """The stops of a round are out; after the first one there is time to tell."""
        self._systemd.tell("WATCHDOG=1")
        if not self._told:
            self._told = True
            reason = reason or f"the controller {self._fate()[1]}"
            say(f"guardian: {reason}: stopping the chargers on {len(self._ports)} ports")
            self._systemd.tell(f"STATUS={reason}; stopping the chargers")

    def _status(self, within_s: float) -> int:
        """The controller's exit status, ACTED where it has none; one that does not end is killed."""
        end = select.poll()
        end.register(self._child, select.POLLIN)
        if not end.poll(within_s * 1000):
            self._signal(signal.SIGKILL)
            end.poll(KILLED_S * 1000)
        return self._fate()[0]

    def _fate(self) -> tuple[int, str]:
        """The controller's exit status, and in words. A driver that hangs may keep it alive: nobody waits for it."""
        end = os.waitid(os.P_PIDFD, self._child, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if end is None:
            return ACTED, "does not die"
        if end.si_code == os.CLD_EXITED:
            return end.si_status, f"has ended with status {end.si_status}"
        early = self._ending and not self._ports  # before it could take SIGTERM for anything but its end
        return 0 if early else ACTED, f"was ended by {signal.Signals(end.si_status).name}"


def has_terminal() -> bool:
    """Whether somebody started us from a terminal: its end is ours. To a service, SIGHUP means something else."""
    try:
        os.close(os.open("/dev/tty", os.O_RDONLY))
    except OSError:
        return False
    return True


def guard(arguments: Sequence[str], controller: Sequence[str] = CONTROLLER) -> int:
    """Start the controller (`arguments` go to its command line) and watch over it; the exit status."""
    for number in FREEZES:
        signal.signal(number, signal.SIG_IGN)  # the controller inherits that
    # What our starter ignores or blocks is inherited: we would not learn of the child's end, nor of a wish for ours.
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.set_inheritable(True)
    command = [sys.executable, *controller, str(theirs.fileno()), *arguments]
    child = os.posix_spawn(sys.executable, command, os.environ)
    theirs.close()
    return Guardian(child, ours).run()
