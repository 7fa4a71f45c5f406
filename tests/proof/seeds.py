"""Testing the tester: each closed hole is reopened in a copy of the package, and the proofs must find it.

    python -m tests.proof seeds                       all of them; writes docs/proofs.md
    python -m tests.proof.seeds --only NAME ...       some of them; writes nothing

A seed is a text that occurs in the package exactly once and its replacement (`seeded/`). The likeliest proof runs
first, starting with its likeliest part; then all proofs in turn until one finds something. Findings in the unchanged
package do not count.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from multiprocessing.pool import ThreadPool
from pathlib import Path
from threading import Lock

from tests.proof.report import say
from tests.proof.seed_table import SEEDS
from tests.proof.seeded.seed import Seed

ROOT = Path(__file__).resolve().parent.parent.parent
PAGE = ROOT / "docs" / "proofs.md"
HEADING = "## Which proof finds which bug"
#: A copy, so that ongoing edits in this tree are not what is found.
COPIED = ("orchestrator", "tests")
#: At least this share of the seeds must be found.
ENOUGH = 0.95
#: Findings in the unchanged package are determined once.
LOOKING = Lock()
#: Mean time allowed per seed.
SEED_S = 180.0


@dataclass(frozen=True, slots=True)
class Proof:
    """One of the proofs: its command and time limit. `usual` is what it plays if nothing is named."""

    about: str
    sees: str
    blind: str
    command: tuple[str, ...]
    within_s: float
    usual: tuple[str, ...] = ()
    named: str = ""  #: the option before each name

    def words(self, where: Sequence[str]) -> list[str]:
        """The command line."""
        named = [word for one in where for word in ((self.named, one) if self.named else (one,))]
        return [*self.command, *(named or self.usual)]


PYTEST = ("-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--timeout", "60")
#: Random scripts played after the scenes, for bugs no scene finds.
RUNS = "40"
PROOFS: Mapping[str, Proof] = {
    "environment": Proof(
        "scenes, then random trouble with lines, disk, bus and people, over several lives of the gateway",
        "the whole service in virtual time, checked against wire and plant: current, messages, restarts",
        "real processes, sockets and signals; drivers; bugs hidden by a second guard",
        ("-m", "tests.proof.environment", "--names", "--until-found"),
        300.0,
        ("--runs", RUNS),
        "--only",
    ),
    "hostile": Proof(
        "real processes, pseudo terminals, sockets and disks in a hostile environment",
        "everything virtual time replaces: signals, killed and frozen processes, hanging drivers, imports, clients",
        "rare interleavings: it runs in real time",
        PYTEST,
        300.0,
        (
            "tests/guardian",
            "tests/whole/test_survives.py",
            "tests/whole/test_operator.py",
            "tests/whole/test_others.py",
            "tests/service/test_asking.py",
            "tests/service/test_control.py",
            "tests/service/test_control_clients.py",
            "tests/service/test_control_order.py",
            "tests/service/test_control_requests.py",
            "tests/test_surroundings.py",
        ),
    ),
    "parts": Proof(
        "the tests of single parts",
        "a guard backed by another one, so that the whole station is safe without it",
        "how parts work together",
        PYTEST,
        300.0,
        ("tests/core", "tests/devices", "tests/link", "tests/service", "tests/workbench", "tests/config"),
    ),
    "scripts": Proof(
        "random fault scripts on a station",
        "faults of chargers and BMUs in unforeseen combinations",
        "other programs on the machine, and restarts",
        ("-m", "tests.proof.campaign", "--scripts", "120"),
        120.0,
    ),
    "calls": Proof(
        "every call during a charge fails in turn",
        "an unexpected error at any place",
        "hanging calls, and bugs without an error",
        (*PYTEST, "tests/proof/test_nth_call.py"),
        120.0,
    ),
    "core": Proof(
        "everything the core can reach",
        "each state under each input: every transition is allowed, and everything ends at rest",
        "everything outside the core",
        (*PYTEST, "tests/proof/test_explore.py"),
        120.0,
    ),
}


@dataclass(frozen=True, slots=True)
class Result:
    """The result for a seed."""

    seed: Seed
    proof: str  #: the proof that found it; "" none
    by: str  #: its scene or test
    took_s: float  #: of that proof
    all_s: float  #: of all that were tried


def apply(seed: Seed, root: Path) -> None:
    """Reopen the hole in the package below `root`; ValueError if a text does not occur exactly once."""
    for name, old, new in seed.changes:
        path = root / name
        text = path.read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise ValueError(f"seed {seed.name}: {name} has {text.count(old)} times, not once:\n{old}")
        path.unlink()  # it may be a link
        path.write_text(text.replace(old, new), encoding="utf-8")


@contextmanager
def copied(seed: Seed | None) -> Iterator[Path]:
    """A tree with the changed package; everything else is unchanged."""
    with tempfile.TemporaryDirectory(prefix="seed") as directory:
        root = Path(directory)
        for name in COPIED:
            shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
        for path in ROOT.iterdir():
            if path.name not in (*COPIED, ".git", "build", "mutants"):
                (root / path.name).symlink_to(path)
        if seed is not None:
            apply(seed, root)
        yield root


def run(words: Sequence[str], within_s: float, root: Path) -> tuple[bool, str]:
    """Whether it finds something in the tree, and its output. A proof that takes too long has found nothing."""
    environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
    with subprocess.Popen(
        [sys.executable, *words], cwd=root, env=environment, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, start_new_session=True,
    ) as process:  # fmt: skip
        try:
            said, _ = process.communicate(timeout=within_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            return False, "takes too long"
    return process.returncode != 0, said


@cache
def known() -> tuple[str, ...]:
    """The environment's findings in the unchanged package, as options that exclude them; computed when needed."""
    with LOOKING, copied(None) as root:
        command = ("-m", "tests.proof.environment", "--names", "--runs", RUNS)
        found, said = run(command, 600.0, root)
    names = [line.split(":")[0].split(" ", 1)[1] for line in said.splitlines() if line.startswith(("scene ", "seed "))]
    if found:
        say(f"the package itself makes {len(names)} scripts find something, and they are left out: {', '.join(names)}")
    return ("--skip", "|".join(names)) if names else ()


