"""Hostile surroundings of an emulated bay: other programs on the port, lying devices, a wrong pack.

They are faults of `faults.py`, which has their descriptions; `value` None means the default strength.
"""

import termios
from functools import partial
from typing import TYPE_CHECKING

from orchestrator.sim.charger_frames import Kind, Lie

if TYPE_CHECKING:
    from orchestrator.sim.rig import Rig  # it needs durand, and the names of faults do not


def line_taken_over(rig: "Rig", value: float | None) -> None:
    """Another program changes the port's speed to `value`, one of `termios.B…`; default 115200 baud."""
    rig.wire.set_speed(termios.B115200 if value is None else int(value))


def port_locked(rig: "Rig", _: float | None) -> None:
    """Another program locks the port if it is free."""
    rig.wire.lock()


def says_standby(rig: "Rig", _: float | None) -> None:
    """The charger reports standby, whatever it does."""
    rig.wire.lies |= {Kind.OPERATION: 0, Kind.CURRENT: 0}


def says_standby_now_and_then(rig: "Rig", value: float | None) -> None:
    """The charger falsely reports standby in every `value`-th answer; default every second."""
    every = 2 if value is None else int(value)
    rig.wire.liars |= {Kind.OPERATION: Lie(0, every), Kind.CURRENT: Lie(0, every)}


def limit_reverts(rig: "Rig", value: float | None) -> None:
    """The charger accepts each limit and reverts to its highest after `value` s; default 0.25."""
    rig.bay.charger.reverts_s = 0.25 if value is None else value


def runs_again(rig: "Rig", value: float | None) -> None:
    """The charger runs again by itself `value` s after each stop; default 3."""
    rig.bay.charger.restless_s = 3.0 if value is None else value


def obeys_once(rig: "Rig", _: float | None) -> None:
    """The charger obeys one more stop, and none after that."""
    rig.bay.charger.stops_left = 1


def stopped_elsewhere(rig: "Rig", _: float | None) -> None:
    """Somebody else puts the charger into standby."""
    rig.bay.charger.rest(0)


def bmu_frozen(rig: "Rig", _: float | None) -> None:
    """The BMU keeps reporting its present values."""
    frozen = rig.bay.readout()
    rig.bay.falsify |= {name: partial(_always, getattr(frozen, name)) for name in frozen.__slots__}


def pack_collapsed(rig: "Rig", value: float | None) -> None:
    """The pack's voltage drops to `value` V at once; default 31."""
    pack = rig.bay.pack
    pack.bias_v += (31.0 if value is None else value) - pack.ocv_v


def another_pack(rig: "Rig", value: float | None) -> None:
    """The pack has `value` cells in series (default 10), and the same kind of BMU."""
    rig.bay.pack.cells = 10 if value is None else int(value)


def _always(value: float, _true: float) -> float:
    return value
