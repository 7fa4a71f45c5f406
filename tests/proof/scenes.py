"""Past failures as scripts: each is played first, and each is a hole that a bug may reopen.

A scene is small: one or two events at a charging or stopped station, which is followed for long enough to see the
result, over further lives where the past matters.
"""

import termios

from tests.proof.hazards import BEGIN_S, FOR_EVER, TOOLS, Bay, Hazard, Script
from tests.proof.variants import VARIANTS

THREE = (Bay(), Bay(), Bay())
#: In mid-charge.
T = BEGIN_S


def _scene(
    *hazards: Hazard,
    bays: tuple[Bay, ...] = THREE,
    end_s: float = 0.0,
    systemd: bool = True,
    recorded: bool = False,
) -> Script:
    hazards = (Hazard(0.0, "boot"), *hazards)
    return Script(1, bays, hazards, end_s or max(one.t_s for one in hazards) + 12.0, systemd, recorded=recorded)


def h(t_s: float, what: str, bay: int = -1, value: float | None = None, detail: str = "") -> Hazard:
    return Hazard(T + t_s, what, bay, value, detail)


def _unheard(killed_s: float) -> Script:
    """A running charger and its BMU fall silent, and the whole service is killed and started again."""
    silent = (h(0, "fault", 0, None, "charger_cut_off"), h(0, "fault", 0, None, "bmu_silent"))
    return _scene(*silent, h(killed_s, "kill both"), h(killed_s + 1, "boot"), end_s=T + 24)


