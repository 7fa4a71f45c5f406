"""Variants of past failures: the next things to try, by the kinds of `scenes.py`, as tables.

Each is played by `make campaign ARGS=environment` before the random scripts.
"""

import termios

from tests.proof.hazards import BEGIN_S, FOR_EVER, Bay, Hazard, Script

THREE = (Bay(), Bay(), Bay())
#: In mid-charge.
T = BEGIN_S
AUTOMATIC, CUT = Bay(control="automatic"), Bay(contactor=True)
MIXED = (AUTOMATIC, CUT, Bay())
RESTS = (Bay(soc_pct=99.0), Bay(), Bay())
OTHERS = (
    "EMCY without error", "extended", "remote", "SYNC", "LSS", "other nodes", "reads in segments", "reads in blocks",
)  # fmt: skip
STTY = (
    "parenb", "parodd", "cstopb", "cs7", "crtscts", "-cread", "ixon", "istrip", "opost", "icanon", "min", "time",
    "suspended",
)  # fmt: skip
FIELDS = ("voltage_v", "current_a", "soc_pct", "soh_pct", "temperature_c", "remaining_ah", "time_to_full_min")


def scene(
    *hazards: Hazard, bays: tuple[Bay, ...] = THREE, end_s: float = 0.0, systemd: bool = True, recorded: bool = False
) -> Script:
    """A started station, the given events, and 12 s more."""
    hazards = (Hazard(0.0, "boot"), *sorted(hazards, key=lambda one: one.t_s))
    return Script(1, bays, hazards, end_s or hazards[-1].t_s + 12.0, systemd, recorded=recorded)


def h(t_s: float, what: str, bay: int = -1, value: float | None = None, detail: str = "") -> Hazard:
    """An event in mid-charge."""
    return Hazard(T + t_s, what, bay, value, detail)


STOP, TERM, BOOT = h(1, "ask", 0, None, "stop"), h(0, "term"), h(5, "boot")

#: 1. The line is not ours alone.
LINE = {
    **{f"stty {word}, stopped": scene(h(0, "stty", 0, None, word), STOP) for word in STTY},
    **{f"stty {word}, killed": scene(h(0, "stty", 0, None, word), h(0.1, "kill")) for word in ("min", "suspended")},
    "another speed twice": scene(
        h(0, "settings", 0, float(termios.B38400)),
        h(0.4, "settings", 0, float(termios.B115200)),
        h(0.7, "settings", 0, float(termios.B9600)),
        STOP,
    ),
    "another speed, every port": scene(h(0, "settings", -1, float(termios.B115200)), h(0.1, "kill both")),
    "another speed at rest": scene(Hazard(6.0, "settings", 0, float(termios.B115200)), bays=RESTS, end_s=T + 8),
    "another program runs it at rest": scene(Hazard(8.0, "program", 0, None, "run:1.0:1"), bays=RESTS, end_s=T + 12),
    "another program runs it again and again": scene(
        Hazard(8.0, "program", 0, None, "run:1.0:30"), bays=RESTS, end_s=T + 30
    ),
    "another program runs what was stopped": scene(
        STOP, h(4, "program", 0, None, "run:1.0:1"), h(9, "kill both"), h(11, "boot"), end_s=T + 30
    ),
    "another program runs what has tripped": scene(
        h(0, "fault", 0, None, "status_bits"), h(5, "program", 0, None, "run:1.5:4"), end_s=T + 24
    ),
    "another program runs it while it stops": scene(STOP, h(1.1, "program", 0, None, "run:0.3:3"), end_s=T + 16),
    "another program, then the service ends": scene(
        TERM, h(0.3, "program", 0, None, "run:0.2:4"), h(6, "boot"), end_s=T + 30
    ),
    "another program, then killed": scene(h(0, "program", 0, None, "limit 4:0.1:50"), h(1, "kill")),
    "another program stops it": scene(h(0, "program", 0, None, "stop:1.0:1"), end_s=T + 20),
    "another program rests it": scene(h(0, "program", 0, None, "rest:1.0:1"), end_s=T + 20),
    "another program sets full": scene(h(0, "program", 0, None, "full:1.0:1"), end_s=T + 20),
    "another program sets precharge": scene(h(0, "program", 0, None, "precharge:1.0:1"), end_s=T + 20),
    "another program sets a pulse": scene(h(0, "program", 0, None, "pulse:1.0:1"), end_s=T + 20),
    "another program sets the highest step": scene(
        h(0, "program", 0, None, "limit 4:1.0:20"), bays=(Bay(temperature_c=8.0), Bay(), Bay()), end_s=T + 26
    ),
    "another program sets the lowest step": scene(h(0, "program", 0, None, "limit 0:1.0:1"), end_s=T + 20),
    "another program charges a deep pack": scene(
        h(-6, "program", 0, None, "charge+limit 4:1.0:5"), bays=(Bay(soc_pct=-100.0), Bay(), Bay()), end_s=T + 20
    ),
    "another program asks": scene(h(0, "program", 0, None, "poll:0.07:60"), STOP),
    "another program asks at rest": scene(Hazard(6.0, "program", 0, None, "poll:0.07:60"), end_s=T + 20),
    "locked, unlocked, locked": scene(
        Hazard(0.0, "lock", 0), Hazard(6.0, "unlock", 0), Hazard(9.0, "lock", 0), end_s=T + 12
    ),
}

