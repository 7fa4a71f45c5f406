"""EMCY frames as text (CiA 301, table 26): unsolicited error reports from a node."""

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
    """The COB-ID of EMCY frames from this node."""
    return 0x080 + node_id


def emergency_text(data: bytes) -> str | None:
    """The frame as text; "" for "error reset"; None if it is too short for a code. Other short frames count as well."""
    if len(data) < 2:
        return None
    code = int.from_bytes(data[:2], "little")
    if code & 0xFF00 == 0:
        return ""
    meaning = next((text for value, mask, text in _CLASSES if code & mask == value), "undocumented")
    return f"EMCY 0x{code:04X}: {meaning} ({data.hex(' ').upper()})"
