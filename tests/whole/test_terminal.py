"""What an operator sees at a terminal: a real one, a poor one, a pipe, and none at all."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import cast

import pytest

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.sim.client import PlantProcess
from tests.waiting import wait_until
from tests.whole.station import Document, Service, die_with_parent, orchestrator, whole_station
from tests.whole.terminal import Terminal

Station = tuple[PlantProcess, Service]
ENGLISH, KOREAN = {"LC_ALL": "C.UTF-8"}, {"LC_ALL": "ko_KR.UTF-8"}


def korean(document: Document) -> None:
    """The fourth bay's port does not exist."""
    document["language"] = "ko"
    document["bays"][3]["charger"]["port"] += "-missing"


@pytest.fixture(name="station", scope="module")
def _station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    with whole_station(tmp_path_factory.mktemp("terminal"), 4, change=korean) as (plant, service):
        service.start().wait("CHARGING", ["bay-1", "bay-2", "bay-3"])
        yield plant, service


def cli(service: Service, *words: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """One verb, in English unless told otherwise."""
    return orchestrator(*words, env={"ORCHESTRATOR_SOCKET": str(service.socket), **(env or ENGLISH)})


def states(service: Service) -> list[str]:
    return [bay["state"] for bay in service.status().values()]


KNOWN = "bay-1, bay-2, bay-3, bay-4"


# --- whether somebody must look --------------------------------------------------------------------------------------


def test_a_script_learns_whether_somebody_must_look(station: Station) -> None:
    plant, service = station
    assert cli(service, "status", "--check").returncode == 0
    calm = cli(service, "status", "--problems")
    assert calm.stdout.splitlines()[1:] == ["no bay needs a person"] and calm.returncode == 0
    plant.inject("status_bits", 2)
    service.wait("TRIPPED", ["bay-2"])
    assert cli(service, "status", "--check").returncode == 1
    assert cli(service, "status", "--check", "bay-[13]").returncode == 0
    gist, head, *bays = cli(service, "status", "--problems").stdout.splitlines()
    assert re.match(r"4 bays: 2 charging, 1 needs you, 1 offline; [\d.]+ A, [\d.]+ kW · ", gist)
    assert head.startswith("   BAY") and [line[:8] for line in bays] == ["!  bay-2"]
    document = json.loads(cli(service, "status", "--problems", "--json", "--check").stdout)
    assert [bay["name"] for bay in document["bays"]] == ["bay-2"]


def test_that_nobody_can_tell_is_another_answer(station: Station) -> None:
    _, service = station
    unknown = cli(service, "status", "--check", "bay-9", env=KOREAN)
    assert (unknown.returncode, unknown.stderr) == (2, f"orchestrator: 'bay-9' 베이가 없습니다: {KNOWN}\n")
    assert cli(service, "status", "--check", "--socket", "/nowhere.sock").returncode == 2
    assert cli(service, "status", "--check", "--watch").returncode == 2
    assert cli(service, "status", "bay-9").returncode == 1
    assert cli(service, "stop", "bay-1", "--socket", "/nowhere.sock").returncode == 2


# --- names and patterns ----------------------------------------------------------------------------------------------


def test_bays_are_shown_by_names_patterns_and_exceptions(station: Station) -> None:
    _, service = station

    def shown(*words: str) -> list[str]:
        return [bay["name"] for bay in json.loads(cli(service, "status", "--json", *words).stdout)["bays"]]

    assert shown("bay-3", "bay-1") == shown("bay-[13]") == shown("--except", "bay-2", "bay-4") == ["bay-1", "bay-3"]
    assert shown("bay-*", "--except", "bay-[!4]") == ["bay-4"]
    assert shown("--except", "bay-4") == ["bay-1", "bay-2", "bay-3"]
    wrong = cli(service, "status", "bay-1", "x*", "--except", "bay-7")
    assert (wrong.returncode, wrong.stdout) == (1, "")
    assert wrong.stderr == f"orchestrator: no bays 'x*', 'bay-7' here: {KNOWN}\n"
    none = cli(service, "status", "--except", "bay-*")
    assert (none.returncode, none.stderr) == (1, "orchestrator: --except leaves no bay\n")


@pytest.mark.parametrize(
    ("words", "stderr"),
    [
        (["bay-9", "bay-1"], f"no bay 'bay-9' here: {KNOWN}\n"),
        (["x*", "bay-[1]"], f"no bay 'x*' here: {KNOWN}\n"),
        (["--all", "--except", "bay-[2-4]", "bay-9"], f"no bay 'bay-9' here: {KNOWN}\n"),
    ],
    ids=["a name", "a pattern", "an exception"],
)
def test_a_stop_is_never_left_undone_for_what_is_unknown(station: Station, words: list[str], stderr: str) -> None:
    plant, service = station
    service.ask("start", "bay-1")
    service.wait("CHARGING")
    done = cli(service, "stop", *words)
    assert plant.state(1)["operation"] == 0
    assert (done.returncode, done.stdout) == (1, "bay-1: stop accepted; stands by, verified\n")
    assert done.stderr == stderr
    assert states(service)[0] == "HELD"
    assert states(service)[2] == "CHARGING"


def test_programs_that_ask_the_service_are_served_alike(station: Station) -> None:
    _, service = station
    service.ask("start", "bay-1")
    service.wait("CHARGING")
    answer = ask(service.socket, {"verb": "stop", "bays": ["bay-9", ["bay-1"], "bay-1"]})
    results = cast("dict[str, str]", answer["results"])
    assert results.pop("bay-1") == ""
    assert results == {"bay-9, ['bay-1']": f"'bay-9', '['bay-1']' 베이가 없습니다: {KNOWN}"}
    with pytest.raises(ServiceError, match="bay-9"):
        ask(service.socket, {"verb": "start", "bays": ["bay-9", "bay-1"]})
    service.wait("HELD")


@pytest.mark.parametrize("verb", ["start", "reset", "pause"])
@pytest.mark.parametrize("words", [["bay-1", "bay-9"], ["bay-[13]", "x*"], ["--all", "--except", "bay-9"]], ids=str)
def test_any_other_request_is(station: Station, verb: str, words: list[str]) -> None:
    _, service = station
    before = states(service)
    done = cli(service, verb, *words)
    assert (done.returncode, done.stdout) == (1, "")
    missing = "x*" if "x*" in words else "bay-9"
    assert done.stderr == f"orchestrator: no bay '{missing}' here: {KNOWN}; {verb} was carried out at no bay\n"
    assert states(service) == before


def test_a_stop_of_nothing_says_so(station: Station) -> None:
    _, service = station
    for words in (["bay-9"], ["x*"]):
        done = cli(service, "stop", *words)
        assert done.returncode == 1
        assert done.stderr == f"orchestrator: no bay '{words[0]}' here: {KNOWN}; stop was carried out at no bay\n"
    done = cli(service, "stop", "bay-1", "--except", "bay-1")
    assert done.stderr == "orchestrator: --except leaves no bay; stop was carried out at no bay\n"
    assert cli(service, "stop", "--except", "bay-1").returncode == 2
    assert cli(service, "reset", "--port", "/dev/x", "--except", "bay-1").returncode == 2


def test_all_but_some_are_paused_and_started(station: Station) -> None:
    plant, service = station
    service.ask("start", "bay-1")
    service.wait("CHARGING", ["bay-1", "bay-3"])
    done = cli(service, "pause", "--all", "--except", "bay-[24]")
    assert done.stdout == "".join(f"bay-{bay}: pause accepted; stands by, verified\n" for bay in (1, 3))
    assert (done.returncode, plant.state(1)["operation"], plant.state(3)["operation"]) == (0, 0, 0)
    assert cli(service, "start", "bay-[13]").returncode == 0
    service.wait("CHARGING", ["bay-1", "bay-3"])


# --- the terminal ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("env", [ENGLISH, KOREAN], ids=["en", "ko"])
@pytest.mark.parametrize("columns", [60, 200])
def test_a_terminal_never_wraps_a_line(station: Station, columns: int, env: dict[str, str]) -> None:
    _, service = station
    with Terminal(40, columns, "status", env={**env, "ORCHESTRATOR_SOCKET": str(service.socket)}) as terminal:
        assert terminal.end() == 0
        assert "!  bay-2" in terminal.shown()
        assert terminal.screen.wrapped == terminal.screen.scrolled == 0
        assert terminal.screen.codes == ["33", "0"] * (len(terminal.screen.codes) // 2)


@pytest.mark.parametrize("env", [{"NO_COLOR": "1"}, {"TERM": "dumb"}], ids=str)
def test_colour_is_not_for_everybody(station: Station, env: dict[str, str]) -> None:
    _, service = station
    with Terminal(40, 200, "status", env={"ORCHESTRATOR_SOCKET": str(service.socket), **env}) as terminal:
        assert terminal.end() == 0
        assert "!  bay-2" in terminal.shown() and terminal.screen.codes == []


def test_who_watches_sees_no_more_than_fits_and_leaves_quietly(station: Station) -> None:
    _, service = station
    env = {**KOREAN, "ORCHESTRATOR_SOCKET": str(service.socket)}
    with Terminal(8, 60, "status", "--watch", env=env) as terminal:
        terminal.wait_for("… 외 ")
        lines = terminal.shown().splitlines()
        assert lines[0].startswith("베이 4개: ") and any(line.startswith("!  bay-2") for line in lines)
        clock = lines[1]
        wait_until(lambda: terminal.shown().splitlines()[1] != clock, 10, "a later time")
        assert terminal.screen.wrapped == terminal.screen.scrolled == 0
        assert terminal.end(b"\x03") == 130
        assert "Traceback" not in terminal.shown()


def test_a_reader_that_leaves_ends_a_watch_quietly(station: Station) -> None:
    _, service = station
    argv = [sys.executable, "-m", "orchestrator", "status", "--watch", "--socket", str(service.socket)]
    with subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=die_with_parent) as watch:
        assert watch.stdout is not None and watch.stderr is not None
        assert b"4" in watch.stdout.readline()
        watch.stdout.close()
        assert watch.stderr.read() == b""
        assert watch.wait(10) == 1


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "euc-kr", "utf-8"])
@pytest.mark.parametrize("language", ["", "C", "ko_KR.UTF-8"])
def test_what_a_terminal_cannot_show_is_replaced(station: Station, encoding: str, language: str) -> None:
    _, service = station
    words = ("status", "--socket", str(service.socket))
    env = {name: value for name, value in os.environ.items() if name not in ("LC_ALL", "LC_MESSAGES", "LANG")}
    env |= {"PYTHONIOENCODING": encoding} | ({"LANG": language} if language else {})
    for more in ((), ("--json",)):
        done = subprocess.run(
            [sys.executable, "-m", "orchestrator", *words, *more], env=env, capture_output=True, timeout=30, check=False
        )
        text = done.stdout.decode(encoding)
        assert (done.returncode, done.stderr) == (0, b"")
        if more:
            assert len(json.loads(text)["bays"]) == 4
            continue
        is_korean = language != "C" and encoding in ("euc-kr", "utf-8")
        assert text.startswith("베이 4개: " if is_korean else "4 bays: ")
        assert "\\u" not in text and "\\x" not in text and "?" not in text
        assert len({line.index("8.") for line in text.splitlines() if " 48." in line}) == 1  # columns stay columns


def test_who_watches_is_told_since_when_there_is_no_answer(station: Station) -> None:
    """The last one here."""
    _, service = station
    env = {**ENGLISH, "ORCHESTRATOR_SOCKET": str(service.socket)}
    with Terminal(30, 100, "status", "--watch", env=env) as terminal:
        terminal.wait_for("4 bays: ")
        service.signal(signal.SIGTERM)
        service.ended()
        terminal.wait_for("no answer since ")
        lost = terminal.shown().splitlines()
        assert lost[0][:24] == f"no answer since {lost[0][16:24]}" and lost[1].endswith(lost[0][16:24])
        assert "bay-4" in terminal.shown()
        service.start()
        wait_until(lambda: "no answer" not in terminal.shown(), 20, "the return")
        assert terminal.shown().startswith("4 bays: ")
        assert terminal.end(b"\x03") == 130