SCENES: dict[str, Script] = {
    "nothing happens": _scene(end_s=T + 8),
    # 1. The line is not ours alone.
    "another speed": _scene(h(0, "settings", 0, float(termios.B115200)), h(4, "ask", 0, None, "stop")),
    "a getty": _scene(h(0, "getty", 1, float(termios.B9600))),
    "another speed, then killed": _scene(h(0, "settings", 0, float(termios.B115200)), h(0.1, "kill")),
    "another speed, then ended": _scene(h(0, "settings", 2, float(termios.B38400)), h(0.1, "term")),
    "locked by a stranger": _scene(Hazard(0.0, "lock", 0), bays=(Bay(running=True), Bay(), Bay()), end_s=16.0),
    "answers stolen": _scene(h(0, "steal", 1)),
    # 2. What must survive is not on disk.
    "fsync hangs, begun, killed": _scene(
        Hazard(1.0, "slow", -1, FOR_EVER, "fsync:disk:60"), h(4, "kill both"), h(8, "boot"), systemd=False, end_s=50.0
    ),
    "standard error stands still": _scene(
        Hazard(1.0, "stderr", value=1),
        h(4, "kill both"),
        h(8, "stderr", value=0),
        h(8, "boot"),
        systemd=False,
        end_s=50.0,
    ),
    "standard error is not read": _scene(Hazard(1.0, "stderr", value=1), end_s=34.0),
    "disk full": _scene(
        Hazard(1.0, "slow", -1, 0.0, "write:disk:22:ENOSPC"), h(4, "kill both"), h(8, "boot"), systemd=False, end_s=50.0
    ),
    "the lock cannot be closed": _scene(h(0, "slow", -1, 0.0, "close:disklock:60:EIO"), h(0.5, "term"), end_s=T + 6),
    "stopped, then no power": _scene(
        h(0, "ask", 1, None, "stop"), h(3, "power", detail="nothing more"), h(5, "boot"), end_s=T + 20
    ),
    "stopped at rest, then no power at once": _scene(
        Hazard(3.5, "slow", -1, 5.0, "fsync:disk:60"),
        Hazard(4.0, "ask", 2, None, "stop"),
        Hazard(5.5, "power", detail="nothing more"),
        Hazard(7.0, "boot"),
        end_s=40.0,
    ),
    "tripped at rest, then no power": _scene(
        Hazard(1.0, "fault", 2, None, "status_bits"),
        Hazard(8.0, "power", detail="nothing more"),
        Hazard(9.0, "heal", 2),
        Hazard(10.0, "boot"),
        bays=(Bay(soc_pct=99.0), Bay(soc_pct=99.0), Bay()),
        end_s=45.0,
    ),
    "charging, then no power": _scene(h(0, "power", detail="nothing more"), h(3, "boot"), end_s=T + 20),
    "charging, then the disk is torn": _scene(h(0, "power", detail="some of it, torn"), h(3, "boot"), end_s=T + 20),
    "tripped, taken out, put back": _scene(
        h(0, "fault", 0, None, "status_bits"),
        h(5, "term"),
        h(7, "edit", 0, None, "remove"),
        h(7.2, "boot"),
        h(14, "term"),
        h(16, "edit", 0, None, "restore"),
        h(16.1, "heal", 0),
        h(16.2, "boot"),
        end_s=T + 34,
    ),
    "stopped, then renamed": _scene(
        h(0, "ask", 0, None, "stop"), h(4, "term"), h(6, "edit", 0, None, "rename"), h(6.2, "boot"), end_s=T + 22
    ),
    "file edited, then both killed": _scene(h(0, "edit", 1, None, "remove"), h(1, "kill both"), end_s=T + 10),
    # 3. Two reasons in one field.
    "stopped while it ends": _scene(h(0, "term"), h(0.2, "ask", 0, None, "stop"), h(4, "boot"), end_s=T + 20),
    "restarted in order": _scene(h(0, "term"), h(5, "boot"), end_s=T + 5 + 2 * BEGIN_S + 2),
    # 4. Verified by one witness, in one sample.
    "says standby": _scene(
        h(0, "fault", 0, None, "says_standby"), h(0, "fault", 0, None, "ignore_stop"), h(1, "ask", 0, None, "stop")
    ),
    "says standby now and then": _scene(
        h(0, "fault", 1, None, "says_standby_now_and_then"),
        h(0, "fault", 1, None, "ignore_stop"),
        h(1, "ask", 1, None, "stop"),
        end_s=T + 16,
    ),
    "says standby now and then, ended": _scene(
        h(0, "fault", 1, None, "says_standby_now_and_then"), h(0, "fault", 1, None, "ignore_stop"), h(1, "term")
    ),
    "runs again": _scene(h(0, "fault", 2, None, "runs_again"), h(1, "ask", 2, None, "stop"), end_s=T + 24),
    "stopped by other means": _scene(
        h(0, "fault", 0, None, "stopped_elsewhere"), bays=(Bay(soc_pct=82.0), Bay(), Bay()), end_s=T + 20
    ),
    "crossed cables": _scene(bays=(Bay(cross=1), Bay(cross=0), Bay()), end_s=40.0),
    "crossed cables, hot": _scene(
        h(0, "fault", 0, 60.0, "over_temperature"), bays=(Bay(cross=1), Bay(cross=0), Bay()), end_s=T + 14
    ),
    "obeys once": _scene(
        h(0, "fault", 0, None, "obeys_once"),
        h(1, "ask", 0, None, "stop"),
        h(4, "ask", 0, None, "start"),
        h(14, "ask", 0, None, "stop"),
        end_s=T + 26,
    ),
    # 5. One port delays another.
    "frozen": _scene(h(0, "freeze")),
    "half dead adapter, killed": _scene(
        h(0, "slow", 0, 5.0, "open:port:60"), h(0.1, "fault", 0, None, "port_gone"), h(0.5, "heal", 0), h(1.5, "kill")
    ),
    "half dead adapter, estop": _scene(
        h(0, "slow", 0, 5.0, "open:port:60"), h(1, "kill both"), h(1.3, "estop"), systemd=False
    ),
    "a port that closes never": _scene(h(0, "slow", 0, FOR_EVER, "close:port:60"), h(0.5, "kill")),
    "a port that closes slowly": _scene(
        h(0, "slow", 0, 5.0, "close:port:60"), h(0.5, "fault", 0, None, "port_gone"), h(1.5, "heal", 0), end_s=T + 16
    ),
    "a port whose closing fails": _scene(
        h(0, "slow", 0, 0.0, "close:port:60:EIO"), h(0.1, "fault", 0, None, "port_gone"), h(1, "heal", 0), h(3, "kill")
    ),
    "settings take for ever": _scene(h(0, "slow", 0, FOR_EVER, "tcsetattr:port:60"), h(0.5, "kill")),
    # 6. Limits that a restart forgets.
    "ampere-hours over restarts": _scene(
        *(one for t_s in (17.0, 37.0, 57.0, 77.0) for one in (Hazard(t_s, "term"), Hazard(t_s + 5, "boot"))),
        bays=(Bay(small=True), Bay(), Bay()),
        end_s=100.0,
    ),
    "ampere-hours over silences": _scene(
        Hazard(30.0, "fault", 0, None, "bmu_silent"),
        Hazard(34.0, "heal", 0),
        bays=(Bay(small=True), Bay(), Bay()),
        end_s=130.0,
    ),
    "precharge over restarts": _scene(
        Hazard(1.0, "fault", 0, None, "precharge_no_rise"),
        *(one for t_s in (17.0, 37.0, 57.0, 77.0) for one in (Hazard(t_s, "term"), Hazard(t_s + 5, "boot"))),
        bays=(Bay(small=True, soc_pct=-100.0), Bay(), Bay()),
        end_s=100.0,
    ),
    # 7. Conditions that come and go.
    "limit goes back": _scene(
        h(0, "fault", 0, None, "limit_reverts"), bays=(Bay(temperature_c=8.0), Bay(), Bay()), end_s=T + 26
    ),
    "apart for most of the time": _scene(h(0, "comes", 0, 2.0, "voltage_v"), end_s=T + 30),
    "loose plug": _scene(h(0, "loose", 0, 6.0), end_s=T + 90),
    # 8. The wrong battery.
    "a pack of 36 V": _scene(bays=(Bay(cells=10, soc_pct=90.0), Bay(), Bay()), end_s=40.0),
    "a pack of 24 V": _scene(bays=(Bay(cells=7), Bay(), Bay()), end_s=30.0),
    "hot": _scene(h(0, "fault", 0, None, "over_temperature")),
    "a pack that collapses": _scene(h(0, "fault", 1, None, "pack_collapsed")),
    "a BMU that is frozen": _scene(
        h(0, "fault", 1, None, "bmu_frozen"), bays=(Bay(), Bay(soc_pct=80.0), Bay()), end_s=T + 400
    ),
    "ports swapped in the file": _scene(h(0, "term"), h(4, "edit", 0, None, "swap"), h(4.2, "boot"), end_s=T + 36),
    # 9. Our own exceptions.
    "a BMU that reads 0.00 V": _scene(
        h(0, "bmu", 0, 0.0, "voltage_v:is:1"), h(0, "fault", 0, None, "ignore_stop"), end_s=T + 16
    ),
    # 10. The record of the accident.
    "a record over lives": _scene(
        h(0, "term"), h(4, "boot"), h(16, "kill both"), h(20, "boot"), end_s=T + 36, recorded=True
    ),
    "a torn record": _scene(
        h(0, "term"),
        h(4, "boot"),
        h(16, "kill both"),
        h(20, "boot"),
        h(26, "power", detail="some of it, torn"),
        h(30, "boot"),
        end_s=T + 36,
        recorded=True,
    ),
    # 11. The last words.
    "cut off, then killed": _scene(
        h(0, "fault", 0, None, "charger_cut_off"), h(8, "kill both"), h(9, "boot"), end_s=T + 24
    ),
    "cut off and not heard, then killed": _unheard(killed_s=8),
    "cut off and not heard, killed at once": _unheard(killed_s=1),
    # 12. Others on the bus.
    **{f"on the bus, {name}": _scene(h(0, "tool", 0, None, name), end_s=T + 14) for name in TOOLS},
    "a temperature that is forged": _scene(
        h(0, "bus", 1, None, "forged"), h(1, "fault", 1, 60.0, "over_temperature"), end_s=T + 16
    ),
    # Further attempts.
    **VARIANTS,
}