def attempts(seed: Seed) -> Iterator[tuple[str, Sequence[str]]]:
    """The proofs in the order tried, and the parts of each."""
    if seed.where:
        yield seed.likely, seed.where
    for name in sorted(PROOFS, key=lambda name: name != seed.likely):
        yield name, ()


def search(seed: Seed) -> Result:
    """Run the proofs until one finds it."""
    began_s = time.monotonic()
    with copied(seed) as root:
        for name, where in attempts(seed):
            before_s, proof = time.monotonic(), PROOFS[name]
            skip = known() if name == "environment" and not where else ()
            found, said = run([*proof.words(where), *skip], proof.within_s, root)
            if found:
                by, gist = _finding(said)
                say(f"{seed.name}: {name}, {by}: {gist}")
                return Result(seed, name, by, time.monotonic() - before_s, time.monotonic() - began_s)
    say(f"{seed.name}: NOT FOUND")
    return Result(seed, "", "", 0.0, time.monotonic() - began_s)


def _finding(said: str) -> tuple[str, str]:
    """The scene, script or test, and its message."""
    lines = said.splitlines()
    for line in lines:
        if line.startswith(("scene ", "seed ")):
            by, gist = line.split(": ", 1)
            return by, gist[:200]
    failed = next((line for line in lines if line.startswith(("FAILED ", "ERROR "))), "")
    gist = next((line for line in lines if line.startswith("E  ")), failed or (lines or [""])[-1])
    return failed.split(" ")[1].split("[")[0].rpartition("::")[2] if failed else "", gist[:200]


def page(results: Sequence[Result]) -> Iterator[str]:
    """The end of docs/proofs.md, from its heading on."""
    found = [result for result in results if result.proof]
    mean_s = sum(result.all_s for result in results) / len(results)
    yield HEADING
    yield ""
    yield "Each hole that was once open is kept as a seeded bug: a small change that opens it again. `make campaign"
    yield "ARGS=seeds` applies each of them to a copy of the package, runs the proofs until one finds it, and writes"
    yield "this page. A bug that no proof finds calls for a new proof."
    yield ""
    yield f"{len(found)} of {len(results)} are found, in {mean_s:.0f} s each on average."
    yield ""
    yield "### The proofs"
    yield ""
    yield "| proof | what it is | what it sees | what it cannot see | finds first |"
    yield "| --- | --- | --- | --- | --- |"
    for name, proof in PROOFS.items():
        number = sum(result.proof == name for result in results)
        yield f"| {name} | {proof.about} | {proof.sees} | {proof.blind} | {number} |"
    yield ""
    yield "The likeliest proof is tried first, so a proof that found nothing first may still be able to find a bug."
    yield ""
    yield "### The bugs"
    yield ""
    yield "| kind | seed | what is broken | found by | after |"
    yield "| --- | --- | --- | --- | --- |"
    for result in results:
        seed, by = result.seed, f"{result.proof}: `{result.by}`" if result.by else result.proof
        after = f"{result.all_s:.0f} s" if result.proof else "–"
        yield f"| {seed.kind} | {seed.name} | {seed.about} | {by or '**nothing**'} | {after} |"


def main(argv: Sequence[str] | None = None) -> int:
    """All seeds, or some; 1 if too few are found, or they take too long."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="*", default=[], choices=[seed.name for seed in SEEDS], metavar="NAME")
    parser.add_argument("--workers", type=int, default=1, help="seeds at once (default: %(default)s)")
    options = parser.parse_args(argv)
    chosen = [seed for seed in SEEDS if not options.only or seed.name in options.only]
    with ThreadPool(options.workers) as pool:
        results = pool.map(search, chosen, chunksize=1)
    if not options.only:
        before = PAGE.read_text(encoding="utf-8").partition(HEADING)[0]
        PAGE.write_text(before + "\n".join(page(results)) + "\n", encoding="utf-8")
    found = sum(bool(result.proof) for result in results)
    mean_s = sum(result.all_s for result in results) / len(results)
    say(f"{found} of {len(results)} seeds found, in {mean_s:.0f} s each on average")
    return 0 if found >= ENOUGH * len(results) and mean_s <= SEED_S else 1


if __name__ == "__main__":
    sys.exit(main())
