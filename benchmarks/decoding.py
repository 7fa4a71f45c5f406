"""Throughput of the frame decoder. One charger sends at most 0.0019 MB/s, 128 of them 0.25 MB/s.

The floor is `bytes.find` walking from start to start over the same bytes. p99 is the slowest of the runs.
"""

import random
from collections.abc import Callable, Iterator, Sequence
from time import perf_counter

from benchmarks.effort import Effort
from benchmarks.report import Result, Series
from orchestrator.protocol.frame import START, Frame, FrameDecoder

SIZE = 200_000
#: A whole status reply: 8 values of two bytes.
REPLY = Frame(0x03, 0x90, bytes.fromhex("13 93 09 07 00 01 00 01 00 03 00 04 00 00 00 01")).encode()
#: A start in every 8 bytes, each with a valid length and an end in its place: only the checksum is wrong.
TRAP = bytes.fromhex("AF FA 90 22 00 00 AF A0")


def measure(effort: Effort) -> Iterator[Result]:
    """Clean frames, in chunks and byte by byte; garbage; the worst case we could think of."""
    runs = effort.choose(40, 5)
    garbage = random.Random(1).randbytes(SIZE)  # noqa: S311 - noise, no secret
    cases = (
        ("clean frames, one a read", _filled(REPLY), len(REPLY)),
        ("clean frames, byte by byte", _filled(REPLY), 1),
        ("random garbage, 64 a read", garbage, 64),
        ("all false starts, 64 a read", _filled(TRAP), 64),
    )
    for name, data, size in cases:
        chunks = [data[at : at + size] for at in range(0, len(data), size)]
        ours = Series("ours", _speeds(_decode, chunks, runs), more_is_better=True)
        floor = Series("bytes.find", _speeds(_find, [data], runs), more_is_better=True)
        yield Result(f"decoder, {name}", "MB/s", ours, floor)


def _filled(pattern: bytes) -> bytes:
    return pattern * (SIZE // len(pattern))


def _speeds(work: Callable[[Sequence[bytes]], None], chunks: Sequence[bytes], runs: int) -> list[float]:
    total = sum(map(len, chunks))
    samples = []
    for _ in range(runs):
        begin_s = perf_counter()
        work(chunks)
        samples.append(total / (perf_counter() - begin_s) / 1e6)
    return samples


def _decode(chunks: Sequence[bytes]) -> None:
    decoder = FrameDecoder()
    for chunk in chunks:
        decoder.feed(chunk)


def _find(chunks: Sequence[bytes]) -> None:
    for chunk in chunks:
        at = chunk.find(START)
        while at >= 0:
            at = chunk.find(START, at + 1)
