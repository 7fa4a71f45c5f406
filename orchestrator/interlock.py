"""The last gate before the wire: a second, simpler check of every command, right before it becomes bytes.

It trusts no conclusion of the core. It knows the station's hard limits, the devices' recent readings (the grant) and
the commands that a charger takes, and refuses everything else. Only a stop needs no permission.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from orchestrator.config.station import ChargerConfig, Limits
from orchestrator.model import Action, Cause, Command, ControlMode, Snapshot

#: Five polls. A charger silent for longer may be doing anything.
CHARGER_MAX_AGE_S = 1.0
#: The longest that a silent BMU's last values may be used.
BATTERY_MAX_AGE_S = 1.5

#: The values permitted with each command, by control mode. Anything else is refused.
ALLOWED: Mapping[ControlMode, Mapping[Action, frozenset[int]]] = {
    ControlMode.MANUAL: {
        Action.RESUME: frozenset({0}),
        Action.SET_LIMIT: frozenset({0, 1, 2, 3, 4}),
        Action.SET_MODE: frozenset({3, 4, 5}),
        Action.SET_PRECHARGE: frozenset({0, 1, 2}),
        Action.RUN: frozenset({0}),
    },
    ControlMode.AUTOMATIC: {Action.RESUME: frozenset({0})},
}


@dataclass(frozen=True, slots=True)
class Grant:
    """Evidence that current may flow now: recent readings, and how long they may be relied on."""

    expires_s: float  #: when the first of these readings becomes too old
    voltage_v: float  #: the higher of charger and pack
    temperature_c: float  #: of the pack
    current_step: int | None  #: the current step that the charger last reported
    kept: bool = True  #: the disk records that this charger may be running, so a restart would know
    level: int | None = None  #: what the bay's supply grants: 0 none, 1 the lowest step …; None: it has no supply


def grant(snapshot: Snapshot, now_s: float) -> Grant | None:
    """The grant from a snapshot; None if a reading is missing, not a number, too old or from the future."""
    charger, volts, temperature = snapshot.charger, snapshot.battery.voltage_v, snapshot.battery.temperature_c
    if charger is None or volts is None or temperature is None:
        return None
    if not all(map(isfinite, (charger.voltage_v, volts.value, temperature.value))):
        return None
    lifetimes = (
        (charger.t_s, charger.t_s + CHARGER_MAX_AGE_S),
        (volts.t_s, volts.t_s + BATTERY_MAX_AGE_S),
        (temperature.t_s, temperature.t_s + BATTERY_MAX_AGE_S),
    )
    if not all(t_s <= now_s < end_s for t_s, end_s in lifetimes):
        return None
    expires_s = min(end_s for _, end_s in lifetimes)
    highest_v = max(charger.voltage_v, volts.value)
    kept, level = snapshot.running_persisted, snapshot.granted
    return Grant(expires_s, highest_v, temperature.value, charger.current_step, kept, level)


def permit(command: Command, grant: Grant | None, now_s: float, charger: ChargerConfig, limits: Limits) -> Cause | None:
    """Why the command must not go out now; None if it may. A stop always may.

    `limits` are the station file's hard limits; nothing here comes from a policy.
    """
    action, value = command.action, command.value
    if action is Action.STOP:
        return None
    if value not in ALLOWED[charger.control].get(action, ()):
        return Cause.of("no_command", command=action.value, value=value, control=charger.control.name.lower())
    if grant is None:
        return Cause.of("no_grant", command=action.value)
    if not grant.kept:
        return Cause.of("not_on_disk", command=action.value)
    if not now_s < grant.expires_s:
        return Cause.of("grant_old", command=action.value, age_s=now_s - grant.expires_s)
    if not grant.voltage_v <= limits.voltage_v:
        return _beyond("above_station_v", action, voltage_v=grant.voltage_v, limit_v=limits.voltage_v)
    if grant.temperature_c not in limits.temperature_c:
        low_c, high_c = limits.temperature_c.low, limits.temperature_c.high
        return _beyond("outside_station_c", action, pack_c=grant.temperature_c, low_c=low_c, high_c=high_c)
    step = {Action.SET_LIMIT: value, Action.RUN: grant.current_step}.get(action)
    if action in (Action.SET_LIMIT, Action.RUN) and (problem := _too_much(action, step, charger, limits)) is not None:
        return problem
    if grant.level is not None and (step or 0) >= grant.level:
        return Cause.of("above_supply", command=action.value, step=(step or 0) + 1, granted=grant.level)
    return None


def _beyond(id_: str, action: Action, **params: float) -> Cause:
    return Cause(id_, (("command", action.value), *params.items()))


def _too_much(action: Action, step: int | None, charger: ChargerConfig, limits: Limits) -> Cause | None:
    if step is None or not 0 <= step < len(charger.steps_a):
        return Cause.of("step_unknown", command=action.value, step=step)
    current_a = charger.steps_a[step]
    if not current_a <= limits.current_a:
        return _beyond("above_station_a", action, step=step + 1, step_a=current_a, limit_a=limits.current_a)
    return None
