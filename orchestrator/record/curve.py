"""The curve of a charge: a point every ten seconds and at each change, as CSV, compressed in batches. Pure.

Each batch is a gzip member of its own. One after another they are one gzip file to every reader, so a kill costs what
has not been written yet, and a power cut the member that it tears.
"""

import zlib
from collections.abc import Sequence

from orchestrator.record.look import VALUES, Look

#: Between two points while current flows, and otherwise.
POINT_S, PAUSED_S = 10.0, 600.0
#: How long points are gathered.
GATHER_S = 300.0
#: More points of one charge are not kept: more than two days of charging.
MOST = 20_000
#: zlib's format with a gzip header.
GZIP = 16 + zlib.MAX_WBITS
HEAD = ",".join(("elapsed_s", "state", "step", *VALUES, "charger_ah")) + "\r\n"
#: The folder of the curves, in that of the records, and the end of their names. The newest always stay.
FOLDER, SUFFIX, STAY = "curves", ".csv.gz", 100


class Curve:
    """The points of one charge that are not written yet. `count` is how many have been made."""

    def __init__(self, count: int = 0) -> None:
        self.count = count
        self._points: list[str] = []
        self._last: tuple[object, int] | None = None  # state and step …
        self._last_s = self._first_s = 0.0  # … when, and when the first waiting point was made

    def take(self, look: Look, elapsed_s: float, ah: float) -> None:
        """One more decision."""
        step = look.decision.step
        now = (look.decision.state, step.number if step is not None else 0)
        every_s = POINT_S if look.runs else PAUSED_S
        if (now == self._last and look.now_s - self._last_s < every_s) or self.count >= MOST:
            return
        self._last, self._last_s = now, look.now_s
        self._first_s = self._first_s if self._points else look.now_s
        cells = ["" if value is None else f"{value:g}" for value in look.values()]
        self._points.append(",".join((f"{elapsed_s:.1f}", now[0], str(now[1] or ""), *cells, f"{ah:.4f}")) + "\r\n")
        self.count += 1

    def is_due(self, now_s: float) -> bool:
        """Whether the points have been gathered long enough."""
        return bool(self._points) and now_s - self._first_s >= GATHER_S

    def rest(self) -> str:
        """The points not given yet."""
        points, self._points = self._points, []
        return "".join(points)


def member(text: str) -> bytes:
    """As it is written."""
    packer = zlib.compressobj(wbits=GZIP)
    return packer.compress(text.encode()) + packer.flush()


def whole_size(data: bytes) -> int:
    """The length of the whole members at the beginning of a file."""
    size = 0
    while size < len(data):
        unpacker = zlib.decompressobj(wbits=GZIP)
        try:
            unpacker.decompress(data[size:])
        except zlib.error:
            break
        if not unpacker.eof:
            break
        size = len(data) - len(unpacker.unused_data)
    return size


def outdated(names: Sequence[str], oldest_id: str) -> list[str]:
    """The files of charges that began before this id."""
    found = sorted(name for name in names if name.endswith(SUFFIX))
    return [name for name in found[:-STAY] if name < oldest_id]
