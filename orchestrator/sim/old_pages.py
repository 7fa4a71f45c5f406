"""The BMU's older protocol, which is not CANopen (manual §2.4): one request, three pages with the same values.

Request and pages come from public robot software that reads the same BMUs; the manual does not describe them.
"""

import struct

from orchestrator.sim.pack import Readout

REQUEST_COB_ID = 0x460
#: Invented: the real COB-ID of the pages is not documented. This one is free for every node id.
REPLY_COB_ID = 0x4E0

#: "Not available" in TTF and TTE, as in gas gauges.
NO_MINUTES = 0xFFFF


def minutes(value: float | None) -> int:
    """TTF and TTE as 16 bits."""
    return NO_MINUTES if value is None else min(round(value), NO_MINUTES - 1)


def pages(node_id: int, request: bytes, told: Readout) -> list[bytes]:
    """The frames that answer `request`; none if it is not a request."""
    echo = 0x60 + node_id
    if request != bytes((echo,)):
        return []
    volts, amps = round(told.voltage_v * 100) & 0xFFFF, round(told.current_a * 100) & 0xFFFF
    to_full, to_empty = minutes(told.time_to_full_min), minutes(told.time_to_empty_min)
    soc, soh = round(told.soc_pct) & 0xFF, round(told.soh_pct) & 0xFF
    left_ah, left_wh = round(told.remaining_ah * 100) & 0xFFFF, round(told.available_wh * 10) & 0xFFFF
    return [
        struct.pack("<BBHHH", echo, 1, volts, amps, told.status),
        struct.pack("<BBHHBB", echo, 2, to_full, to_empty, soc, soh),
        struct.pack("<BBHHh", echo, 3, left_ah, left_wh, round(told.temperature_c * 10)),
    ]
