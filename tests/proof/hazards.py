"""Hazards for a station and its gateway: scripts over several lives, from a seed or hand-written, as JSON.

The same script always plays the same way. `SCENES` are those that once went wrong; the random ones mix the same hazards
at random moments.
"""

import json
import termios
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from random import Random

#: Within this every bay has started its charge, one after another.
BEGIN_S = 16.0
#: Duration of a person's action between two lives.
BETWEEN_S = 3.0
FOR_EVER = -1.0
SPEEDS = (termios.B115200, termios.B9600, termios.B38400)


@dataclass(frozen=True, slots=True)
class Hazard:
    """An event: its kind, bay (−1: none or all), number and detail."""

    t_s: float
    what: str
    bay: int = -1
    value: float | None = None
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Bay:
    """The initial state of a bay."""

    soc_pct: float = 50.0
    temperature_c: float = 20.0
    line: str = "real"
    running: bool = False
    cells: int = 13
    small: bool = False  #: with a policy that ends a charge after 0.15 Ah, and a precharge without a rise after 24 s
    cross: int = -1  #: its serial cable is swapped with that bay's
    control: str = "manual"
    contactor: bool = False


@dataclass(frozen=True, slots=True)
class Script:
    """One run. `systemd`: `estop` and a restart after an exit with an error. `recorded`: with snapshots."""

    seed: int
    bays: tuple[Bay, ...]
    hazards: tuple[Hazard, ...]
    end_s: float
    systemd: bool = True
    tpdo: bool = False
    recorded: bool = False

    def to_json(self) -> str:
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> "Script":
        fields = json.loads(text)
        fields["bays"] = tuple(Bay(**bay) for bay in fields["bays"])
        fields["hazards"] = tuple(Hazard(**one) for one in fields["hazards"])
        return cls(**fields)

    @classmethod
    def of_seed(cls, seed: int) -> "Script":
        """A random script, reproducible from its seed."""
        return _random(seed)


# --- random ones ------------------------------------------------------------------------------------------------------

#: Permitted actions of others on the bus.
TOOLS = ("master", "reads all", "abort", "fd", "heartbeat", "flood")
Make = Callable[[Random, float, int], Iterator[Hazard]]

#: Calls that may hang: on a port, on the store and the journal, on standard error.
PORT_CALLS = ("open", "close", "read", "write", "tcsetattr", "tcgetattr", "tcflush", "flock", "ioctl")
DISK_CALLS = ("open", "write", "fsync", "rename", "close")
DISK_ERRORS = ("ENOSPC", "EROFS", "EIO")
FAULTS = (
    "says_standby", "says_standby_now_and_then", "limit_reverts", "runs_again", "obeys_once", "stopped_elsewhere",
    "bmu_frozen", "pack_collapsed", "another_pack", "ignore_stop", "over_temperature", "bmu_silent", "charger_silent",
    "charger_cut_off", "over_current", "over_voltage", "reverse_polarity", "status_bits", "volts_disagree",
    "amps_disagree", "rogue_run", "port_gone", "frozen_charger", "under_temperature", "battery_removed",
)  # fmt: skip
KINDS = {
    "VOLTAGE": (0, 2500, 4800, 6000, 65535), "CURRENT": (0, 200, 1400, 65535), "CONTROL_MODE": (0, 1, 2),
    "OPERATION": (0, 1, 2), "CURRENT_LIMIT": (0, 2, 4, 5), "CHARGE_MODE": (1, 3, 4, 5, 6, 7, 8, 9),
    "PRECHARGE": (0, 1, 2, 3), "CONNECTION": (0, 1, 2), "TEMPERATURE_1": (900,), "TEMPERATURE_2": (900,),
}  # fmt: skip
BMU_FIELDS = (
    "voltage_v", "current_a", "status", "time_to_full_min", "time_to_empty_min", "soc_pct", "soh_pct", "remaining_ah",
    "available_wh", "temperature_c",
)  # fmt: skip
BMU_VALUES = (0.0, 1.0, 10.0, 50.0, 100.0, 140.0, -5.0, 655.35)


def _slow_port(dice: Random, t_s: float, bay: int) -> Iterator[Hazard]:
    call = dice.choice(PORT_CALLS)
    yield Hazard(t_s, "slow", bay, dice.choice((5.0, 5.0, FOR_EVER)), f"{call}:port:{dice.choice((3, 10, 30))}")
    if call in ("open", "close", "tcsetattr", "flock"):  # needs a reopened port
        yield Hazard(t_s + 0.5, "fault", bay, None, "port_gone")
        yield Hazard(t_s + 1.5, "heal", bay)


