"""Which battery is in a bay, and how that is known. A weaker source never displaces a stronger one."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from orchestrator.model.cause import Cause

#: Longer than any label or scanned code.
LONGEST_ID = 64


class Source(StrEnum):
    """How a battery's identity is known, the surest first."""

    SERIAL_NUMBER = "serial_number"  #: its BMU tells it
    TYPED = "typed"  #: an operator has typed or scanned it
    ASSUMED = "assumed"  #: by the BMU's node id alone


@dataclass(frozen=True, slots=True)
class Identity:
    """The identity of a battery."""

    id: str
    source: Source
    can: str  #: the bus of its BMU …
    node_id: int  #: … and its node id there
    typed: str = ""  #: what an operator has typed, whether it counts or not; "": nothing

    @classmethod
    def of(cls, can: str, node_id: int, serial: int | None, typed: str) -> Self:
        """By the surest source."""
        if serial:
            return cls(str(serial), Source.SERIAL_NUMBER, can, node_id, typed)
        if typed:
            return cls(typed, Source.TYPED, can, node_id, typed)
        return cls(f"{can}:0x{node_id:02X}", Source.ASSUMED, can, node_id)

    @property
    def contradicted(self) -> bool:
        """Whether an operator has typed something else than its serial number."""
        return self.source is Source.SERIAL_NUMBER and bool(self.typed) and not _is_number(self.typed, self.id)

    @property
    def cause(self) -> Cause:
        """What people read: the id and its source."""
        if self.contradicted:
            return Cause.of("identity_contradicted", battery=self.id, typed=self.typed)
        if self.source is Source.ASSUMED:
            return Cause.of("identity_assumed", battery=self.id, node_id=self.node_id, can=self.can)
        known = "identity_serial_number" if self.source is Source.SERIAL_NUMBER else "identity_typed"
        return Cause.of(known, battery=self.id)


def is_id(text: str) -> bool:
    """Whether an operator may call a battery so."""
    return 0 < len(text) <= LONGEST_ID and text.isprintable() and text == text.strip()


def _is_number(typed: str, serial: str) -> bool:
    """Whether it is this number, as it is or in hexadecimal."""
    return typed.lstrip("0") == serial or typed.lower() == f"0x{int(serial):x}"
