"""What a charging bay writes into the journal: the whole service in virtual time, a real journal on a real disk.

python -m tests.proof.journal_size                       the figures, for some numbers of bays on one CAN bus
python -m tests.proof.journal_size 16 2300 DIRECTORY     that many bays, that many seconds: a journal to keep
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from orchestrator.model import ControlMode
from orchestrator.service.journal import EVENTS_SHARE, GATHER_S, Journal
from orchestrator.service.records import SnapshotRecorder
from orchestrator.sim.presets import PACKS
from tests.proof.report import say
from tests.proof.virtual_rig import Nature
from tests.proof.virtual_service import World, station, world

#: All bays charge after this.
SETTLED_S = 20.0
#: Real volts never stand still: by one digit (0.01 V) of charger and BMU, as often as a BMU looks.
NOISE_V, NOISE_S = 0.01, 0.05
BEGAN_S = 1_767_225_600.0
MAX_MB = 1000.0


@dataclass(frozen=True, slots=True)
class Measured:
    """The figures of one run, with all bays charging."""

    bays: int
    decisions_s: float  #: decisions of a bay, a second
    bytes_s: float  #: of the snapshots of a bay, a second

    def days(self, bays: int) -> float:
        """How far 1 GB reaches with so many bays."""
        return MAX_MB * 1e6 * (1 - EVENTS_SHARE) / self.bytes_s / bays / 86_400


class Meter:
    """One run."""

    def __init__(self, made: World, directory: Path, seconds: float) -> None:
        self._made, self._directory, self._count = made, directory, 0
        self._dice = Random(1)
        time = made.time
        self._journal = Journal(directory, MAX_MB, lambda: time.now_s, lambda: BEGAN_S + time.now_s, boot="virtual")
        made.journal.put = self._journal.put  # type: ignore[method-assign]  # what it is given is written
        for bay in made.bays:
            bay._journal._recorder = SnapshotRecorder(bay.policy.rules.bay)
        made.on_step = self._step
        self._begin = self._end = (0.0, 0, 0)
        time.call_later(GATHER_S, self._write)
        time.call_later(SETTLED_S / 2, self._shake)
        time.call_later(SETTLED_S, self._mark)
        time.call_later(SETTLED_S + seconds, self._stop)

    def figures(self) -> Measured:
        """After the run."""
        (t_s, size, count), (end_s, end_size, end_count), bays = self._begin, self._end, len(self._made.bays)
        bay_s = (end_s - t_s) * bays
        return Measured(bays, (end_count - count) / bay_s, (end_size - size) / bay_s)

    def _step(self, _bay: object) -> None:
        self._count += 1

    def _write(self) -> None:
        self._made.time.call_later(GATHER_S, self._write)
        self._journal._write(all_of_it=False)

    def _shake(self) -> None:
        self._made.time.call_later(NOISE_S, self._shake)
        for rig in self._made.rigs:
            rig.bay.pack.bias_v = self._dice.gauss(0.0, NOISE_V)

    def _now(self) -> tuple[float, int, int]:
        self._journal._write()
        size = sum(path.stat().st_size for path in self._directory.glob("snapshots*"))
        return self._made.time.now_s, size, self._count

    def _mark(self) -> None:
        self._begin = self._now()

    def _stop(self) -> None:
        assert {bay.status()["state"] for bay in self._made.bays} == {"CHARGING"}
        self._end = self._now()
        self._made.end()


def measure(bays: int, seconds: float, directory: Path) -> Measured:
    """Charge so many bays on one bus for so long; the journal is in the directory."""
    natures = []
    for number in range(bays):
        pack = PACKS["48v"]()
        pack.set_soc(20.0 + number % 20)
        natures.append(Nature(pack, seed=number + 1))
    settings = replace(station([ControlMode.MANUAL] * bays), stagger_s=0.0)
    with world(settings, natures, end_s=seconds + 120.0) as made:
        meter = Meter(made, directory, seconds)
        made.run()
        meter._journal._write()
    return meter.figures()


def main(arguments: Sequence[str]) -> int:
    """Measure; returns the exit status."""
    if arguments:
        bays, seconds, directory = arguments
        say(str(measure(int(bays), float(seconds), Path(directory))))
        return 0
    for count in (1, 2, 4, 8, 16):
        with TemporaryDirectory(prefix="journal") as name:
            one = measure(count, 600.0, Path(name))
        say(
            f"{count:3} bays on a bus: {one.decisions_s:4.1f} decisions/s, {one.bytes_s:4.0f} B/s a bay; "
            f"1 GB: 16 bays {one.days(16):.1f} days, 64 bays {one.days(64):.1f} days"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
