"""The golden bytes of both documents, as data."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_VECTORS = json.loads((Path(__file__).parent / "vectors.json").read_text())


@dataclass(frozen=True)
class ChargerVector:
    name: str
    wire: bytes
    valid: bool
    requested: dict[str, int] = field(default_factory=dict)
    decoded: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Exchange:
    request_cob_id: int
    request: bytes
    reply_cob_id: int
    reply: bytes


CHARGER = [
    ChargerVector(
        row["name"], bytes.fromhex(row["hex"]), row["valid"], row.get("requested", {}), row.get("decoded", {})
    )
    for row in _VECTORS["charger"]
]
GOOD = [vector for vector in CHARGER if vector.valid]

BMU = [
    Exchange(row["send"][0], bytes.fromhex(row["send"][1]), row["receive"][0], bytes.fromhex(row["receive"][1]))
    for row in _VECTORS["bmu_node_0x10"]
] + [
    # The document's §4.3.1 and §4.3.2, with the sub-index corrected as in §4.3.3 (255 is the value read).
    Exchange(0x610, bytes.fromhex("4000180200000000"), 0x590, bytes.fromhex("4F001802FF000000")),
]