def _slow_disk(dice: Random, t_s: float, _bay: int) -> Iterator[Hazard]:
    place = dice.choice(("", "kept", "persisted", "events", "journal"))
    value = dice.choice((1.0, 5.0, 5.0, FOR_EVER))
    yield Hazard(t_s, "slow", -1, value, f"{dice.choice(DISK_CALLS)}:disk{place}:{dice.choice((5, 20, 60))}")


def _bad_disk(dice: Random, t_s: float, _bay: int) -> Iterator[Hazard]:
    where = f"{dice.choice(DISK_CALLS)}:disk:{dice.choice((3, 20))}:{dice.choice(DISK_ERRORS)}"
    yield Hazard(t_s, "slow", -1, 0.0, where)


def _stderr(dice: Random, t_s: float, _bay: int) -> Iterator[Hazard]:
    yield Hazard(t_s, "stderr", value=1)
    if dice.random() < 0.5:
        yield Hazard(t_s + dice.choice((2, 8)), "stderr", value=0)


def _stranger(dice: Random, t_s: float, bay: int) -> Iterator[Hazard]:
    what = dice.choice(("settings", "settings", "getty", "lock", "steal", "write"))
    yield Hazard(t_s, what, bay, float(dice.choice(SPEEDS)))
    if what in ("lock", "steal") and dice.random() < 0.6:
        yield Hazard(t_s + dice.choice((1, 5, 20)), f"un{what}", bay)


def _fault(dice: Random, t_s: float, bay: int) -> Iterator[Hazard]:
    yield Hazard(t_s, "fault", bay, None, dice.choice(FAULTS))
    if dice.random() < 0.4:
        yield Hazard(t_s + dice.choice((0.3, 2.0, 6.0, 12.0)), "heal", bay)


def _charger_lies(dice: Random, t_s: float, bay: int) -> Iterator[Hazard]:
    kind = dice.choice(tuple(KINDS))
    yield Hazard(t_s, "lie", bay, float(dice.choice(KINDS[kind])), f"{kind}:{dice.choice((1, 1, 2, 3, 7, 0))}")


def _bmu_lies(dice: Random, t_s: float, bay: int) -> Iterator[Hazard]:
    how = dice.choice(("is", "is", "frozen", "more"))
    yield Hazard(
        t_s, "bmu", bay, dice.choice(BMU_VALUES), f"{dice.choice(BMU_FIELDS)}:{how}:{dice.choice((1, 1, 2, 5, 0))}"
    )


def _on_bus(dice: Random, t_s: float, bay: int) -> Iterator[Hazard]:
    what = dice.choice((*TOOLS, "forged", "node"))
    yield Hazard(t_s, "tool" if what in TOOLS else "bus", bay, None, what)


def _person(dice: Random, t_s: float, bay: int) -> Iterator[Hazard]:
    yield Hazard(t_s, "ask", bay, None, dice.choice(("stop", "stop", "pause", "start", "reset", "start")))


LATER: tuple[Make, ...] = (
    _slow_port, _slow_disk, _bad_disk, _stderr, _stranger, _stranger, _fault, _fault, _fault, _charger_lies, _bmu_lies,
    _on_bus, _person, _person, _person,
)  # fmt: skip
ENDS = ("term", "term", "kill", "kill", "kill both", "kill guardian", "power", "power", "freeze", "estop")
EDITS = ("", "", "", "remove", "restore", "rename", "rewire", "swap")


