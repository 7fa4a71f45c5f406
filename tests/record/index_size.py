"""How long the index takes for many charges, and how large it is: `python -m tests.record.index_size [CHARGES]`.

Four-hour charges in 16 bays, spread over five years, the older months packed as the service packs them. Everything is
measured on the real command line. It takes some minutes, and about 1 GB of disk.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.record import lines
from orchestrator.record.index import NAME
from orchestrator.record.lines import Record
from orchestrator.record.met import Met, Trouble
from orchestrator.record.pauses import Pause, Pauses
from orchestrator.record.stamp import as_fields
from orchestrator.record.ulid import CHANCE, after
from orchestrator.record.utc import unix_s, utc
from tests.record.made import FULL, charge

MONTHS, BAYS, BATTERIES, CHECKPOINTS = 60, 16, 97, 24
#: What is measured, and how often; the quickest counts, since the machine does other things, too.
WHAT = {
    "sessions": 7, "sessions --bay bay-03 --limit 20": 7, "sessions --battery B-0042 --limit 20": 7, "report": 3,
    "sessions --csv": 1,
}  # fmt: skip


def full_life() -> list[Record]:
    """The records of one charge of ordinary size."""
    paused = plain(Cause.of("over_temperature", pack_c=45.2, limit_c=45, again_c=40.0, key="pack.temperature_c"))
    made = list[Record]()
    for n in range(CHECKPOINTS + 1):
        now = charge(1, n, 2.0 * n)
        rules = tuple(
            ((id_, f"current.{id_}", f"li-ion-48v.yaml:{n}"), 60.0 * n, n / 2) for id_ in ("soc", "volts", "")
        )
        pauses = Pauses((Pause(paused, now.begin, 600.0),) * 2, None, None, 2, 1200.0)
        amounts = replace(now.amounts, rules=rules)
        now = replace(now, amounts=amounts, pauses=pauses, trouble=Trouble((Met("hot", "PAUSE", paused),)))
        made.append(lines.begin(now) if n == 0 else lines.checkpoint(now))
    return [*made, lines.end(replace(now, number=now.number + 1, result=plain(FULL)))]


def write(folder: Path, count: int) -> int:
    """The files; how many bytes they have unpacked."""
    folder.mkdir()
    names = [f"{2022 + at // 12}-{at % 12 + 1:02}" for at in range(MONTHS)]
    size, made = 0, _templates()
    for number, name in enumerate(names):
        path, packer = folder / f"{name}.jsonl", None
        if number < MONTHS - 2:
            path, packer = folder / f"{name}.jsonl.gz", zlib.compressobj(wbits=16 + zlib.MAX_WBITS)
        with path.open("wb") as file:
            for text in _charges(made, range(number * count // MONTHS, (number + 1) * count // MONTHS), name):
                size += len(text)
                file.write(text if packer is None else packer.compress(text))
            file.write(b"" if packer is None else packer.flush())
    return size


def _templates() -> list[bytes]:
    """The lines of a charge, with marks where charges differ."""
    marked = list[bytes]()
    for record in full_life():
        begin = {"begin": {**as_fields(charge(1).begin), "utc": "UTC", "unix_s": "UNIX"}} if "begin" in record else {}
        head = {"bay": "BAY", "battery": {**record["battery"], "id": "BATTERY"}} if "battery" in record else {}
        marked.append(lines.encoded({**record, **head, **begin, "id": "ID"}).replace(b'"UNIX"', b"UNIX"))
    return marked


def _charges(made: Sequence[bytes], numbers: range, name: str) -> Iterator[bytes]:
    """The lines of a month's charges, one charge after the other."""
    text, start = b"".join(made), unix_s(f"{name}-01T00:00Z")
    for at, number in enumerate(numbers):
        began = start + at * 28 * 86_400 / len(numbers)
        now = text
        for mark, value in (
            ('"ID"', f'"{after("", began, number.to_bytes(CHANCE, "big"))}"'),
            ('"UTC"', f'"{utc(began)}"'),
            ("UNIX", f"{began:.1f}"),
            ('"BAY"', f'"bay-{number % BAYS + 1:02}"'),
            ('"BATTERY"', f'"B-{number % BATTERIES:04}"'),
        ):
            now = now.replace(mark.encode(), value.encode())
        yield now


def measured(*words: str) -> tuple[float, float, float]:
    """Wall and processor seconds of a command, and the peak of all commands so far in MiB."""
    before, begin_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run(
        [sys.executable, "-m", "orchestrator", *words],
        check=True,
        stdout=subprocess.DEVNULL,
        env=os.environ,
    )
    wall_s, now = time.monotonic() - begin_s, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = now.ru_utime + now.ru_stime - before.ru_utime - before.ru_stime
    return wall_s, cpu_s, now.ru_maxrss / 1024


def main(count: int) -> None:
    """Measure."""
    with tempfile.TemporaryDirectory() as name:
        journal = Path(name)
        size = write(journal / "sessions", count)
        packed = sum(path.stat().st_size for path in (journal / "sessions").iterdir())
        print(f"{count:,} charges: {size / 1e9:.2f} GB of records, {packed / 1e6:.0f} MB on disk", flush=True)
        there = ("--journal", name)
        wall_s, cpu_s, peak_mib = measured("sessions", "rebuild", *there)
        index = (journal / "sessions" / NAME).stat().st_size
        print(
            f"rebuild: {wall_s:.1f} s ({cpu_s:.1f} s processor), {peak_mib:.0f} MiB at most; index {index / 1e6:.0f} MB"
        )
        for what, times in WHAT.items():
            runs = [measured(*what.split(), *there) for _ in range(times)]
            wall_s, cpu_s, peak_mib = (min(values) for values in zip(*runs, strict=True))
            print(f"{what}: {wall_s:.2f} s ({cpu_s:.2f} s processor)", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
