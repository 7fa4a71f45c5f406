"""Which frames the kernel lets through to us: exactly those that somebody here subscribed to.

On a shared bus everything else is thrown away where it costs least. Only SocketCAN is told: there error frames have a
filter of their own, while python-can would drop them with the rest where it filters by itself, and slower than we do.
"""

from collections.abc import Iterable
from typing import NotRequired, TypedDict

_STANDARD_ID = 0x7FF
_REMOTE = 0x4000_0000  #: CAN_RTR_FLAG: in the mask and not in the id, it keeps remote frames out
_FUNCTION_CODE = 0x780  #: the upper four bits of a COB-ID, the lower seven are the node's id
MOST = 512  #: linux/can.h: CAN_RAW_FILTER_MAX


class Filter(TypedDict):
    """As python-can has it."""

    can_id: int
    can_mask: int
    extended: NotRequired[bool]


def filters(cob_ids: Iterable[int]) -> list[Filter]:
    """For `can.BusABC.set_filters()`: one for each COB-ID, or one for each function code where that is too many."""
    wanted = sorted(set(cob_ids))
    mask = _STANDARD_ID
    if len(wanted) > MOST:
        mask = _FUNCTION_CODE
        wanted = sorted({cob_id & mask for cob_id in wanted})
    return [{"can_id": cob_id, "can_mask": mask | _REMOTE, "extended": False} for cob_id in wanted]
