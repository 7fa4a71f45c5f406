"""The seeds: closed holes, each with a small change of the package that reopens it."""

from tests.proof.seeded.bus import BUS
from tests.proof.seeded.conditions import CONDITIONS
from tests.proof.seeded.disk import DISK
from tests.proof.seeded.line import LINES
from tests.proof.seeded.ours import OURS
from tests.proof.seeded.ports import PORTS
from tests.proof.seeded.restarts import RESTARTS
from tests.proof.seeded.seed import Seed
from tests.proof.seeded.surroundings import SURROUNDINGS
from tests.proof.seeded.witnesses import WITNESSES
from tests.proof.seeded.words import WORDS

SEEDS: tuple[Seed, ...] = (
    *LINES,
    *DISK,
    *WITNESSES,
    *PORTS,
    *RESTARTS,
    *CONDITIONS,
    *OURS,
    *WORDS,
    *BUS,
    *SURROUNDINGS,
)
