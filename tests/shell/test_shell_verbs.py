"""Help, completion and the manual page are made from one parser, and the examples in them are right."""

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from orchestrator.cli import _parser, main
from orchestrator.lastresort.estop_options import USAGE, Options
from orchestrator.service.reception import Answer
from orchestrator.shell.commands import actions_of, verbs_of
from orchestrator.shell.completion import SHELLS, script
from orchestrator.shell.examples import EXAMPLES
from orchestrator.shell.manpage import manpage
from tests.service.control_bench import listening

VERBS = verbs_of(_parser())
OPTIONS = sorted({one for verb in VERBS.values() for action in actions_of(verb) for one in action.option_strings})


def test_every_verb_has_examples() -> None:
    assert list(EXAMPLES.keys() ^ VERBS.keys()) == []


@pytest.mark.parametrize("command", [command for examples in EXAMPLES.values() for command, _ in examples])
def test_an_example_is_a_valid_command_line(command: str) -> None:
    words = shlex.split(command.partition(" > ")[0])
    if words[0] == "estop":
        assert not Options(words[1:]).wrong
    assert _parser().parse_args(words)


@pytest.mark.parametrize("verb", VERBS)
def test_help_ends_with_examples(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        _parser().parse_args([verb, "--help"])
    said = capsys.readouterr().out
    assert f"\nexamples:\n  orchestrator {verb}" in said


def test_estop_s_own_help_has_the_same_options_and_examples() -> None:
    for action in actions_of(VERBS["estop"]):
        assert all(name in USAGE for name in action.option_strings if name not in ("-h", "--help"))
    assert all(f"  orchestrator {command}\n" in USAGE for command, _ in EXAMPLES["estop"])


@pytest.mark.skipif(shutil.which("man") is None, reason="no man")
def test_the_manual_has_every_verb_and_option(tmp_path: Path) -> None:
    page = tmp_path / "orchestrator.1"
    page.write_text(manpage(_parser()), encoding="utf-8")
    environment = {**os.environ, "MANWIDTH": "200", "LC_ALL": "C.UTF-8", "MAN_KEEP_FORMATTING": "", "MANPAGER": "cat"}
    done = subprocess.run(
        ["man", "--warnings", "-l", str(page)], capture_output=True, text=True, env=environment, check=True, timeout=60
    )
    assert done.stderr == ""
    assert [name for name in [*VERBS, *OPTIONS] if name not in done.stdout and name != "--help"] == []
    assert [name for name in VERBS if f"\n   {name}\n" not in done.stdout] == []
    assert "orchestrator stop bay-1 --because 'wet floor'" in done.stdout.replace("’", "'").replace("‘", "'")


def test_the_verb_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["manpage"]) == 0
    assert capsys.readouterr().out == manpage(_parser())


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_has_every_verb_and_option(shell: str) -> None:
    pytest.importorskip("shtab")
    text = script(_parser(), shell)
    long = [name.removeprefix("--") for name in OPTIONS if name.startswith("--")]
    assert [name for name in [*VERBS, *long] if name not in text] == []


#: Completes the last of these words with the script on standard input.
BASH = """
source /dev/stdin
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
_shtab_orchestrator "$1" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["sta"], {"status", "start"}),
        (["start", "--f"], {"--force"}),
        (["completion", ""], {"bash", "zsh", "fish", "bays"}),
        (["stop", "bay-"], {"bay-1", "bay-2"}),
    ],
)
def test_bash_completes(tmp_path: Path, words: list[str], found: set[str]) -> None:
    pytest.importorskip("shtab")
    program = tmp_path / "orchestrator"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m orchestrator "$@"\n')
    program.chmod(0o755)

    def answer(_: Mapping[str, object]) -> Answer:
        return {"bays": [{"name": "bay-1"}, {"name": "bay-2"}]}

    path = tmp_path / "run" / "control.sock"
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "ORCHESTRATOR_SOCKET": str(path)}
    with listening(path, answer):
        done = subprocess.run(
            ["bash", "-c", BASH, "bash", "orchestrator", *words], input=script(_parser(), "bash"),
            capture_output=True, text=True, env=environment, timeout=60, check=False,
        )  # fmt: skip
    assert done.stderr == ""
    assert set(done.stdout.split()) == found


def test_without_its_package_it_says_what_to_type(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "bash"]) == 1
    assert capsys.readouterr().err.startswith("orchestrator: completion needs the package shtab: ")
