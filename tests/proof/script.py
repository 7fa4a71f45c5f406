"""A fault script: the bays and what happens to them when. Made from a seed, written as JSON, and shrunk.

The same script always plays the same way, to the byte, so the script alone reproduces a failure.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from random import Random

from orchestrator.model import Request
from orchestrator.sim.faults import FAULTS
from orchestrator.sim.line import LINES

#: Faults of the station's lines, in addition to those of `sim.faults`.
LINE_FAULTS = ("port_stalled", "bus_down", "bus_lost")
#: A battery arrives with SOC `value`. It removes every fault, like `heal`.
ARRIVES = "arrives"
MENDS = ("heal", ARRIVES)
REQUESTS = tuple(str(request) for request in Request)
#: Kinds played by `hazards.py`, with its own invariants.
ENVIRONMENT = (
    "line_taken_over", "port_locked", "says_standby", "says_standby_now_and_then", "limit_reverts", "runs_again",
    "obeys_once", "stopped_elsewhere", "bmu_frozen", "pack_collapsed", "another_pack",
)  # fmt: skip
#: Everything that can happen to a bay; `heal` removes all faults.
INJECTIONS = (*(name for name in FAULTS if name not in ("heal", *ENVIRONMENT)), *LINE_FAULTS)
#: Other strengths of some faults than the usual one.
STRENGTHS: dict[str, tuple[float, ...]] = {
    "over_temperature": (46.0, 56.0, 70.0),
    "under_temperature": (-0.5, -20.0),
    "over_current": (1.2, 2.0),
    "over_voltage": (55.5, 60.0),
    "volts_disagree": (2.0, -10.0),
    "amps_disagree": (-3.0, 8.0),
    "stale_reading": (0.2, 0.35, 1.0, 3.0),
    "status_bits": (1.0, 4.0, 16.0, 8.0, 32.0),
    "temperature_jump": (-15.0, 40.0),
    "sdo_abort": (float(0x08000022), float(0x06090011)),
    "emergency": (float(0x1000), float(0x4210)),
    "illegal_value": (0.0, 255.0),
}
#: A charge begins within this, and a fault's effects show within that. Once all faults are gone, standby is
#: believed again within this, even for a charger that disobeyed.
BEGIN_S, SEE_S, END_S = 7.0, 9.0, 20.0


@dataclass(frozen=True, slots=True)
class BaySetup:
    """The initial state of a bay."""

    pack: str = "48v"
    soc_pct: float | None = None
    temperature_c: float = 20.0
    automatic: bool = False
    line: str = "real"
    running: bool = False  #: the last service died in mid-charge
    seed: int = 1  #: of the line's noise


@dataclass(frozen=True, slots=True)
class Happening:
    """An event at a bay: a fault, `heal`, or an operator's request."""

    t_s: float
    bay: int
    name: str
    value: float | None = None


@dataclass(frozen=True, slots=True)
class Script:
    """One run. `sweep_s` and `tpdo_s` are those of the station file; every fault is taken away at `heal_s`, if any."""

    seed: int
    bays: tuple[BaySetup, ...]
    happenings: tuple[Happening, ...]
    end_s: float
    heal_s: float | None
    sweep_s: float = 0.1
    tpdo_s: float | None = None
    limit_a: float = 15.0

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "Script":
        fields = json.loads(text)
        fields["bays"] = tuple(BaySetup(**bay) for bay in fields["bays"])
        fields["happenings"] = tuple(Happening(**one) for one in fields["happenings"])
        return cls(**fields)

    @classmethod
    def of_seed(cls, seed: int) -> "Script":
        """A random script, reproducible from its seed."""
        dice = Random(seed)
        bays = tuple(_bay(dice) for _ in range(dice.choices((1, 2, 3), (8, 2, 1))[0]))
        happenings = _happenings(dice, len(bays))
        last_s = happenings[-1].t_s + SEE_S
        heals = dice.random() < 0.8
        return cls(
            seed=seed,
            bays=bays,
            happenings=happenings,
            end_s=round(last_s + (END_S if heals else 0.0), 3),
            heal_s=round(last_s, 3) if heals else None,
            sweep_s=dice.choices((0.05, 0.1, 0.3), (1, 3, 3))[0],
            tpdo_s=dice.choice((None, None, None, 0.1)),
            limit_a=dice.choice((15.0, 15.0, 9.0)),
        )