#: 2. What must survive is not on disk.
DISK = {
    "fsync of the directory hangs": scene(
        Hazard(1.0, "slow", -1, FOR_EVER, "fsync:directory:60"), h(4, "kill both"), h(8, "boot"), end_s=50.0
    ),
    "fsync of the directory fails": scene(
        Hazard(1.0, "slow", -1, 0.0, "fsync:directory:60:EIO"), h(4, "kill both"), h(8, "boot"), end_s=50.0
    ),
    "no space for the name": scene(
        Hazard(1.0, "slow", -1, 0.0, "rename:disk:22:ENOSPC"), h(4, "kill both"), h(8, "boot"), end_s=50.0
    ),
    "read only in mid-charge": scene(
        h(0, "slow", -1, 0.0, "open:disk:60:EROFS"), STOP, h(6, "kill both"), h(8, "boot"), end_s=T + 30
    ),
    "not ours to open": scene(
        STOP, h(5, "term"), h(8, "slow", -1, 0.0, "open:diskpersisted:60:EACCES"), h(9, "boot"), end_s=T + 30
    ),
    "standard error is gone": scene(h(0, "slow", -1, 0.0, "write:stderr:60:EPIPE"), STOP, h(4, "term"), end_s=T + 8),
    **{
        f"what survives is {how}": scene(
            h(0, "kill both"), h(4, "kept", -1, None, how), h(5, "boot"), end_s=T + 24, systemd=False
        )
        for how in ("empty", "truncated", "zeros", "another", "directory")
    },
    "reset, then no power": scene(
        h(0, "fault", 0, None, "status_bits"),
        h(4, "heal", 0),
        h(6, "ask", 0, None, "reset"),
        h(6.3, "power", detail="nothing more"),
        h(8, "boot"),
        end_s=T + 30,
    ),
    "reset, started, then no power": scene(
        h(0, "fault", 0, None, "status_bits"),
        h(4, "heal", 0),
        h(6, "ask", 0, None, "reset"),
        h(7, "ask", 0, None, "start"),
        h(8.5, "power", detail="nothing more"),
        h(10, "boot"),
        end_s=T + 32,
    ),
    "another has its old name": scene(
        STOP, h(4, "term"), h(6, "edit", 0, None, "inherit"), h(6.2, "boot"), end_s=T + 26
    ),
    "every name is another's": scene(
        STOP, h(4, "term"), h(6, "edit", 0, None, "rewire"), h(6.2, "boot"), end_s=T + 26
    ),
    "swapped, killed, swapped back": scene(
        h(0, "edit", 0, None, "swap"), h(1, "kill both"), h(4, "boot"), h(9, "kill both"),
        h(10, "edit", 0, None, "restore"), h(11, "boot"), end_s=T + 30,
    ),
}  # fmt: skip

#: 3. Two reasons in one field.
REASONS = {
    "told to end twice": scene(TERM, h(0.1, "term"), h(5, "boot"), end_s=T + 5 + 2 * T + 2),
    "told to end while it starts": scene(Hazard(0.6, "term"), Hazard(6.0, "boot"), end_s=6.0 + 2 * T + 2),
    "paused while it ends": scene(TERM, h(0.2, "ask", 0, None, "pause"), h(4, "boot"), end_s=T + 20),
    "stopped, then ended, then killed": scene(STOP, h(1.1, "term"), h(1.3, "kill both"), h(5, "boot"), end_s=T + 22),
    "stopped and started at once": scene(STOP, h(1.05, "ask", 0, None, "start"), h(1.1, "ask", 0, None, "stop")),
}

