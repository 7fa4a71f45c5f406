"""One status request to a charger, and the reply, if it comes in time."""

from collections.abc import Callable

from orchestrator.devices.charger_line import ChargerLine
from orchestrator.devices.dialogue import Dialogue
from orchestrator.model import ChargerReading

#: The wire takes 20 ms, an FTDI adapter holds back the last bytes for 16 ms; the rest is for the charger.
REPLY_DEADLINE_S = 0.12


def poll(line: ChargerLine, dialogue: Dialogue, clock: Callable[[], float]) -> tuple[ChargerReading | None, bytes]:
    """Request the status. Returns the reading, None if none came, and all bytes exchanged."""
    asked_s = now_s = clock()
    request = exchange = dialogue.ask(asked_s)
    line.write(request)
    sending, reading = len(request), None
    while reading is None and (left_s := asked_s + REPLY_DEADLINE_S - now_s) > 0:
        came = line.read(left_s, sending + dialogue.missing)
        exchange, sending, now_s = exchange + came, 0, clock()
        reading = dialogue.hear(came, now_s)
    return reading or dialogue.give_up(now_s), exchange
