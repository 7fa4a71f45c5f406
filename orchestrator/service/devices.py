"""The interfaces of a bay's two devices in the running service."""

from typing import Protocol

from orchestrator.interlock import Grant
from orchestrator.model import BatteryLink, BatteryReading, ChargerLink, ChargerReading, Command


class ChargerDevice(Protocol):
    """The interface of a charger's port (`devices.charger.ChargerPort`)."""

    @property
    def view(self) -> tuple[ChargerReading | None, ChargerLink]:
        """The newest reading and the state of the link."""

    def command(self, command: Command | None, grant: Grant | None = None) -> None:
        """Give the command to repeat."""


class BatteryDevice(Protocol):
    """The interface of a BMU (`devices.battery.BatteryNode`)."""

    @property
    def view(self) -> tuple[BatteryReading, BatteryLink]:
        """The newest values and the state of the link."""

    def attend(self, *, closely: bool) -> None:
        """Read fast-changing values often, or not."""
