"""`orchestrator estop` from inside: what a process of its own cannot be brought to, or only by luck."""

import errno
import importlib.abc
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from orchestrator.lastresort import inhand, lastopen
from orchestrator.lastresort.estop import UNTOLD, main
from orchestrator.lastresort.estop_options import Options
from tests.guardian.chargers import Bench, running_chargers

DONE = "every charger stands by, verified"


@pytest.fixture(autouse=True)
def _no_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ORCHESTRATOR_SOCKET", "")


def station_file(path: Path, bench: Bench | None, more: str = "") -> str:
    bays = f"[{{name: bay-1, {more}charger: {{port: {bench.name}}}}}]" if bench is not None else "[]"
    path.write_text(f"bays: {bays}\ncontrol: {{socket: none}}\njournal: {{directory: ''}}\n")
    return str(path)


@pytest.mark.parametrize("empty_first", [True, False])
def test_of_the_stations_that_may_be_meant_those_with_chargers_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], *, empty_first: bool
) -> None:
    with running_chargers(tmp_path) as (bench,):
        empty, meant = station_file(tmp_path / "empty.yaml", None), station_file(tmp_path / "meant.yaml", bench)
        together = [empty, meant] if empty_first else [meant, empty]
        monkeypatch.setattr(inhand, "stations", lambda: iter([[], together]))
        assert main([]) == 0
    said = capfd.readouterr()
    assert said.out.splitlines() == [f"bay-1 ({bench.name}): standby verified", DONE]
    assert f"station file: {meant}\n" in said.err
    assert empty not in said.err


def test_without_any_station_it_says_that_it_has_stopped_nothing(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(inhand, "stations", lambda: iter([[], []]))
    assert main([]) == 1
    said = capfd.readouterr()
    assert (said.out, said.err) == ("", "no port to stop: name a station file or --port PATH\n")


@pytest.mark.parametrize(("takes_s", "became"), [(1.2, "open"), (30.0, "its driver hangs")])
def test_a_contactors_driver_is_waited_for_a_moment(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    takes_s: float,
    became: str,
) -> None:
    """The chargers have stood by for a second by then."""
    over = Event()

    def opens(*_: object, **__: object) -> str:
        over.wait(takes_s)
        return "open"

    monkeypatch.setattr(lastopen, "request", opens)
    with running_chargers(tmp_path) as (bench,):
        assert main([station_file(tmp_path / "s.yaml", bench, "contactor: {chip: ./chip, line: 1}, ")]) == 0
    over.set()
    assert f"contactor on {tmp_path}/chip line 1: {became}" in capfd.readouterr().out


class NothingMoreOpens(importlib.abc.MetaPathFinder):
    """As where as many files are open as may be: a module that is not loaded yet cannot be."""

    def find_spec(self, name: str, *_: Sequence[str] | Any) -> None:
        if name == "orchestrator.lastresort.running_service":
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))


@pytest.fixture
def _full(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.delitem(sys.modules, "orchestrator.lastresort.running_service", raising=False)
    finder = NothingMoreOpens()
    sys.meta_path.insert(0, finder)
    yield
    sys.meta_path.remove(finder)


@pytest.mark.usefixtures("_full")
def test_where_the_services_cannot_be_told_the_chargers_are_stopped(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with running_chargers(tmp_path) as (bench,):
        assert main(["--port", bench.name]) == 1
        assert not bench.runs
    assert capfd.readouterr().out.splitlines() == [
        f"{bench.name}: standby verified",
        f"{UNTOLD} (Too many open files)",
    ]


@pytest.mark.parametrize(
    ("words", "because"),
    [
        (["a.yaml"], ""), (["--because", "smoke", "a.yaml"], "smoke"), (["a.yaml", "--because", "--port"], "--port"),
        (["a.yaml", "--because"], ""),
    ],
)  # fmt: skip
def test_nothing_that_is_said_beside_it_refuses_an_emergency_stop(words: list[str], because: str) -> None:
    options = Options(words)
    assert (options.wrong, options.because, options.stations, options.ports) == ("", because, ["a.yaml"], [])
