"""The service as installed by docs/install.md and run by systemd, next to an emulated station."""

import grp
import json
import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event

from orchestrator.sim.client import PlantProcess
from tests.guest import page
from tests.guest.stage import Scene, socketcan, vcan
from tests.whole.station import Service

STATION = Path("/etc/orchestrator/station.yaml")
SOCKET = Path("/run/orchestrator/orchestrator.sock")
PORT = Path("/dev/charger/bay-1")
#: The only difference between the guest's unit and the shipped one: its serial ports are ptys.
DROP_IN = "[Service]\nDeviceAllow=char-pts rw\n"
#: The technician's edits of the station file: text of the example → replacement.
EDITS = {
    r"port: /dev/serial/by-path/\S+": f"port: {PORT}",
    r"socket: run/orchestrator.sock": f"socket: {SOCKET}",
    r"directory: run/journal": "directory: /var/lib/orchestrator/journal",
}


class Installed(Service):
    """`orchestrator.service`, asked over its socket as root."""

    def __init__(self) -> None:  # nothing to write or start: the page did it
        self.socket, self._pause = SOCKET, Event()

    @property
    def guardian(self) -> int:
        return int(page.run("systemctl show --property MainPID --value orchestrator"))

    def log(self) -> str:
        return page.run("journalctl --unit orchestrator --output cat --no-pager")


def edit_station() -> None:
    text = STATION.read_text(encoding="utf-8")
    for pattern, ours in EDITS.items():
        text, count = re.subn(pattern, ours, text)
        assert count == 1, f"{pattern} is not in {STATION}"
    STATION.write_text(text, encoding="utf-8")


def section(number: int) -> str:
    """Run every command of this section of the page in one shell; returns the output."""
    return page.run("set -e\n" + "\n".join(page.commands(str(number))))


@contextmanager
def installed() -> Iterator[Scene]:
    """Work through the page up to a running service, and uninstall it again."""
    page.provide_sudo()
    page.ROOT.chmod(0o700)  # a technician has it in their home, which the service's user may not read
    Path("/etc/udev/rules.d").mkdir(parents=True, exist_ok=True)
    section(1)
    section(2)
    with vcan("can0"), PlantProcess(PORT.parent, "--can", json.dumps(socketcan("can0"))) as plant:
        os.chown(PORT, 0, grp.getgrnam("dialout").gr_gid)  # as udev does it
        PORT.chmod(0o660)
        section(3)
        section(4)
        page.run("\n".join(page.commands("5")[:2]))
        edit_station()
        page.run(page.commands("5")[-1])
        section(6)
        folder = Path("/etc/systemd/system/orchestrator.service.d")
        folder.mkdir()
        (folder / "guest.conf").write_text(DROP_IN, encoding="ascii")
        section(7)
        service = Installed()
        try:
            yield Scene(plant, service)
        except BaseException:
            print(service.log())
            raise
        finally:
            subprocess.run(["systemctl", "stop", "orchestrator"], check=False)
