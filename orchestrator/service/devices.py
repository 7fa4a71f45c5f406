"""What a bay in the running service needs of its two devices."""

from typing import Protocol

from orchestrator.interlock import Grant
from orchestrator.model import BatteryLink, BatteryReading, ChargerLink, ChargerReading, Command


class Charger(Protocol):
    """What a bay needs of a charger's port (`devices.charger.ChargerPort`)."""

    @property
    def view(self) -> tuple[ChargerReading | None, ChargerLink]:
        """The newest reading and how the line is doing."""

    def order(self, command: Command | None, grant: Grant | None = None) -> None:
        """Leave a standing order."""


class Battery(Protocol):
    """What a bay needs of a BMU (`devices.battery.BatteryNode`)."""

    @property
    def view(self) -> tuple[BatteryReading, BatteryLink]:
        """The newest values and how the bus is doing."""
