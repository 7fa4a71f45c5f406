"""What calls itself a service beside an emergency stop: it listens on a control socket and answers."""

import json
import socket
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


@contextmanager
def answering(path: Path, status: Mapping[str, Any] | None) -> Iterator[list[Mapping[str, Any]]]:
    """What listens on a Unix socket, and all that it is asked: it answers like a service, or drips for ever."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    listener.bind(str(path))
    listener.listen()
    asked: list[Mapping[str, Any]] = []
    over = threading.Event()

    def drip(client: socket.socket) -> None:
        with suppress(BrokenPipeError):  # who asked has heard enough
            while not over.wait(0.2):
                client.send(b" ")

    def serve() -> None:
        while True:
            try:
                client, _ = listener.accept()
                line = client.makefile("rb").readline()
            except OSError:
                return
            if not line:
                continue
            asked.append(json.loads(line))
            if status is None:
                threading.Thread(target=drip, args=(client,), daemon=True).start()
                continue
            answer = {"results": {"bay-1": ""}} if asked[-1]["verb"] == "stop" else status
            client.sendall(json.dumps({"ok": True, **answer}).encode() + b"\n")
            client.close()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield asked
    finally:
        over.set()
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def bay(port: str, charger: Mapping[str, Any], battery: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "name": "bay-1", "port": port, "state": "IDLE", "reason": "no battery",
        "charger": {"online": True, "t_s": 1e9, "operation": 0, "current_a": 0.0, **charger},
        "battery": {"online": True, "current_a": 0.0, **battery},
    }  # fmt: skip
