"""The words behind `orchestrator estop`."""

import os

USAGE = """\
usage: orchestrator estop [STATION] [--port PATH ...] [--socket PATH] [--leave-held]

Stop the charger on every port of the station file, and on the given ports, and verify it. Without arguments the file is
station.yaml in this folder, else that of the installed service, else that of a service that runs. Ports whose chargers
may be running by what the service has written down are stopped, too, whether the file still names them or not.
Needs no running service. Each one that holds one of these ports is told to hold its bays until an operator starts them.
Then the station file's contactors are opened. Those that a service holds are left to it: it opens them by itself
where a charger does not obey.

  --port PATH ...  these ports: without a station file, or besides those of the one that is named
  --socket PATH    the service's control socket (default: $ORCHESTRATOR_SOCKET, or what the station file says)
  --leave-held     leave ports alone that a running service holds, and tell it nothing

Exit status 0: every charger was verified to stand by; 1: not every one, or there may be more; 2: used wrongly.
"""
#: What systemd says to ExecStopPost= (systemd.exec, $SERVICE_RESULT) when its watchdog has killed the guardian: who
#: still holds the ports is its controller, frozen as well, and is killed only afterwards.
FROZEN = "watchdog"


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
        if len(self.stations) > 1:
            self.wrong = "name one station file"
        elif taking == "--socket" or (taking == "--port" and not self.ports):
            self.wrong = f"{taking} needs a path"
