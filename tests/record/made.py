"""Records of charges as the service writes them, made by the dozen."""

from dataclasses import replace

from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.record import lines
from orchestrator.record.amounts import Amounts
from orchestrator.record.charge import Charge
from orchestrator.record.lines import Record
from orchestrator.record.stamp import Stamp
from orchestrator.record.ulid import CHANCE, after

#: 2026-11-28T06:00:00Z, and the time between two charges.
WALL_S, EVERY_S = 1_795_845_600.0, 3600.0
FULL = Cause.of("full", what=Cause.of("full_soc", soc_pct=100.0, limit_pct=100, key="finish.full.soc_pct"))
SPREAD = (20.0, 100.0, 20.0, 100.0)


def id_of(number: int) -> str:
    """The id of a charge."""
    return after("", 1000.0 + number, bytes(CHANCE))


def charge(number: int, n: int = 0, ah: float = 0.0, *, bay: str = "bay-1", battery: str = "B-1") -> Charge:
    """One charge as of its record `n`, half an hour long."""
    start = Stamp(WALL_S + number * EVERY_S, 540, 1000.0 + number * EVERY_S, "boot-1")
    head = {
        "station": "depot", "bay": bay, "port": f"/dev/{bay}",
        "battery": {"id": battery, "source": "typed", "can": "can0", "node": "0x10"},
        "policy": {"name": "li-ion-48v", "sha256": "0123456789ab"}, "software": "1", "by": None,
        "contactor_fitted": False,
    }  # fmt: skip
    last = replace(start, unix_s=start.unix_s + n * 600.0, mono_s=start.mono_s + n * 600.0)
    spreads = (
        SPREAD,
        (97.0,) * 4,
        (48.0, 54.0, 48.0, 54.0),
        (14.0, 1.0, 1.0, 14.0),
        (20.0, 25.0, 20.0, 26.0),
        None,
        None,
    )
    amounts = Amounts(ah=ah, wh=ah * 50, bmu_ah=ah, bmu_wh=ah * 50, energised_s=n * 600.0)
    return Charge(id_of(number), head, start, last, last, start.mono_s, 20.0, n, amounts, spreads)


def begin(number: int) -> Record:
    """The record of its begin."""
    return lines.begin(charge(number))


def checkpoint(number: int, n: int, ah: float = 0.0) -> Record:
    """A record of it as it goes on."""
    return lines.checkpoint(charge(number, n, ah))


def end(
    number: int, n: int, ah: float = 0.0, result: Cause = FULL, *, bay: str = "bay-1", battery: str = "B-1"
) -> Record:
    """The record of its end."""
    return lines.end(replace(charge(number, n, ah, bay=bay, battery=battery), result=plain(result)))