#: 4. Verified by one witness, in one sample.
WITNESSES = {
    "says no current": scene(
        h(0, "lie", 0, 0.0, "CURRENT:1"), h(0, "fault", 0, None, "ignore_stop"), STOP, end_s=T + 16
    ),
    "says operation 0": scene(
        h(0, "lie", 0, 0.0, "OPERATION:1"), h(0, "fault", 0, None, "ignore_stop"), STOP, end_s=T + 16
    ),
    "says standby two times in three": scene(
        h(0, "fault", 0, 3.0, "says_standby_now_and_then"), h(0, "fault", 0, None, "ignore_stop"), STOP, end_s=T + 16
    ),
    "the BMU says no current": scene(
        h(0, "bmu", 0, 0.0, "current_a:is:1"), h(0, "fault", 0, None, "ignore_stop"), STOP, end_s=T + 16
    ),
    "the BMU says 3 A more": scene(h(0, "bmu", 0, 3.0, "current_a:more:1"), h(8, "ask", 0, None, "stop"), end_s=T + 24),
    "the BMU says 3 A more, stopped": scene(h(0.9, "bmu", 0, 3.0, "current_a:more:1"), STOP, end_s=T + 24),
    "the BMU says 3 A more, ended": scene(h(0, "bmu", 0, 3.0, "current_a:more:1"), h(0.1, "term"), end_s=T + 12),
    "the BMU says 3 A more at rest": scene(Hazard(8.0, "bmu", 0, 3.0, "current_a:more:1"), bays=RESTS, end_s=T + 14),
    "the BMU's current is frozen": scene(h(0.9, "bmu", 0, 0.0, "current_a:frozen:1"), STOP, end_s=T + 16),
    "the BMU is frozen, stopped": scene(h(0.9, "fault", 0, None, "bmu_frozen"), STOP, end_s=T + 24),
    "runs again after 8 s": scene(h(0, "fault", 0, 8.0, "runs_again"), STOP, end_s=T + 40),
    **{f"answers late, in {pieces}": scene(h(-12, "late", 0, float(pieces)), STOP, end_s=T + 14) for pieces in (1, 4)},
    "answers late, all of them": scene(Hazard(0.0, "late", -1, 3.0), end_s=T + 20),
    "answers late, killed": scene(Hazard(0.0, "late", -1, 3.0), h(0, "kill")),
    "answers late, ended": scene(Hazard(0.0, "late", -1, 2.0), TERM),
    "answers late, does not obey": scene(
        Hazard(0.0, "late", 0, 2.0), h(0, "fault", 0, None, "ignore_stop"), STOP, end_s=T + 16
    ),
    "answers late, hot": scene(Hazard(0.0, "late", 0, 2.0), h(0, "fault", 0, None, "over_temperature")),
}

#: 5. One port delays another.
PORTS = {
    **{
        f"{call} takes for ever, killed": scene(h(0, "slow", 0, FOR_EVER, f"{call}:port:60"), h(0.5, "kill"))
        for call in ("read", "write", "ioctl", "tcflush", "flock", "tcgetattr")
    },
    "two ports are half dead": scene(
        h(0, "slow", 0, 5.0, "open:port:60"), h(0, "slow", 1, 5.0, "open:port:60"), h(1, "kill both"), h(1.3, "estop"),
        systemd=False,
    ),
    "frozen with a half dead port": scene(h(0, "slow", 1, 5.0, "open:port:60"), h(0.5, "freeze")),
    "estop beside the service": scene(h(0, "estop"), end_s=T + 12),
    "estop twice": scene(h(0, "kill both"), h(0.2, "estop"), h(0.3, "estop"), systemd=False),
}  # fmt: skip

#: 6. Limits that a restart forgets.
LIMITS = {
    "ampere-hours over kills": scene(
        *(one for t_s in (17.0, 37.0, 57.0) for one in (Hazard(t_s, "kill both"), Hazard(t_s + 5, "boot"))),
        *(Hazard(t_s, "ask", 0, None, "start") for t_s in (25.0, 45.0, 65.0)),
        bays=(Bay(small=True), Bay(), Bay()),
        end_s=90.0,
    ),
    "ampere-hours, the clock a day back": scene(
        *(
            one
            for t_s in (17.0, 37.0, 57.0)
            for one in (Hazard(t_s, "term"), Hazard(t_s + 3, "clock", value=-86400.0), Hazard(t_s + 5, "boot"))
        ),
        bays=(Bay(small=True), Bay(), Bay()),
        end_s=90.0,
    ),
    "the clock a day back, no power": scene(
        STOP, h(5, "power", detail="everything"), h(6, "clock", value=-86400.0), h(7, "boot"), end_s=T + 26
    ),
    "the clock a day ahead": scene(TERM, h(3, "clock", value=86400.0), BOOT, end_s=T + 5 + 2 * T + 2),
    "the clock is set in mid-charge": scene(h(0, "clock", value=-86400.0), h(3, "clock", value=90000.0), end_s=T + 14),
}

