"""The status document of a running service, kept up to date over one connection (`watch`)."""

import json
import socket
from collections.abc import Mapping
from pathlib import Path
from time import monotonic
from typing import Any

from orchestrator.lastresort.asking import MAX_ANSWER

#: The version of the lines that is understood here.
VERSION = 1
#: A service that says nothing for this long is gone: it says something every 5 s.
SILENT_S = 6.0
PART = 1 << 16


class Refused(Exception):  # noqa: N818 - it is an answer
    """The service does not let us watch: it is of an older version, or many watch already."""


class Followed:
    """`document` is the newest. OSError where the service has gone or is silent, ValueError for what is none."""

    def __init__(self, path: Path, within_s: float) -> None:
        self._heard, self._heard_s = bytearray(), monotonic()
        self.document: dict[str, Any] = {}
        self._bays: dict[str, Any] = {}
        self._connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._connection.settimeout(within_s)
            self._connection.connect(str(path))
            self._connection.sendall(b'{"verb": "watch", "version": %d}\n' % VERSION)
            end_s = monotonic() + within_s
            while not self.document:
                if (left_s := end_s - monotonic()) <= 0:
                    raise TimeoutError("timed out")
                self._read(left_s)
        except BaseException:
            self.close()
            raise

    def wait(self, least_s: float, most_s: float) -> None:
        """Take what comes: for `least_s` in any case, and for `most_s` if nothing changes."""
        began_s, changed = monotonic(), False
        while (left_s := began_s + (least_s if changed else most_s) - monotonic()) > 0:
            changed = self._read(left_s) or changed

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def _read(self, within_s: float) -> bool:
        """Take what comes within this time; whether anything has changed."""
        self._connection.settimeout(within_s)
        try:
            part = self._connection.recv(PART)
        except TimeoutError:
            if monotonic() - self._heard_s > SILENT_S:
                raise
            return False
        if not part:
            raise ConnectionError("closed")
        self._heard += part
        self._heard_s = monotonic()
        if len(self._heard) > MAX_ANSWER:
            raise ValueError("a line without an end")
        *lines, rest = self._heard.split(b"\n")
        self._heard = rest
        news = [self._take(json.loads(line)) for line in lines]
        return any(news)

    def _take(self, line: Mapping[str, Any]) -> bool:
        """One line; whether it tells of a change."""
        if not self.document:
            if not line.get("ok"):
                raise Refused
            self.document = dict(line["document"])
            self._bays = {bay["name"]: bay for bay in self.document["bays"]}
            return True
        bays, station = line.get("bays", {}), line.get("station", {})
        self._bays |= bays
        for name in line.get("gone", ()):
            self._bays.pop(name, None)
        self.document |= {**station, "time": line["time"], "bays": list(self._bays.values())}
        return bool(bays or station)
