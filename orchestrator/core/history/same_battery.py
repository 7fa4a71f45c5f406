"""Whether the battery in the bay is still the same one: by its serial number, or as the charger has seen it meanwhile.

Theory of operation. A BMU at rest may sleep, and boot when it wakes. While it is silent the charger watches the pack: a
pack whose volts are always there, and never jump, has not been exchanged. Behind an open contactor, or while the
charger is silent too, nobody watches; then only the same serial number proves the same battery.
"""

from orchestrator.core.checks.state_of_charge import OTHER_SERIAL
from orchestrator.core.facts import TERMINAL_V, Facts
from orchestrator.core.memory import BatteryHistory
from orchestrator.core.parts import changed
from orchestrator.model import Cause

#: Nobody exchanges a battery within this.
UNSEEN_S = 10.0
#: Volts that differ by this share are those of another pack: several times what one loses when its charge is cut off.
OTHER_V_SHARE = 0.05


def recognised(f: Facts, known: BatteryHistory) -> BatteryHistory:
    """Compare serial numbers. Another one is another battery; in mid-charge, that is an exchange."""
    serial, before = f.battery.serial, known.serial
    if serial is None or (serial or None) == before:
        return known
    if before is None:
        return changed(known, serial=serial)
    known = changed(known, another=True, serial=serial or None, full_pct=None)
    if not serial:  # it may just not have been told
        return known
    known = changed(known, full_s=None)
    if f.memory.session is None:
        return known
    return changed(known, exchange=(f.now_s, Cause.of(OTHER_SERIAL, before=before, serial=serial)))


def watched(f: Facts, known: BatteryHistory) -> BatteryHistory:
    """Follow the pack while its BMU is silent, and forget what is known of it once it may be another one."""
    before = f.memory.battery
    if known.another is not before.another:  # found in this decision
        return known
    if known.exchange is not before.exchange:
        return _forgotten(known)
    silent = not f.battery.online
    if silent and known.another:
        return known
    if (silent or known.boots != f.battery.boots) and _may_be_another(f, known):
        return _forgotten(known)
    sight = _sight(f, known) if silent else None
    return changed(known, another=False, sight=sight) if known.another or sight != known.sight else known


def _forgotten(known: BatteryHistory) -> BatteryHistory:
    """With a serial number, it will be known whether it is another."""
    full_pct = known.full_pct if known.serial is not None else None
    return changed(known, another=True, full_pct=full_pct, sight=None)


def _may_be_another(f: Facts, known: BatteryHistory) -> bool:
    """Whether somebody can have exchanged it since it was last seen."""
    if f.battery_removed:
        return True
    volts, booted = _seen_v(f), known.boots != f.battery.boots
    seen_s, seen_v = known.sight or (f.now_s, _reported_v(f))
    if f.now_s - seen_s > UNSEEN_S or (booted and volts is None):
        return True
    return volts is not None and seen_v is not None and abs(volts - seen_v) > OTHER_V_SHARE * seen_v


def _sight(f: Facts, known: BatteryHistory) -> tuple[float, float | None]:
    volts = _seen_v(f)
    return (f.now_s, volts) if volts is not None else known.sight or (f.now_s, _reported_v(f))


def _seen_v(f: Facts) -> float | None:
    """The pack's volts as the charger measures them; None where it sees no pack."""
    return f.volts if f.connected and f.volts is not None and f.volts >= TERMINAL_V else None


def _reported_v(f: Facts) -> float | None:
    """What its BMU has last reported, however long ago."""
    newest = f.snapshot.battery.voltage_v
    return newest.value if newest is not None else None
