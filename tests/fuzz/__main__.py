"""The long form: `make fuzz ARGS='charger --runs 1000000'`. Inputs with findings are written to files.

First atheris looks for inputs that reach new code, at ten times the cost of the code itself; then those inputs are
mutated blindly until the number is reached. `make fuzz ARGS='charger FILE…'` gives files to the target again; a
directory stands for the files in it.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from hashlib import sha1
from importlib import import_module
from pathlib import Path
from random import Random
from resource import RUSAGE_SELF, getrusage
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

from tests.fuzz.target import MEMORY, Target, changed
from tests.fuzz.watch import Watch
from tests.proof.report import say

NAMES = ("charger", "bmu", "config", "control", "clients", "kept", "guardian")
ROOT = Path(__file__).resolve().parent.parent.parent
WORK = ROOT / "build" / "fuzz"
#: After this an input counts as hanging, even on a stalled machine. Endless computing is noticed sooner (`Watch`).
TIMEOUT_S = 600
#: MiB allowed for the whole process, with Python, coverage and corpus.
RSS_MIB = 512


#: The last line of either part, libFuzzer's or ours.
INPUTS, PEAK_MIB = re.compile(r"(?:units|inputs): +(\d+)"), re.compile(r"peak(?:_rss_mb)?: +(\d+)")


def the_target(name: str) -> Target:
    found: Target = import_module(f"tests.fuzz.{name}").TARGET
    return found


# --- each of these runs in its own process ---------------------------------------------------------------------------


def guided(name: str, runs: int, minutes: float, seed: int) -> None:
    """Inputs by atheris; each one reaching new code is kept. libFuzzer ends the process."""
    atheris: Any = import_module("atheris")  # only `make fuzz` installs it
    with atheris.instrument_imports(include=["orchestrator"]):
        target = the_target(name)

    def mutated(data: bytes, max_size: int, number: int) -> bytes:
        random = Random(number)
        if random.random() < target.blind:
            return bytes(atheris.Mutate(data, max_size))
        return changed(target, data, random)[:max_size]

    options = [
        f"-runs={runs}", f"-max_total_time={minutes * 60:.0f}", f"-seed={seed}", f"-max_len={target.max_bytes}",
        f"-timeout={TIMEOUT_S}", f"-rss_limit_mb={RSS_MIB}", f"-artifact_prefix={WORK / name}/",
        "-print_final_stats=1", str(corpus(name)),
    ]  # fmt: skip
    atheris.Setup([name, *options], Watch(target).one, custom_mutator=mutated)
    atheris.Fuzz()


def unguided(name: str, runs: int, minutes: float, seed: int) -> int:
    """Mutated inputs of the corpus, at full speed."""
    target, random = the_target(name), Random(seed)
    watch, known = Watch(target), [path.read_bytes() for path in sorted(corpus(name).iterdir())]
    signal.signal(signal.SIGALRM, _waits)
    end_s = time.monotonic() + 60 * minutes
    while watch.inputs < runs and time.monotonic() < end_s:
        data = changed(target, random.choice(known), random)
        signal.alarm(TIMEOUT_S)
        try:
            watch.one(data)
        except Exception:  # noqa: BLE001 - any exception is a finding
            found = WORK / name / f"crash-{sha1(data).hexdigest()}"
            found.write_bytes(data)
            say(f"{traceback.format_exc()}in {found}")
            return 1
        finally:
            signal.alarm(0)
    say(f"inputs: {watch.inputs}\npeak: {getrusage(RUSAGE_SELF).ru_maxrss // 1024}")
    return 0


def _waits(_number: int, _frame: FrameType | None) -> None:
    raise TimeoutError(f"no end within {TIMEOUT_S} s")


def replay(name: str, paths: Sequence[Path]) -> int:
    """Each file once more; the first with a finding ends the run with its traceback."""
    watch = Watch(the_target(name))
    for path in _files(paths):
        watch.one(path.read_bytes())
    say(f"{name}: {watch.inputs} inputs, nothing found")
    return 0


def _files(paths: Sequence[Path]) -> Iterator[Path]:
    for path in paths:
        yield from sorted(path.iterdir()) if path.is_dir() else [path]


# --- in front of it --------------------------------------------------------------------------------------------------


def corpus(name: str) -> Path:
    """The directory of the inputs worth keeping."""
    return WORK / name / "corpus"


def long_form(name: str, runs: int, guided_runs: int, minutes: float, seed: int) -> int:
    """Both parts for one target, then its coverage; 1 if something was found."""
    corpus(name).mkdir(parents=True, exist_ok=True)
    for number, data in enumerate(the_target(name).seeds):
        (corpus(name) / f"seed-{number:03}").write_bytes(data)
    led = min(runs, guided_runs)
    status = 0
    for how, number in (("guided", led), ("unguided", runs - led)):
        if number and not status:
            status = _part(name, how, number, minutes, seed)
    say(f"{name}: {len(list(corpus(name).iterdir()))} inputs kept; together they reach:")
    _covered(name)
    return status


def _part(name: str, how: str, runs: int, minutes: float, seed: int) -> int:
    log, began_s = WORK / name / f"{how}.log", time.monotonic()
    # libFuzzer ends its process at once; this directory, removed here, takes what the targets write.
    with log.open("wb") as file, TemporaryDirectory(prefix="fuzz-", dir=MEMORY) as directory:
        command = [sys.executable, "-m", "tests.fuzz", name, "--how", how, f"--runs={runs}"]
        command += [f"--minutes={minutes}", f"--seed={seed}"]
        environment = os.environ | {"TMPDIR": directory}
        done = subprocess.run(command, cwd=ROOT, env=environment, stdout=file, stderr=file, check=False)
    took_s = time.monotonic() - began_s
    said = log.read_text(encoding="utf-8", errors="replace")
    if done.returncode:
        say("\n".join(said.splitlines()[-40:]))
        say(f"{name}, {how}: FOUND something; all of it is in {log}")
        return 1
    inputs, peak_mib = (int(pattern.findall(said)[-1]) for pattern in (INPUTS, PEAK_MIB))
    say(f"{name}, {how}: {inputs:,} inputs in {took_s:,.0f} s, {inputs / took_s:,.0f} a second, peak {peak_mib} MiB")
    return 0


def _covered(name: str) -> None:
    """Line and branch coverage of the product by the corpus alone."""
    data = f"--data-file={WORK / name / 'coverage'}"
    coverage, quiet = [sys.executable, "-m", "coverage"], subprocess.DEVNULL
    again = ["--branch", "-m", "tests.fuzz", name, str(corpus(name))]
    subprocess.run([*coverage, "erase", data], cwd=ROOT, check=True)
    subprocess.run([*coverage, "run", data, *again], cwd=ROOT, check=True, stdout=quiet)
    subprocess.run([*coverage, "combine", "--quiet", data, str(WORK / name)], cwd=ROOT, check=False, stdout=quiet)
    include = f"--include={','.join(the_target(name).modules)}"
    subprocess.run([*coverage, "report", data, include, "--fail-under=0"], cwd=ROOT, check=False)


def main(argv: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="make fuzz", description=__doc__)
    parser.add_argument("target", nargs="?", choices=(*NAMES, "all"), default="all")
    parser.add_argument("file", nargs="*", type=Path, help="give these to the target again")
    parser.add_argument("--runs", type=int, default=1_000_000, help="inputs for each target (default: %(default)s)")
    parser.add_argument("--guided", type=int, default=20_000, help="of these by atheris (default: %(default)s)")
    parser.add_argument("--minutes", type=float, default=60.0, help="of each part at most (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of chance (default: %(default)s)")
    parser.add_argument("--how", choices=("guided", "unguided"), help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.file:
        return replay(arguments.target, arguments.file)
    if arguments.how == "guided":
        guided(arguments.target, arguments.runs, arguments.minutes, arguments.seed)
    if arguments.how == "unguided":
        return unguided(arguments.target, arguments.runs, arguments.minutes, arguments.seed)
    chosen = NAMES if arguments.target == "all" else (arguments.target,)
    options = (arguments.runs, arguments.guided, arguments.minutes, arguments.seed)
    return max(long_form(name, *options) for name in chosen)


if __name__ == "__main__":
    sys.exit(main())
