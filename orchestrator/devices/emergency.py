"""EMCY frames (CiA 301, table 26): what a node says unasked when something is wrong with it."""

from orchestrator.model import Cause
from orchestrator.protocol.hextext import hex_of

_CLASSES = (  # code, mask, meaning; the narrower ones first
    (0xFF00, 0xFF00, "emcy_specific"),
    (0x1000, 0xFF00, "emcy_generic"),
    (0x5000, 0xFF00, "emcy_hardware"),
    (0x7000, 0xFF00, "emcy_modules"),
    (0x9000, 0xFF00, "emcy_external"),
    (0xF000, 0xFF00, "emcy_functions"),
    (0x2000, 0xF000, "emcy_current"),
    (0x3000, 0xF000, "emcy_voltage"),
    (0x4000, 0xF000, "emcy_temperature"),
    (0x6000, 0xF000, "emcy_software"),
    (0x8000, 0xF000, "emcy_monitoring"),
)


def emergency_cob_id(node_id: int) -> int:
    """The COB-ID of EMCY frames from this node."""
    return 0x080 + node_id


def is_emergency(data: bytes) -> bool:
    """Whether the frame is long enough to hold a code. Short ones count, too."""
    return len(data) >= 2


def emergency_of(data: bytes) -> Cause | None:
    """What the frame says; None for "error reset"."""
    code = int.from_bytes(data[:2], "little")
    if code & 0xFF00 == 0:
        return None
    meaning = next((word for value, mask, word in _CLASSES if code & mask == value), "emcy_undocumented")
    return Cause.of("emcy", code=code, meaning=meaning, data=hex_of(data))
