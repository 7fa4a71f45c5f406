"""Hostile surroundings of an emulated bay: other programs at the port, devices that lie, a pack that is not meant.

They are faults of `faults.py`, where their sentences stand; `value` None means their usual strength.
"""

import termios
from functools import partial

from orchestrator.sim.charger_frames import Kind, Lie
from orchestrator.sim.rig import Rig


def line_taken_over(rig: Rig, value: float | None) -> None:
    """Another program sets the port's speed, one of `termios.B…`; 115200 baud."""
    rig.wire.set_speed(termios.B115200 if value is None else int(value))


def port_locked(rig: Rig, _: float | None) -> None:
    """Another program locks the port as soon as it is free."""
    rig.wire.lock()


def says_standby(rig: Rig, _: float | None) -> None:
    """The charger says that it stands by, whatever it does."""
    rig.wire.lies |= {Kind.OPERATION: 0, Kind.CURRENT: 0}


def says_standby_now_and_then(rig: Rig, value: float | None) -> None:
    """It says so in each `value`-th answer, the second."""
    every = 2 if value is None else int(value)
    rig.wire.liars |= {Kind.OPERATION: Lie(0, every), Kind.CURRENT: Lie(0, every)}


def limit_reverts(rig: Rig, value: float | None) -> None:
    """It takes each limit and goes back to its highest after `value` s, 0.25."""
    rig.bay.charger.reverts_s = 0.25 if value is None else value


def runs_again(rig: Rig, value: float | None) -> None:
    """It runs again by itself `value` s after each stop, 3."""
    rig.bay.charger.restless_s = 3.0 if value is None else value


def obeys_once(rig: Rig, _: float | None) -> None:
    """It obeys one more stop, and no later one."""
    rig.bay.charger.stops_left = 1


def stopped_elsewhere(rig: Rig, _: float | None) -> None:
    """Somebody else sends it to standby."""
    rig.bay.charger.rest(0)


def bmu_frozen(rig: Rig, _: float | None) -> None:
    """The BMU goes on saying all values of now."""
    frozen = rig.bay.readout()
    rig.bay.falsify |= {name: partial(_always, getattr(frozen, name)) for name in frozen.__slots__}


def pack_collapsed(rig: Rig, value: float | None) -> None:
    """The pack's voltage falls to `value` V, 31, at once."""
    pack = rig.bay.pack
    pack.bias_v += (31.0 if value is None else value) - pack.ocv_v


def another_pack(rig: Rig, value: float | None) -> None:
    """The pack has `value` cells in series, 10, and a BMU like the other's."""
    rig.bay.pack.cells = 10 if value is None else int(value)


def _always(value: float, _true: float) -> float:
    return value
