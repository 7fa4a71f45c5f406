"""Testing the tester: each hole that was closed is opened again in a copy of the package, and the proofs must find it.

    python -m tests.proof seeds                       all of them; writes docs/proofs.md
    python -m tests.proof.seeds --only NAME ...       some of them, nothing is written

A seed is a text that stands in the package exactly once and what takes its place (`seed_table.py`). The proofs run one
after the other, the likeliest first, until one finds something; what the package itself makes them find does not count.
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
from pathlib import Path

from tests.proof.report import say
from tests.proof.seed_table import SEEDS, Seed

ROOT = Path(__file__).resolve().parent.parent.parent
PAGE = ROOT / "docs" / "proofs.md"
#: Who goes on working here meanwhile must not be what is found.
COPIED = ("orchestrator", "tests")
#: Of the seeds, at least this share must be found.
ENOUGH = 0.95
#: A seed may take this long in all, in the mean.
SEED_S = 180.0


@dataclass(frozen=True, slots=True)
class Proof:
    """One of the proofs: its command, and how long it may take here."""

    about: str
    command: tuple[str, ...]
    within_s: float


#: What virtual time cannot see: real processes, ports, sockets.
HOSTILE = ("tests/guardian/test_laststop.py", "tests/guardian/test_estop.py", "tests/link/test_serial.py")
PYTEST = ("-m", "pytest", "-x", "-q", "-p", "no:cacheprovider")
PROOFS: Mapping[str, Proof] = {
    "environment": Proof(
        "scenes and random trouble over lives of the gateway",
        ("-m", "tests.proof.environment", "--names", "--until-found", "--runs", "200", "--minutes", "2.5"), 240.0,
    ),
    "scripts": Proof("random fault scripts", ("-m", "tests.proof.campaign", "--scripts", "120"), 120.0),
    "calls": Proof("every call of a charge made to fail", (*PYTEST, "tests/proof/test_nth_call.py"), 120.0),
    "core": Proof("everything that the core can come to", (*PYTEST, "tests/proof/test_explore.py"), 120.0),
    "hostile": Proof("real processes among hostile ones", (*PYTEST, *HOSTILE), 180.0),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Result:
    """What became of a seed."""

    seed: Seed
    proof: str  #: that found it; "" none
    took_s: float  #: of that proof
    all_s: float  #: of all that were tried


def apply(seed: Seed, root: Path) -> None:
    """Open the hole in the package below `root`; ValueError if a text does not stand there exactly once."""
    for name, old, new in seed.changes:
        path = root / name
        text = path.read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise ValueError(f"seed {seed.name}: {name} has {text.count(old)} times, not once:\n{old}")
        path.unlink()  # it may be a link
        path.write_text(text.replace(old, new), encoding="utf-8")


@contextmanager
def copied(seed: Seed | None) -> Iterator[Path]:
    """A tree with the package changed, everything else as it is."""
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


def run(proof: Proof, root: Path, *more: str) -> tuple[bool, str]:
    """Whether it finds something in the tree, and what it said. One that takes too long has found nothing."""
    environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
    with subprocess.Popen(
        [sys.executable, *proof.command, *more], cwd=root, env=environment, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, start_new_session=True,
    ) as process:  # fmt: skip
        try:
            said, _ = process.communicate(timeout=proof.within_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            return False, "takes too long"
    return process.returncode != 0, said


def known() -> dict[str, str]:
    """What the package as it is makes the proofs find: scripts of the environment to leave out, proofs to leave out."""
    with copied(None) as root:
        command = tuple(word for word in PROOFS["environment"].command if word != "--until-found")
        found, said = run(Proof("", command, 400.0), root)
    names = [line.split(":")[0].split(" ", 1)[1] for line in said.splitlines() if line.startswith(("scene ", "seed "))]
    if found:
        say(f"the package itself makes {len(names)} scripts find something; they are left out")
    return {"environment": "|".join(names)}


def search(seed: Seed, skip: Mapping[str, str]) -> Result:
    """Run the proofs until one finds it."""
    began_s = time.monotonic()
    order = sorted(PROOFS, key=lambda name: name != seed.likely)
    with copied(seed) as root:
        for name in order:
            before_s = time.monotonic()
            more = ("--skip", skip[name]) if skip.get(name) else ()
            found, said = run(PROOFS[name], root, *more)
            if found:
                say(f"{seed.name}: {name}: {_gist(said)}")
                return Result(seed, name, time.monotonic() - before_s, time.monotonic() - began_s)
    say(f"{seed.name}: NOT FOUND")
    return Result(seed, "", 0.0, time.monotonic() - began_s)


def _gist(said: str) -> str:
    """The line that says it."""
    lines = [line for line in said.splitlines() if line.strip()] or [""]
    telling = [line for line in lines if line.startswith(("scene", "seed", "E  ", "FAILED"))]
    return (telling or lines[-1:])[0][:200]


def page(results: Sequence[Result]) -> Iterator[str]:
    """docs/proofs.md."""
    found = [result for result in results if result.proof]
    mean_s = sum(result.all_s for result in results) / len(results)
    yield "# Which proof finds which bug"
    yield ""
    yield "Each hole that was once open is a seeded bug: a small change that opens it again. This page is made by"
    yield "`make campaign ARGS=seeds`: each is applied to a copy of the package, and the proofs run until one finds it."
    yield ""
    yield f"{len(found)} of {len(results)} are found, in {mean_s:.0f} s each in the mean."
    yield ""
    yield "| proof | what it is | finds |"
    yield "| --- | --- | --- |"
    for name, proof in PROOFS.items():
        yield f"| {name} | {proof.about} | {sum(result.proof == name for result in results)} |"
    yield ""
    yield "| seed | what is broken | found by | after |"
    yield "| --- | --- | --- | --- |"
    for result in results:
        by = (result.proof, f"{result.took_s:.0f} s") if result.proof else ("**nothing**", "–")
        yield f"| {result.seed.name} | {result.seed.about} | {by[0]} | {by[1]} |"


def main(argv: Sequence[str] | None = None) -> int:
    """All seeds, or some; 1 if too few are found, or they take too long."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="*", default=[], choices=[seed.name for seed in SEEDS], metavar="NAME")
    options = parser.parse_args(argv)
    chosen = [seed for seed in SEEDS if not options.only or seed.name in options.only]
    skip = known()
    results = [search(seed, skip) for seed in chosen]
    if not options.only:
        PAGE.write_text("\n".join(page(results)) + "\n", encoding="utf-8")
    found = sum(bool(result.proof) for result in results)
    mean_s = sum(result.all_s for result in results) / len(results)
    say(f"{found} of {len(results)} seeds found, in {mean_s:.0f} s each in the mean")
    return 0 if found >= ENOUGH * len(results) and mean_s <= SEED_S else 1


if __name__ == "__main__":
    sys.exit(main())
