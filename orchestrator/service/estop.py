"""`orchestrator estop`: stop chargers with no service, with one that hangs and with one that runs.

Ports are opened without the lock that a service holds on them, and the first stop goes out before anything else is
looked at. Standard library only, and PyYAML where a station file has to be read.
"""

import os
import sys
from collections.abc import Mapping

from orchestrator.service.laststop import first_stop, stop_all

USAGE = """\
usage: orchestrator estop [STATION] [--port PATH ...] [--socket PATH] [--leave-held]

Stop the charger on every port of the station file (default: station.yaml), or on the given ports, and verify it.
Needs no running service. One that runs is told to hold these bays until an operator starts them.
Then the station file's contactors are opened. Those that a service holds are left to it: it opens them by itself
where a charger does not obey.

  --port PATH ...  these ports, without a station file
  --socket PATH    the service's control socket (default: $ORCHESTRATOR_SOCKET, or what the station file says)
  --leave-held     leave ports alone that a running service holds, and tell it nothing

Exit status 0: every charger was verified to stand by; 1: not every one; 2: used wrongly.
"""
DEFAULT_STATION = "station.yaml"
Contactors = tuple[tuple[str, int, bool], ...]  #: chip, line, active low
#: What systemd says to ExecStopPost= (systemd.exec, $SERVICE_RESULT) when its watchdog has killed the guardian: who
#: still holds the ports is its controller, frozen as well, and is killed only afterwards.
FROZEN = "watchdog"
#: How long the proof of standby is waited for.
VERIFY_S = 3.0


class Options:
    """The command line, taken apart by hand: argparse alone would cost half of the time there is."""

    def __init__(self, words: list[str]) -> None:
        self.ports: list[str] = []
        self.stations: list[str] = []
        self.socket = os.environ.get("ORCHESTRATOR_SOCKET", "")
        self.leave_held = False
        self.wrong = ""
        taking = ""
        for word in words:
            if word == "--leave-held":
                self.leave_held, taking = True, ""
            elif word in ("--port", "--socket"):
                taking = word
            elif word.startswith("-"):
                self.wrong = f"unknown option {word}"
            elif taking == "--port":
                self.ports.append(word)
            elif taking == "--socket":
                self.socket, taking = word, ""
            else:
                self.stations.append(word)
        if os.environ.get("SERVICE_RESULT") == FROZEN:
            self.leave_held = False
        if len(self.stations) + bool(self.ports) > 1:
            self.wrong = "name one station file, or ports"
        elif taking == "--socket" or (taking == "--port" and not self.ports):
            self.wrong = f"{taking} needs a path"


def main(words: list[str]) -> int:
    """Stop, verify, tell; the exit status."""
    if "-h" in words or "--help" in words:
        print(USAGE, end="")  # noqa: T201 - what people read
        return 0
    options = Options(words)
    if options.wrong:
        print(f"orchestrator estop: {options.wrong}\n{USAGE}", end="", file=sys.stderr)  # noqa: T201
        return 2
    bays: Mapping[str, str] = dict.fromkeys(options.ports, "")
    socket = options.socket
    contactors: Contactors = ()
    if not bays:
        bays, written, contactors = _wiring((options.stations or [DEFAULT_STATION])[0])
        socket = socket or written
    if not bays:
        print("no port to stop: name a station file or --port PATH", file=sys.stderr)  # noqa: T201
        return 1
    return _stop(bays, socket, contactors, options)


def _stop(bays: Mapping[str, str], socket: str, contactors: Contactors, options: Options) -> int:
    """Stop all of them, with whatever help there is, and tell what became of each."""
    opened = {port: first_stop(port, leave_held=options.leave_held) for port in bays}
    from orchestrator.service.lastopen import open_contactors  # noqa: PLC0415 - the first stops are out now

    cut: dict[str, str] = {}

    def isolate() -> None:
        cut.update(open_contactors(contactors))

    if options.leave_held:
        whys, said = stop_all(opened, VERIFY_S, on_round=isolate), ""
    else:
        from orchestrator.service.witness import Service  # noqa: PLC0415 - the first stops are out now

        service = Service(bays, socket, every_bay=not options.ports)
        whys = stop_all(
            opened, VERIFY_S, leave_held=False, on_stop=service.hold, on_round=isolate, witness=service.sees
        )
        said = service.said
    for port, why in whys.items():
        name = f"{bays[port]} ({port})" if bays[port] else port
        print(f"{name}: {why or 'standby verified'}")  # noqa: T201
    for line, became in cut.items():
        print(f"contactor on {line}: {became}")  # noqa: T201
    if said:
        print(said, file=sys.stderr)  # noqa: T201
    return 1 if any(whys.values()) else 0


def _wiring(station: str) -> tuple[Mapping[str, str], str, Contactors]:
    """Ports with their bays' names, the socket and the contactors of a station file, even of one with mistakes."""
    from pathlib import Path  # noqa: PLC0415 - only where it is needed

    from orchestrator.config.ports import wiring  # noqa: PLC0415 - PyYAML

    try:
        found = wiring(Path(station))
    except OSError as error:
        print(f"{station}: {error.strerror}", file=sys.stderr)  # noqa: T201
        return {}, "", ()
    return found.ports, found.socket, found.contactors
