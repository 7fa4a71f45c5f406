"""Files in the working directory, and the kind of terminal or pipe, change nothing."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

from orchestrator.config.shipped import shipped_dir
from tests.whole.station import die_with_parent

ROOT = Path(__file__).resolve().parent.parent
STATION = shipped_dir() / "configs" / "stations" / "one-bay.yaml"
#: Names of modules imported by any of our verbs.
TRAPS = (
    "serial",
    "yaml",
    "can",
    "canopen",
    "transitions",
    "durand",
    "rich",
    "json",
    "argparse",
    "selectors",
    "queue",
    "logging",
    "signal",
    "socket",
)

#: As a console script, and by the interpreter.
WAYS = {
    "module": ("-m", "orchestrator"),
    "script": ("-c", "import sys; from orchestrator.__main__ import main; sys.exit(main())"),
}


@pytest.fixture(name="folder")
def _folder(tmp_path: Path) -> Path:
    """A directory with foreign files named like modules we import."""
    for name in TRAPS:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'RAN')!r}, 'a').write('{name} ')", encoding="utf-8")
    return tmp_path


def begun(
    way: str, folder: Path, words: Sequence[str], env: Mapping[str, str] | None = None, **streams: int
) -> "subprocess.Popen[str]":
    process: subprocess.Popen[str] = subprocess.Popen(
        [sys.executable, *(("-P",) if way == "script" else ()), *WAYS[way], *words],
        env={**os.environ, "PYTHONPATH": str(ROOT), "ORCHESTRATOR_SOCKET": str(folder / "no.sock"), **(env or {})},
        cwd=folder,
        text=True,
        encoding="utf-8",
        errors="replace",
        preexec_fn=die_with_parent,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams},  # type: ignore[call-overload]
    )
    return process


def done(process: "subprocess.Popen[str]") -> subprocess.CompletedProcess[str]:
    try:
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


def run(
    way: str, folder: Path, *words: str, env: Mapping[str, str] | None = None, **streams: int
) -> subprocess.CompletedProcess[str]:
    return done(begun(way, folder, words, env, **streams))


def run_beside_each_other(
    way: str, folder: Path, words: Sequence[str], variable: str, values: Sequence[str]
) -> Iterator[subprocess.CompletedProcess[str]]:
    """With each value of an environment variable: some of these verbs wait for devices."""
    for process in [begun(way, folder, words, {variable: value}) for value in values]:
        yield done(process)


#: Verbs that get far without devices.
VERBS: tuple[tuple[str, ...], ...] = (
    ("status",),
    ("stop", "--all"),
    ("check", str(STATION)),
    ("probe", str(STATION)),
    ("estop", str(STATION)),
    ("run", "nowhere.yaml"),
    ("schema", "station"),
    ("demo", "--fault", "list"),
)


#: PYTHONPATH may name the working directory, too.
PATHS = (str(ROOT), f"{os.pathsep}{ROOT}", f"{ROOT}{os.pathsep}.")


@pytest.mark.parametrize("words", VERBS, ids=lambda words: words[0])
@pytest.mark.parametrize("way", WAYS)
def test_nothing_in_the_working_directory_is_run(way: str, words: tuple[str, ...], folder: Path) -> None:
    for ended in run_beside_each_other(way, folder, words, "PYTHONPATH", PATHS):
        assert not (folder / "RAN").exists(), (folder / "RAN").read_text(encoding="utf-8")
        assert "Traceback" not in ended.stderr


def test_with_p_not_even_what_python_itself_begins_with(tmp_path: Path) -> None:
    """With `-m` alone, Python imports these from the working directory before any of our code runs."""
    for name in ("pkgutil", "collections", "functools", "warnings", "types"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'RAN')!r}, 'a').write('{name}')", encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-P", *WAYS["module"], "schema", "station"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
        capture_output=True,
        timeout=30,
        check=False,
    )
    assert ended.returncode == 0
    assert not (tmp_path / "RAN").exists()


def test_nor_by_the_processes_that_are_started(folder: Path) -> None:
    """The controller is a separate process; its station exists, its devices do not."""
    station = STATION.read_text(encoding="utf-8").replace("interface: socketcan", "interface: virtual")
    (folder / "station.yaml").write_text(station, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, *WAYS["module"], "run"],
        env={**os.environ, "PYTHONPATH": f"{os.pathsep}{ROOT}"},
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=die_with_parent,
    )
    try:
        assert process.stderr is not None
        lines = [process.stderr.readline() for _ in range(3)]
        assert "OFFLINE" in lines[-1], lines  # it has opened ports and buses
    finally:
        process.terminate()
        process.communicate(timeout=20)
    assert not (folder / "RAN").exists(), (folder / "RAN").read_text(encoding="utf-8")


@pytest.mark.parametrize("words", [*VERBS, ("--help",), ("estop", "--help"), ("check", "ungültig\udc80.yaml")], ids=str)
def test_no_terminal_is_too_poor(words: tuple[str, ...], tmp_path: Path) -> None:
    for ended in run_beside_each_other("module", tmp_path, words, "PYTHONIOENCODING", ("ascii", "latin-1", "utf-8")):
        assert "Traceback" not in ended.stderr
        assert ended.stdout or ended.stderr or ended.returncode == 0


@pytest.mark.parametrize("words", [("schema", "policy"), ("schema", "station")], ids=str)
def test_json_stays_what_it_is_on_every_terminal(words: tuple[str, ...], tmp_path: Path) -> None:
    encodings = ("utf-8", "ascii", "latin-1", "euc-kr")
    rich, *poor = run_beside_each_other("module", tmp_path, words, "PYTHONIOENCODING", encodings)
    assert not rich.stdout.isascii(), "else this shows nothing"
    for ended in poor:
        assert json.loads(ended.stdout) == json.loads(rich.stdout)


@pytest.mark.parametrize(
    "words", [("demo", "--fault", "list"), ("schema", "station"), ("check", "none.yaml"), ("--version",)], ids=str
)
def test_an_output_that_takes_nothing_is_told_without_a_traceback(words: tuple[str, ...], tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        ended = run("module", tmp_path, *words, stdout=full.fileno())
    assert "Traceback" not in ended.stderr and "Exception ignored" not in ended.stderr
    lines = ended.stderr.splitlines()
    assert lines[-1:] == ["orchestrator: the output could not be written, and is not complete: No space left on device"]
    assert ended.returncode == 1
    reader, writer = os.pipe()
    os.close(reader)
    try:
        ended = run("module", tmp_path, *words, stdout=writer)
    finally:
        os.close(writer)
    assert "Traceback" not in ended.stderr and "Exception ignored" not in ended.stderr


def test_streams_that_are_closed_are_no_error(tmp_path: Path) -> None:
    script = '"$0" -m orchestrator "$@" <&- >&- 2>&-'
    for words, status in ((("schema", "station"), 0), (("status", "--watch"), 2), (("check", "none.yaml"), 1)):
        ended = subprocess.run(
            ["/bin/sh", "-c", script, sys.executable, *words],
            env={**os.environ, "PYTHONPATH": str(ROOT), "ORCHESTRATOR_SOCKET": "none.sock"},
            cwd=tmp_path,
            timeout=30,
            check=False,
        )
        assert ended.returncode == status, words