def _bay(dice: Random) -> BaySetup:
    pack = dice.choices(("48v", "demo"), (5, 1))[0]
    return BaySetup(
        pack=pack,
        soc_pct=None if pack == "demo" else dice.choice((None, 5.0, 30.0, 89.5, 99.0)),
        temperature_c=dice.choices((20.0, 8.0, 43.5, -3.0), (6, 1, 1, 1))[0],
        automatic=dice.random() < 0.15,
        line=dice.choices(tuple(LINES), (3, 6, 1, 1, 3, 1, 1, 1))[0],
        running=dice.random() < 0.1,
        seed=dice.randrange(1 << 30),
    )


def _happenings(dice: Random, bays: int) -> tuple[Happening, ...]:
    t_s = dice.choice((0.0, BEGIN_S, BEGIN_S, BEGIN_S)) + dice.uniform(0.0, 3.0)
    happenings = []
    for _ in range(dice.choices((1, 2, 3, 4, 6), (4, 3, 2, 1, 1))[0]):
        name = dice.choices((dice.choice(INJECTIONS), "heal", dice.choice(REQUESTS)), (6, 1, 2))[0]
        value = dice.choice((None, *STRENGTHS.get(name, ())))
        happenings.append(Happening(round(t_s, 3), dice.randrange(bays), name, value))
        t_s += dice.choice((0.0, 0.05, 0.3, 1.0, 2.5, 6.0, 12.0)) * dice.uniform(0.5, 1.0)
    return tuple(happenings)


def shrink(script: Script, fails: Callable[[Script], bool]) -> Script:
    """The smallest script found by shrinking that still fails; `fails` plays one."""
    while (smaller := next(filter(fails, _smaller(script)), None)) is not None:
        script = smaller
    return script


def _smaller(script: Script) -> Iterator[Script]:
    """Simpler neighbours, the simplest first."""
    happenings = script.happenings
    for at in range(len(happenings)):
        yield replace(script, happenings=happenings[:at] + happenings[at + 1 :])
    if len(script.bays) > 1:
        for at in range(len(script.bays)):
            kept = tuple(
                replace(one, bay=one.bay - (one.bay > at)) for one in happenings if one.bay != at
            )  # fmt: skip
            yield replace(script, bays=script.bays[:at] + script.bays[at + 1 :], happenings=kept)
    for at, bay in enumerate(script.bays):
        for name, plain in asdict(BaySetup()).items():
            if getattr(bay, name) != plain:
                yield replace(script, bays=(*script.bays[:at], replace(bay, **{name: plain}), *script.bays[at + 1 :]))
    for simpler in (
        replace(script, heal_s=None),
        replace(script, tpdo_s=None),
        replace(script, sweep_s=0.3),
        replace(script, limit_a=15.0),
    ):
        if simpler != script:
            yield simpler
    for at, one in enumerate(happenings):
        for t_s in (float(round(one.t_s)), round(one.t_s, 1)):
            if t_s != one.t_s and all(a.t_s <= t_s for a in happenings[:at]):
                yield replace(script, happenings=(*happenings[:at], replace(one, t_s=t_s), *happenings[at + 1 :]))
    last_s = max((one.t_s for one in happenings), default=0.0)
    for end_s in (last_s + 1, last_s + 4, (last_s + script.end_s) / 2):
        if end_s < script.end_s - 0.5 and (script.heal_s is None or script.heal_s <= end_s):
            yield replace(script, end_s=round(end_s, 1))
