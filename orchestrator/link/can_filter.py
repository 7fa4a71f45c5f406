"""The frames that the kernel passes to us: exactly those with a subscriber.

On a shared bus everything else is dropped where it costs least. This is for SocketCAN only, which has a separate filter
for error frames; on other interfaces python-can filters by itself, drops error frames with the rest, and is slower than
we are.
"""

from collections.abc import Iterable
from typing import NotRequired, TypedDict

_STANDARD_ID = 0x7FF
_REMOTE = 0x4000_0000  #: CAN_RTR_FLAG: set in the mask but not in the id, it excludes remote frames
_FUNCTION_CODE = 0x780  #: the upper four bits of a COB-ID; the lower seven are the node id
MOST = 512  #: linux/can.h: CAN_RAW_FILTER_MAX


class Filter(TypedDict):
    """A filter as in python-can."""

    can_id: int
    can_mask: int
    extended: NotRequired[bool]


def filters(cob_ids: Iterable[int]) -> list[Filter]:
    """For `can.BusABC.set_filters()`: one per COB-ID, or one per function code if those are too many."""
    wanted = sorted(set(cob_ids))
    mask = _STANDARD_ID
    if len(wanted) > MOST:
        mask = _FUNCTION_CODE
        wanted = sorted({cob_id & mask for cob_id in wanted})
    return [{"can_id": cob_id, "can_mask": mask | _REMOTE, "extended": False} for cob_id in wanted]