def _random(seed: int) -> Script:
    dice = Random(seed)
    bays = tuple(
        Bay(
            soc_pct=dice.choice((50.0, 50.0, 5.0, 89.0)),
            temperature_c=dice.choices((20.0, 43.5, 8.0), (6, 1, 1))[0],
            line=dice.choices(("real", "perfect", "echo", "bytewise"), (4, 4, 1, 1))[0],
            running=dice.random() < 0.05,
            cells=dice.choices((13, 10), (20, 1))[0],
        )
        for _ in range(3)
    )
    if dice.random() < 0.06:
        bays = (replace(bays[0], cross=1), replace(bays[1], cross=0), bays[2])
    hazards, t_s = [Hazard(0.0, "boot")], dice.choice((1.0, BEGIN_S, BEGIN_S, BEGIN_S))
    lives = dice.choices((1, 2, 3, 4), (3, 4, 2, 1))[0]
    for life in range(lives):
        for _ in range(dice.choices((0, 1, 2, 3), (1, 4, 3, 2))[0]):
            t_s += dice.choice((0.0, 0.05, 0.5, 1.0, 3.0)) * dice.uniform(0.2, 1.0)
            hazards += dice.choice(LATER)(dice, round(t_s, 3), dice.randrange(3))
        t_s += dice.choice((0.1, 0.7, 3.0, 7.0)) * dice.uniform(0.5, 1.0)
        if life == lives - 1:
            break
        hazards.append(Hazard(round(t_s, 3), dice.choice(ENDS)))
        t_s += BETWEEN_S * dice.uniform(0.3, 2.0)
        hazards += (
            [Hazard(round(t_s, 3), "edit", dice.randrange(3), None, edit)] if (edit := dice.choice(EDITS)) else []
        )
        hazards.append(Hazard(round(t_s + 0.2, 3), "boot"))
        t_s += dice.choice((2.0, 6.0, BEGIN_S)) * dice.uniform(0.7, 1.0)
    hazards.sort(key=lambda one: one.t_s)
    end_s = max(t_s, hazards[-1].t_s) + 14.0
    script = Script(seed, bays, tuple(hazards), round(end_s, 3), dice.random() < 0.7, dice.random() < 0.2)
    return _with_more(script, Random(f"more of {seed}"))


#: Frames of a foreign program, sent once or repeatedly, and failures of a contactor chip.
PROGRAM = ("run", "run", "operation", "resume", "stop", "rest", "limit 4", "limit 0", "charge", "precharge", "full")
STRANGE = ("parenb", "cstopb", "crtscts", "min", "icanon", "ixon")
CHIP = ("ioctl:chip:3:EIO", "ioctl:chip:30:EIO", "ioctl:chip:3:ENODEV")


def _with_more(script: Script, dice: Random) -> Script:
    """Other kinds of bays and their hazards, from a separate random generator, so the rest stays unchanged."""
    bays = tuple(
        replace(bay, control="automatic" if dice.random() < 0.15 else "manual", contactor=dice.random() < 0.15)
        if bay.cross < 0
        else bay
        for bay in script.bays
    )
    last_s, more = script.hazards[-1].t_s + 8.0, []
    if dice.random() < 0.3:
        times = dice.choice((1, 1, 5, 50))
        detail = f"{dice.choice(PROGRAM)}:{dice.choice((0.3, 1.0, 2.5))}:{times}"
        more.append(Hazard(round(dice.uniform(2.0, last_s), 3), "program", dice.randrange(3), None, detail))
    if dice.random() < 0.15:
        late = Hazard(round(dice.uniform(2.0, last_s), 3), "late", dice.randrange(3), float(dice.choice((1, 3, 9))))
        more.append(late)
    if dice.random() < 0.1:
        more.append(Hazard(round(dice.uniform(2.0, last_s), 3), "stty", dice.randrange(3), None, dice.choice(STRANGE)))
    if any(bay.contactor for bay in bays) and dice.random() < 0.3:
        more.append(Hazard(round(dice.uniform(2.0, last_s), 3), "slow", -1, 0.0, dice.choice(CHIP)))
    hazards = sorted((*script.hazards, *more), key=lambda one: one.t_s)
    return replace(script, bays=bays, hazards=tuple(hazards))


# --- made smaller -----------------------------------------------------------------------------------------------------


def smaller(script: Script) -> Iterator[Script]:
    """Simpler neighbours, the simplest first."""
    hazards = script.hazards
    for at in range(len(hazards)):
        if hazards[at].t_s:
            yield replace(script, hazards=hazards[:at] + hazards[at + 1 :])
    for at, bay in enumerate(script.bays):
        if bay != Bay() and bay.cross < 0:
            yield replace(script, bays=(*script.bays[:at], Bay(), *script.bays[at + 1 :]))
    if script.tpdo:
        yield replace(script, tpdo=False)
    last_s = max(one.t_s for one in hazards)
    for end_s in (last_s + 4, last_s + 8):
        if end_s < script.end_s - 1:
            yield replace(script, end_s=round(end_s, 1))
