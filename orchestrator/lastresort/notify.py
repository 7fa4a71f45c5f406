"""Messages to people and to systemd, without ever waiting for them. Standard library only."""

import os
import select
import socket

#: A writable pipe takes this much at once (PIPE_BUF).
_PIECE = 4096


def say(text: str) -> None:
    """Print a line on standard error. If nobody takes it now, it is lost: it must not delay a stop."""
    put(2, f"{text}\n".encode(errors="backslashreplace"))


def put(fd: int, data: bytes, patience_s: float = 0.0) -> None:
    """Write to a descriptor. Whatever is not taken within `patience_s` is lost: a terminal may be stopped."""
    try:
        taker = select.poll()
        taker.register(fd, select.POLLOUT)
        while data and any(event & select.POLLOUT for _, event in taker.poll(patience_s * 1000)):
            data = data[os.write(fd, data[:_PIECE]) :]
    except OSError:
        return  # the reader is gone


class Systemd:
    """The service manager, if it has asked to be notified (sd_notify)."""

    def __init__(self) -> None:
        path = os.environ.get("NOTIFY_SOCKET", "")
        self._socket: socket.socket | None = None
        if path:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._address = f"\0{path[1:]}" if path.startswith("@") else path

    def tell(self, text: str) -> None:
        """Send one notification, such as "WATCHDOG=1"; lost if it cannot be taken now."""
        if self._socket is not None:
            try:
                self._socket.sendto(text.encode(), socket.MSG_DONTWAIT, self._address)
            except OSError:
                return