#: 7. Conditions that come and go.
COME_AND_GO = {
    "limit goes back after 2 s": scene(
        h(0, "fault", 0, 2.0, "limit_reverts"), bays=(Bay(temperature_c=8.0), Bay(), Bay()), end_s=T + 30
    ),
    "amperes apart for most of the time": scene(h(0, "comes", 0, 3.0, "current_a"), end_s=T + 30),
    "loose plug, quick": scene(h(0, "loose", 0, 2.0), end_s=T + 60),
    "SOC 0 and 100 in turns": scene(h(0, "bmu", 0, 100.0, "soc_pct:turns:2"), STOP, end_s=T + 16),
    "hot, and every second value is the one before": scene(
        h(0, "bmu", 0, 0.0, "temperature_c:previous:2"), h(0.1, "fault", 0, 60.0, "over_temperature")
    ),
    "every third current is the one before": scene(h(0, "bmu", 0, 0.0, "current_a:previous:3"), STOP, end_s=T + 16),
}

#: 8. The wrong battery.
BATTERIES = {
    "a pack of 14 cells": scene(bays=(Bay(cells=14, soc_pct=90.0), Bay(), Bay()), end_s=40.0),
    "node ids swapped in the file": scene(h(0, "term"), h(4, "edit", 0, None, "nodes"), h(4.2, "boot"), end_s=T + 36),
    "another pack in mid-charge": scene(h(0, "fault", 0, None, "another_pack"), end_s=T + 14),
    "crossed cables of an automatic one": scene(
        bays=(Bay(cross=1, control="automatic"), Bay(cross=0, control="automatic"), Bay()), end_s=40.0
    ),
}

#: 9. Our own exceptions; anything a BMU may send.
VALUES = {
    **{
        f"a BMU whose {name} reads {value:g}": scene(
            h(0, "bmu", 0, value, f"{name}:is:1"), h(0, "fault", 0, None, "ignore_stop"), STOP, end_s=T + 14
        )
        for name in FIELDS
        for value in (0.0, 655.35)
    },
    **{
        f"a charger whose {kind} reads {value}": scene(h(0, "lie", 0, float(value), f"{kind}:1"), STOP, end_s=T + 14)
        for kind, value in (
            ("VOLTAGE", 0), ("VOLTAGE", 65535), ("CURRENT", 65535), ("CONTROL_MODE", 2), ("OPERATION", 2),
            ("CURRENT_LIMIT", 5), ("CHARGE_MODE", 0), ("CHARGE_MODE", 9), ("PRECHARGE", 3), ("CONNECTION", 2),
        )
    },
}  # fmt: skip

#: 10. The record of the accident; 11. the last words.
RECORD = {
    "a record, and the clock goes back": scene(
        TERM, h(3, "clock", value=-86400.0), BOOT, h(18, "kill both"), end_s=T + 30, recorded=True
    ),
    "a record on a full disk": scene(
        h(0, "slow", -1, 0.0, "write:disk:3:ENOSPC"), h(6, "term"), h(10, "boot"), end_s=T + 24, recorded=True
    ),
    "cut off, ended": scene(h(0, "fault", 0, None, "charger_cut_off"), h(1, "term"), h(8, "boot"), end_s=T + 26),
    "does not obey, killed, started": scene(
        h(0, "fault", 0, None, "ignore_stop"), h(1, "kill both"), h(3, "boot"), end_s=T + 24
    ),
}

#: 12. Others on the bus.
BUS = {
    **{f"on the bus, {name}": scene(h(0, "tool", 0, None, name), end_s=T + 14) for name in OTHERS},
    **{
        f"in the BMU's name, {name}": scene(h(0, "bus", 0, None, name), STOP, end_s=T + 14)
        for name in ("odd answers", "stopped", "reset", "EMCY", "short EMCY")
    },
    "heartbeats of a silent BMU": scene(h(0, "bus", 0, None, "node"), h(0, "fault", 0, None, "bmu_silent")),
}

