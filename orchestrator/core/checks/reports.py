"""Faults that the charger itself reports."""

from orchestrator.core.facts import Facts
from orchestrator.model import Cause, ChargeMode, Connection, ErrorBit

#: An error frame is news for this long.
ERROR_FRAME_S = 5.0
#: If a larger share of the exchanges fails, the line is not in order, though it still works.
NOISY_PCT = 5.0
#: It does not know the command, or did not receive it well. (Constants, since joining flags takes long.)
NOT_KNOWN = ErrorBit.COMMAND | ErrorBit.ORDER
NOT_HEARD = ErrorBit.LENGTH | ErrorBit.CHECKSUM


def reverse_polarity(f: Facts) -> Cause | None:
    """FAULTS C1."""
    if f.reading is None:
        return None
    if f.reading.connection is Connection.REVERSED:
        return Cause("reverse_polarity")
    if f.reading.charge_mode is ChargeMode.REVERSED:
        return Cause("reverse_polarity_mode")
    return None


def polarity_contradicts(f: Facts) -> Cause | None:
    """FAULTS C2: stops as for a reversed battery; whether it is one, only a look at the bay can tell."""
    reading = f.reading
    if reading is None or reading.charge_mode is not ChargeMode.REVERSED or reading.connection is not Connection.NORMAL:
        return None
    return Cause("polarity_contradicts")


def error_stop(f: Facts) -> Cause | None:
    """FAULTS C3."""
    stopped = f.reading is not None and f.reading.charge_mode is ChargeMode.ERROR_STOP
    return Cause("error_stop") if stopped else None


def system_stop(f: Facts) -> Cause | None:
    """FAULTS C4."""
    stopped = f.reading is not None and f.reading.charge_mode is ChargeMode.SYSTEM_STOP
    return Cause("system_stop") if stopped else None


def illegal_value(f: Facts) -> Cause | None:
    """FAULTS C19."""
    return Cause.of("illegal_value", values=f.reading.illegal) if f.reading and f.reading.illegal else None


def mode_taken_over(f: Facts) -> Cause | None:
    """FAULTS C8."""
    configured = f.rules.bay.charger.control
    if f.reading is None or f.reading.control_mode in (None, configured):
        return None
    return Cause.of("mode_taken_over", shown=f.reading.control_mode.name.lower(), configured=configured.name.lower())


def rejected_frame(f: Facts) -> Cause | None:
    """FAULTS C22: received well but not known. Noise can change a command, too, but then the checksum is also wrong."""
    link = f.charger
    if link.error_t_s is None or f.now_s - link.error_t_s > ERROR_FRAME_S:
        return None
    if link.error_bits & NOT_HEARD or not link.error_bits & NOT_KNOWN:
        return None
    names = tuple(bit.name.lower() for bit in ErrorBit if bit & link.error_bits and bit.name)
    return Cause.of("rejected_frame", wrong=names)


def noisy_line(f: Facts) -> Cause | None:
    """FAULTS C21: what was not received well is repeated; only frequent failures are worth reporting."""
    bad_pct = f.charger.bad_pct
    if bad_pct <= NOISY_PCT:
        return None
    return Cause.of("noisy_line", bad_pct=bad_pct, limit_pct=NOISY_PCT)
