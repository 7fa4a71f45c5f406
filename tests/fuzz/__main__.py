"""Long fuzzing, led by the coverage: `make fuzz ARGS='charger --runs 1000000'`. What it finds is written to a file.

`make fuzz ARGS='charger FILE…'` gives the files to the target again, without the fuzzer; directories are corpora.
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.target import Target, changed
from tests.fuzz.watch import Watch

NAMES = ("charger", "bmu", "config", "control", "kept", "guardian")
ROOT = Path(__file__).resolve().parent.parent.parent
WORK = ROOT / "build" / "fuzz"
#: Seconds after which an input hangs, and MiB that the whole process may have; Python, coverage and corpus are in it.
TIMEOUT_S = 20
RSS_MIB = 512


def say(text: object) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def target(name: str) -> Target:
    found: Target = import_module(f"tests.fuzz.{name}").TARGET
    return found


def fuzz(name: str, options: Sequence[str]) -> None:
    """In a process of its own, which libFuzzer ends."""
    atheris: Any = import_module("atheris")  # has no types, and is installed by `make fuzz` only
    with atheris.instrument_imports(include=["orchestrator"]):
        of = target(name)
    watch = Watch(of)

    def mutated(data: bytes, max_size: int, seed: int) -> bytes:
        random = Random(seed)
        if random.random() < 0.3:
            return bytes(atheris.Mutate(data, max_size))
        return changed(of, data, random)[:max_size]

    atheris.Setup([name, *options], watch.one, custom_mutator=mutated)
    atheris.Fuzz()


def run(name: str, runs: int, seed: int) -> int:
    """One target's long form; what it did, in one line each."""
    corpus = WORK / name / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    of = target(name)
    for number, data in enumerate(of.seeds):
        (corpus / f"seed-{number:03}").write_bytes(data)
    options = [
        f"-runs={runs}", f"-seed={seed}", f"-max_len={of.max_bytes}", f"-timeout={TIMEOUT_S}", f"-rss_limit_mb={RSS_MIB}",
        f"-artifact_prefix={WORK / name}/", "-print_final_stats=1", str(corpus),
    ]  # fmt: skip
    log, began_s = WORK / name / "log", time.monotonic()
    with log.open("wb") as file:
        command = [sys.executable, "-m", "tests.fuzz", name, "--child", *options]
        status = subprocess.run(command, cwd=ROOT, stdout=file, stderr=file, check=False).returncode
    took_s = time.monotonic() - began_s
    said = log.read_text(encoding="utf-8", errors="replace").splitlines()
    stats = dict(line.removeprefix("stat::").split(":") for line in said if line.startswith("stat::"))
    done = int(stats.get("number_of_executed_units", 0))
    say(
        f"{name}: {done:,} inputs in {took_s:.0f} s, {done / took_s:,.0f} a second, at most "
        f"{stats.get('peak_rss_mb', '?').strip()} MiB, {len(list(corpus.iterdir()))} inputs kept in {corpus}"
    )
    if status:
        say("\n".join(said[-40:]))
        say(f"FOUND: the whole of it in {log}")
    covered(name, [corpus])
    return status


def covered(name: str, paths: Sequence[Path]) -> None:
    """Which of the product's lines and branches these inputs reach, measured in a process of its own."""
    include = ",".join(target(name).modules)
    data = f"--data-file={WORK / name / 'coverage'}"
    measure = [sys.executable, "-m", "coverage"]
    subprocess.run(
        [*measure, "run", data, "--branch", "-m", "tests.fuzz", name, *map(str, paths)],
        cwd=ROOT, check=False, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    subprocess.run([*measure, "combine", "-q", data, str(WORK / name)], cwd=ROOT, check=False, capture_output=True)
    subprocess.run([*measure, "report", data, f"--include={include}", "--fail-under=0"], cwd=ROOT, check=False)


def replay(name: str, paths: Sequence[Path]) -> int:
    """Each file once more; the first that finds something ends it with its traceback."""
    watch = Watch(target(name))
    for path in (file for path in paths for file in (sorted(path.iterdir()) if path.is_dir() else [path])):
        with nullcontext():
            watch.one(path.read_bytes())
    say(f"{name}: {watch.inputs} inputs, nothing found")
    return 0


def main(argv: Sequence[str]) -> int:
    if "--child" in argv:
        fuzz(argv[0], argv[2:])
    parser = argparse.ArgumentParser(prog="make fuzz", description=__doc__)
    parser.add_argument("target", nargs="?", choices=(*NAMES, "all"), default="all")
    parser.add_argument("file", nargs="*", type=Path, help="give these to the target again")
    parser.add_argument("--runs", type=int, default=1_000_000, help="inputs for each target (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of chance (default: %(default)s)")
    arguments = parser.parse_args(argv)
    if arguments.file:
        return replay(arguments.target, arguments.file)
    chosen = NAMES if arguments.target == "all" else (arguments.target,)
    return max(run(name, arguments.runs, arguments.seed) for name in chosen)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