#: Bays on automatic: the charger follows its own program, and is only stopped and resumed.
ON_AUTOMATIC = {
    f"automatic, {name}": scene(*hazards, bays=MIXED, end_s=end_s)
    for name, hazards, end_s in (
        ("nothing happens", (), T + 14),
        ("stopped", (STOP,), 0),
        ("killed", (h(0, "kill"),), 0),
        ("both killed", (h(0, "kill both"), h(4, "boot")), T + 24),
        ("restarted", (TERM, BOOT), T + 5 + 2 * T + 2),
        ("frozen", (h(0, "freeze"),), 0),
        ("hot", (h(0, "fault", 0, None, "over_temperature"),), 0),
        ("does not obey", (h(0, "fault", 0, None, "ignore_stop"), STOP), T + 16),
        ("says standby", (h(0, "fault", 0, None, "says_standby"), h(0, "fault", 0, None, "ignore_stop"), STOP), T + 16),
        ("run by another program", (STOP, h(4, "program", 0, None, "resume:1.0:1")), T + 16),
        ("stopped by another program", (h(0, "program", 0, None, "rest:1.0:1"),), T + 20),
        ("no power", (h(0, "power", -1, None, "nothing more"), h(3, "boot")), T + 24),
        ("another speed", (h(0, "settings", 0, float(termios.B115200)), STOP), 0),
        ("BMU silent", (h(0, "fault", 0, None, "bmu_silent"),), 0),
        ("runs again", (h(0, "fault", 0, None, "runs_again"), STOP), T + 24),
        ("charger off and on", (h(0, "fault", 0, None, "charger_cut_off"), h(4, "heal", 0)), T + 24),
    )
}

#: Bays with a contactor.
CONTACTORS = {
    f"contactor, {name}": scene(*hazards, bays=(CUT, AUTOMATIC, CUT), end_s=end_s)
    for name, hazards, end_s in (
        ("nothing happens", (), T + 14),
        ("stopped", (STOP,), 0),
        ("ended", (TERM, BOOT), T + 5 + 2 * T + 2),
        ("killed", (h(0, "kill"),), 0),
        ("both killed", (h(0, "kill both"), h(4, "boot")), T + 24),
        ("frozen", (h(0, "freeze"),), 0),
        ("does not obey", (h(0, "fault", 0, None, "ignore_stop"), STOP), T + 16),
        ("does not obey, killed", (h(0, "fault", 0, None, "ignore_stop"), h(0.1, "kill")), T + 16),
        ("stuck, does not obey", (h(0, "contactor", 0, None, "stuck"), h(0, "fault", 0, None, "ignore_stop"), STOP), 0),
        ("slow", (Hazard(0.0, "contactor", -1, 1.0, "slow"),), T + 24),
        ("cannot be driven", (Hazard(0.0, "slow", -1, 0.0, "ioctl:chip:60:EIO"),), T + 14),
        ("cannot be driven in mid-charge", (h(0, "slow", -1, 0.0, "ioctl:chip:20:EIO"),), T + 44),
        ("fails once", (h(0, "slow", -1, 0.0, "ioctl:chip:0.3:EIO"),), T + 34),
        ("cannot be driven, does not obey",
         (h(0, "slow", -1, 0.0, "ioctl:chip:6:EIO"), h(0, "fault", 0, None, "ignore_stop"), STOP), T + 24),
        ("the chip is gone", (h(0, "chip", -1, None, "gone"), h(6, "chip", -1, None, "back")), T + 40),
        ("the chip is gone, killed", (h(0, "chip", -1, None, "gone"), h(0.1, "kill")), 0),
        ("the chip hangs", (h(0, "slow", -1, FOR_EVER, "ioctl:chip:60"),), T + 14),
        ("says standby", (h(0, "fault", 0, None, "says_standby"), h(0, "fault", 0, None, "ignore_stop"), STOP), T + 16),
        ("run by another program", (STOP, h(4, "program", 0, None, "run:1.0:1")), T + 16),
        ("no power", (h(0, "power", -1, None, "nothing more"), h(3, "boot")), T + 24),
        ("port gone", (h(0, "fault", 0, None, "port_gone"), h(4, "heal", 0)), T + 24),
    )
}  # fmt: skip

VARIANTS: dict[str, Script] = (
    LINE | DISK | REASONS | WITNESSES | PORTS | LIMITS | COME_AND_GO | BATTERIES | VALUES | RECORD | BUS
    | ON_AUTOMATIC | CONTACTORS
)  # fmt: skip
