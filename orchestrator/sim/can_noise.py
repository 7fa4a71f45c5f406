"""The effect of a poor CAN bus on its frames.

A frame damaged on the wire fails its CRC: no node receives its data, and the controllers see an error. Data can still
arrive damaged if an adapter on a serial or USB line truncates it behind the bus.
"""

import random
from dataclasses import dataclass

import can

#: linux/can/error.h: CAN_ERR_PROT | CAN_ERR_BUSERROR, as reported for a CRC error by an adapter with error reporting.
BUS_ERROR = 0x008 | 0x080


@dataclass(frozen=True, slots=True)
class Bus:
    """A kind of bus; the default is perfect."""

    lost: float = 0.0  #: share of frames lost, in both directions
    damaged: float = 0.0  #: share of frames, in both directions, that arrive as an error frame or truncated
    seed: int = 1


#: The buses used in tests.
BUSES = {"perfect": Bus(), "poor": Bus(lost=0.01, damaged=0.001)}


class BusNoise:
    """Spoils frames as its bus does; the same seed spoils the same frames."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._random = random.Random(bus.seed)  # noqa: S311 - noise, not a secret

    def spoil(self, message: can.Message) -> can.Message | None:
        """The frame as it arrives; None if it is lost."""
        bus, dice = self._bus, self._random
        if bus.lost and dice.random() < bus.lost:
            return None
        if bus.damaged and dice.random() < bus.damaged:
            if not message.data or dice.random() < 0.5:
                return can.Message(arbitration_id=BUS_ERROR, is_error_frame=True, is_extended_id=False, data=bytes(8))
            cut = message.data[: dice.randrange(len(message.data))]
            return can.Message(arbitration_id=message.arbitration_id, is_extended_id=False, data=cut)
        return message
