"""The options of `orchestrator estop`."""

import os

USAGE = """\
usage: orchestrator estop [STATION] [--port PATH ...] [--socket PATH] [--leave-held] [--because TEXT]

Stop the charger on every port of the station file, and on the given ports, and verify the stops. Without arguments the
file is station.yaml in this directory, else the installed service's, else that of a running service. Ports whose
chargers may be running according to the service's persisted state are stopped as well, even if the file no longer names
them. Needs no running service. A service that holds one of these ports is told to hold its bays until an operator
starts them. Then the station file's contactors are opened. Those held by a service are left to it: it opens them by
itself if a charger does not obey.

  --port PATH ...  these ports: without a station file, or in addition to those of the named one
  --socket PATH    the service's control socket (default: $ORCHESTRATOR_SOCKET, or the station file's)
  --leave-held     leave alone ports that a running service holds, and tell it nothing
  --because TEXT   why, for whoever asks the service later

examples:
  orchestrator estop
      stop every charger of the station that is found, now
  orchestrator estop /etc/orchestrator/station.yaml
      of this station
  orchestrator estop --because 'smoke in hall 2'
      whoever asks why a bay is held reads this
  orchestrator estop --port /dev/charger/bay-1
      without any file

Exit status 0: every charger was verified in standby; 1: not every one, or there may be more; 2: usage error.
"""
#: systemd's $SERVICE_RESULT for ExecStopPost= (systemd.exec) if its watchdog has killed the guardian: the ports are
#: then still held by the controller, which is frozen as well, and is killed only afterwards.
FROZEN = "watchdog"


class Options:
    """The command line, parsed by hand: argparse alone would take half of the time budget."""

    def __init__(self, words: list[str]) -> None:
        self.ports: list[str] = []
        self.stations: list[str] = []
        self.socket = os.environ.get("ORCHESTRATOR_SOCKET", "")
        self.leave_held = False
        self.because = ""  #: nothing is refused for the lack of it
        self.wrong = ""
        taking = ""
        for word in words:
            if taking == "--because":
                self.because, taking = word, ""
            elif word == "--leave-held":
                self.leave_held, taking = True, ""
            elif word in ("--port", "--socket", "--because"):
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
