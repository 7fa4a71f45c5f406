"""One question to a charger, and what comes back in time."""

from collections.abc import Callable

from orchestrator.devices.charger_line import ChargerLine
from orchestrator.devices.dialogue import Dialogue
from orchestrator.model import ChargerReading

#: The wire takes 20 ms, an FTDI adapter holds the last bytes back for 16 ms; the rest is the charger's.
REPLY_DEADLINE_S = 0.12


def poll(line: ChargerLine, dialogue: Dialogue, clock: Callable[[], float]) -> tuple[ChargerReading | None, bytes]:
    """Ask for the status. The reading, None where none came; and all bytes that went to and fro."""
    asked_s = now_s = clock()
    request = exchange = dialogue.ask(asked_s)
    line.write(request)
    sending, reading = len(request), None
    while reading is None and (left_s := asked_s + REPLY_DEADLINE_S - now_s) > 0:
        came = line.read(left_s, sending + dialogue.missing)
        exchange, sending, now_s = exchange + came, 0, clock()
        reading = dialogue.hear(came, now_s)
    return reading or dialogue.give_up(now_s), exchange
