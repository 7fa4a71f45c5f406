"""EMCY frames in words (CiA 301, table 26): what a node says unasked when something is wrong with it."""

_CLASSES = (  # code, mask, meaning; the narrower ones first
    (0xFF00, 0xFF00, "device-specific"),
    (0x1000, 0xFF00, "generic error"),
    (0x5000, 0xFF00, "device hardware"),
    (0x7000, 0xFF00, "additional modules"),
    (0x9000, 0xFF00, "external error"),
    (0xF000, 0xFF00, "additional functions"),
    (0x2000, 0xF000, "current"),
    (0x3000, 0xF000, "voltage"),
    (0x4000, 0xF000, "temperature"),
    (0x6000, 0xF000, "device software"),
    (0x8000, 0xF000, "monitoring"),
)


def emergency_cob_id(node_id: int) -> int:
    """EMCY frames of this node."""
    return 0x080 + node_id


def emergency_text(data: bytes) -> str | None:
    """The frame in words; "" for "error reset"; None if it is too short to hold a code. Short ones count, too."""
    if len(data) < 2:
        return None
    code = int.from_bytes(data[:2], "little")
    if code & 0xFF00 == 0:
        return ""
    meaning = next((text for value, mask, text in _CLASSES if code & mask == value), "undocumented")
    return f"EMCY 0x{code:04X}: {meaning} ({data.hex(' ').upper()})"
