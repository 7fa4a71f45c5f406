"""The ports of a station whose controller has ended before it could hand them over: a charger may be running there.

The controller knows the station; the guardian only knows what it was given. So this reads the station file, and the
persisted state, the way `estop` does. What that needs is imported only here: the guardian itself must not depend on it.
"""

import os
import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress

from orchestrator.lastresort.bareport import HELD
from orchestrator.lastresort.laststop import stop_all
from orchestrator.lastresort.notify import say

#: How long to wait for the files: their disk may hang.
READ_S = 1.0


def unheld_ports(station: str, held: Iterable[str]) -> dict[str, None]:
    """The station's ports other than the `held` ones, as far as its files can be read in time."""
    known = {os.path.realpath(port) for port in held}
    found: dict[str, None] = {}

    def look() -> None:
        try:
            for port in _ports(station):
                if os.path.realpath(port) not in known:
                    known.add(os.path.realpath(port))
                    found[port] = None
        except Exception as error:  # noqa: BLE001 - no memory for an import, say; the ports found so far are stopped
            say(f"guardian: {station} cannot be read ({error!r}): CHECK EVERY CHARGER, cut the mains of those that run")

    reading = threading.Thread(target=look, daemon=True)
    try:
        reading.start()
    except RuntimeError:  # no thread available
        look()
    with suppress(RuntimeError):
        reading.join(READ_S)
    return dict(found)


def _ports(station: str) -> Iterable[str]:
    """First those of the file, then those that only the persisted state has."""
    from pathlib import Path  # noqa: PLC0415 - see above

    from orchestrator.config.ports import wiring  # noqa: PLC0415 - see above
    from orchestrator.lastresort.inhand import ports_in_hand  # noqa: PLC0415 - see above

    wired = wiring(Path(station))
    yield from wired.ports
    if wired.journal:
        yield from ports_in_hand(wired.journal)


def stop_unheld(station: str, error: OSError, within_s: float) -> None:
    """Stop all of them where not even a controller can be started."""
    say(f"guardian: the controller cannot be started: {error.strerror}: raise the limits on processes and memory")
    report(stop_all(unheld_ports(station, ()), within_s))


def report(whys: Mapping[str, str]) -> None:
    """Say what has become of each charger."""
    running = [name for name, why in whys.items() if why not in ("", HELD)]
    if running:
        say(f"guardian: CUT THE MAINS of the chargers on {', '.join(running)}")
    for name, why in whys.items():
        say(f"guardian: {name}: {why or 'standby verified'}")
