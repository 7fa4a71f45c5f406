"""Faults that the charger itself reports."""

from orchestrator.core.facts import Facts
from orchestrator.model import ChargeMode, Connection, ErrorBit

#: An error frame is news for this long.
ERROR_FRAME_S = 5.0
#: A line on which more of the exchanges go wrong is not in order, though it still works.
NOISY_PCT = 5.0
#: It does not know what we say, or it did not hear it well. (Here, since joining flags takes long.)
NOT_KNOWN = ErrorBit.COMMAND | ErrorBit.ORDER
NOT_HEARD = ErrorBit.LENGTH | ErrorBit.CHECKSUM


def reverse_polarity(f: Facts) -> str | None:
    """FAULTS C1."""
    if f.reading is None:
        return None
    if f.reading.connection is Connection.REVERSED:
        return "the charger reports connection 0: the battery is connected the wrong way round"
    if f.reading.charge_mode is ChargeMode.REVERSED:
        return "the charger reports mode 6: the battery is connected the wrong way round"
    return None


def polarity_contradicts(f: Facts) -> str | None:
    """FAULTS C2: it stops as for a battery that is reversed; whether one is, only a look at the bay can say."""
    reading = f.reading
    if reading is None or reading.charge_mode is not ChargeMode.REVERSED or reading.connection is not Connection.NORMAL:
        return None
    return "the charger contradicts itself: mode 6 (battery reversed) with connection 1 (normal)"


def error_stop(f: Facts) -> str | None:
    """FAULTS C3."""
    stopped = f.reading is not None and f.reading.charge_mode is ChargeMode.ERROR_STOP
    return "the charger reports mode 8: stopped by an error of its own" if stopped else None


def system_stop(f: Facts) -> str | None:
    """FAULTS C4."""
    stopped = f.reading is not None and f.reading.charge_mode is ChargeMode.SYSTEM_STOP
    return "the charger reports mode 7: it stopped itself without being asked" if stopped else None


def illegal_value(f: Facts) -> str | None:
    """FAULTS C19."""
    return f"the charger reports {', '.join(f.reading.illegal)}" if f.reading and f.reading.illegal else None


def mode_taken_over(f: Facts) -> str | None:
    """FAULTS C8."""
    configured = f.rules.bay.charger.control
    if f.reading is None or f.reading.control_mode in (None, configured):
        return None
    return (
        f"the charger is in {f.reading.control_mode.name.lower()} mode, the station file says "
        f"{configured.name.lower()}: look at its rotary switch"
    )


def rejected_frame(f: Facts) -> str | None:
    """FAULTS C22: heard well and not known. Noise can change a command, too, but then the checksum is wrong as well."""
    link = f.charger
    if link.error_t_s is None or f.now_s - link.error_t_s > ERROR_FRAME_S:
        return None
    if link.error_bits & NOT_HEARD or not link.error_bits & NOT_KNOWN:
        return None
    names = " and ".join(bit.name.lower() for bit in ErrorBit if bit & link.error_bits and bit.name)
    return f"the charger answered with an error frame (0x1F): wrong {names} in what it received"


def noisy_line(f: Facts) -> str | None:
    """FAULTS C21: what was not heard well is asked or ordered again; only where that is usual is it worth a word."""
    bad_pct = f.charger.bad_pct
    if bad_pct <= NOISY_PCT:
        return None
    return f"{bad_pct:.0f} % of the last minute's exchanges with the charger went wrong, more than {NOISY_PCT:g} %"
