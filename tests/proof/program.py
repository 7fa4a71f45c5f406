"""Frames of another program for this charger on the same line, all valid (protocol 2/2, §3.3.1, §3.3.2, §3.3.4)."""

from orchestrator.model import ChargeMode, Precharge
from orchestrator.sim.charger import Push
from orchestrator.sim.charger_frames import ADDRESS, REST, SET, STATUS, frame


def _push(what: Push, value: int) -> bytes:
    return frame(SET, ADDRESS, bytes((what, value)))


FRAMES: dict[str, bytes] = {
    "resume": frame(REST, ADDRESS, b"\x01"),
    "rest": frame(REST, ADDRESS, b"\x00"),
    "operation": _push(Push.OPERATION, 1),
    "standby": _push(Push.OPERATION, 0),
    "poll": frame(STATUS, ADDRESS, b"\x1f\x1f"),
    "charge": _push(Push.CHARGE_MODE, ChargeMode.CHARGE),
    "precharge": _push(Push.CHARGE_MODE, ChargeMode.PRECHARGE),
    "full": _push(Push.CHARGE_MODE, ChargeMode.FULL),
    "pulse": _push(Push.PRECHARGE, Precharge.PULSE),
    "continuous": _push(Push.PRECHARGE, Precharge.CONTINUOUS),
    **{f"limit {step}": _push(Push.CURRENT_LIMIT, step) for step in range(5)},
}
#: As programs use them, with everything a charge needs.
FRAMES["run"] = FRAMES["charge"] + FRAMES["limit 4"] + FRAMES["resume"] + FRAMES["operation"]
FRAMES["stop"] = FRAMES["rest"] + FRAMES["standby"]


def frames(names: str) -> bytes:
    """ "limit 4+resume": these two in order."""
    return b"".join(FRAMES[name] for name in names.split("+"))
