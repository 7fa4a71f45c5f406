"""The guardian: parent of the controller, and the one who stops the chargers when the controller cannot.

Theory of operation. `orchestrator run` is this process; it starts the controller and then only waits. The controller
hands it a duplicate of every serial port it opens (SCM_RIGHTS) and sends a heartbeat when *all* of its loops have turned.
No heartbeat for SILENCE_S, or the end of the connection, means that nobody is at the wheel: the guardian kills what is
left, stops the charger on every port that it holds, verifies it, and ends with an error, so that systemd starts anew.
It answers each heartbeat; a controller that gets no answer knows that its guardian is gone, stops, and ends.

Standard library and `protocol/standby.py` only: what is not imported cannot fail.
"""

import array
import contextlib
import os
import select
import signal
import socket
import sys
import time
from types import FrameType

from orchestrator.service.laststop import stop_all

#: Messages from the controller: one letter, then a port's name; PORT carries the descriptor.
BEAT, PORT, DROP, DONE = b"B", b"P", b"D", b"E"
#: The guardian's answer to each BEAT.
ALIVE = b"A"
#: Five heartbeats missed: the controller hangs (DESIGN §6: stop within 0.6 s).
SILENCE_S = 0.5
#: The controller imports its libraries and reads its files within this, also on a slow and busy machine.
STARTUP_S = 20.0
#: A controller that has verified its chargers closes everything and is gone within this.
END_S = 10.0
#: The longest frame of ours is 11 bytes: 5.7 ms at 19200 baud. What the dying controller was sending is out by then.
FRAME_GAP_S = 0.006
#: How long the chargers' standby is waited for. Whoever starts the service anew goes on with it.
VERIFY_S = 5.0
#: Exit status when the guardian had to act.
ACTED = 70
MESSAGE = 4096


class Guardian:
    """Watches one controller, already started, over `link` (SOCK_SEQPACKET)."""

    def __init__(self, child: int, link: socket.socket) -> None:
        self._child, self._link = child, link
        self._ports: dict[str, int] = {}
        self._held = False  # a port has been handed over: there is something to stop
        self._done = False
        self._ending = False
        self._deadline_s = time.monotonic() + STARTUP_S

    def run(self) -> int:
        """Wait for the end of the controller; its exit status, or ACTED if the chargers had to be stopped from here."""
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._pass_on)
        reason = self._watch()
        if self._done or not self._held:
            return self._status()
        say(f"guardian: {reason}: stopping {len(self._ports)} chargers")
        _notify(f"STATUS=the controller is gone ({reason}); stopping the chargers")
        time.sleep(FRAME_GAP_S)
        for name, why in stop_all(self._ports, VERIFY_S).items():
            say(f"guardian: {why or f'{name}: standby verified'}")
        return self._status() or ACTED

    def _pass_on(self, number: int, _frame: FrameType | None) -> None:
        """The controller ends orderly by itself; it gets the time to."""
        if not self._ending:
            self._ending = True
            _notify("STOPPING=1")
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._child, number)

    def _watch(self) -> str:
        """Read the controller's messages until they end; why they did. A controller that hangs is killed."""
        poll = select.poll()
        poll.register(self._link, select.POLLIN)
        while True:
            left_s = self._deadline_s - time.monotonic()
            if left_s <= 0:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(self._child, signal.SIGKILL)
                return "the controller hangs"
            if poll.poll(left_s * 1000) and not self._message():
                return "the controller has ended"

    def _message(self) -> bool:
        """Take one message; False at the end of the connection."""
        try:
            data, descriptors = _receive(self._link)
        except OSError:
            return False
        kind, name = data[:1], data[1:].decode(errors="replace")
        if kind == BEAT:
            self._beat()
        elif kind == PORT and descriptors:
            self._drop(name)
            self._ports[name], self._held = descriptors.pop(), True
        elif kind == DROP:
            self._drop(name)
        elif kind == DONE:
            self._done, self._deadline_s = True, time.monotonic() + END_S
        for fd in descriptors:
            os.close(fd)
        return bool(data)

    def _beat(self) -> None:
        self._deadline_s = time.monotonic() + SILENCE_S
        with contextlib.suppress(OSError):
            self._link.send(ALIVE, socket.MSG_DONTWAIT)
        _notify("READY=1\nWATCHDOG=1")

    def _drop(self, name: str) -> None:
        if name in self._ports:
            os.close(self._ports.pop(name))

    def _status(self) -> int:
        """The controller's exit status; a signal that ended it counts as ACTED."""
        _, status = os.waitpid(self._child, 0)
        return os.WEXITSTATUS(status) if os.WIFEXITED(status) else ACTED


def _receive(link: socket.socket) -> tuple[bytes, list[int]]:
    """One message and the descriptors that came with it."""
    size = array.array("i").itemsize
    data, ancillary, _, _ = link.recvmsg(MESSAGE, socket.CMSG_SPACE(size))
    descriptors = array.array("i")
    for level, kind, content in ancillary:
        if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS:
            descriptors.frombytes(content[: len(content) - len(content) % size])
    return data, list(descriptors)


def _notify(text: str) -> None:
    """Tell systemd, if it has asked for it."""
    path = os.environ.get("NOTIFY_SOCKET")
    if path:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd, contextlib.suppress(OSError):
            systemd.sendto(text.encode(), f"\0{path[1:]}" if path.startswith("@") else path)


def say(text: str) -> None:
    """A line for people; a standard error that is gone must not keep a stop from being sent."""
    with contextlib.suppress(OSError):
        os.write(sys.stderr.fileno(), f"{text}\n".encode())


def guard(arguments: list[str]) -> int:
    """Start the controller (`arguments` go to its command line) and watch over it; the exit status."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.set_inheritable(True)
    command = [sys.executable, "-m", "orchestrator.service.controller", str(theirs.fileno()), *arguments]
    child = os.posix_spawn(sys.executable, command, os.environ)
    theirs.close()
    return Guardian(child, ours).run()
