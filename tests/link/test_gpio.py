"""The GPIO line where none is available: the sentence for every error reported by the library."""

import errno
import os
import sys
from pathlib import Path

import gpiod
import pytest

from orchestrator.errors import LinkError
from orchestrator.link import gpio
from orchestrator.link.gpio import OutputLine, describe


def failures(chip: str, line: int) -> set[str]:
    """The messages of taking the line and of only looking at it."""
    said = set()
    for attempt in (lambda: OutputLine.open(chip, line, active_low=False), lambda: describe(chip, line)):
        with pytest.raises(LinkError) as caught:
            attempt()
        said.add(str(caught.value))
    return said


def test_a_chip_that_is_not_there(tmp_path: Path) -> None:
    chip = str(tmp_path / "gpiochip9")
    assert failures(chip, 17) == {f"{chip} line 17: {gpio._NO_CHIP}"}


def test_a_file_and_a_device_that_are_no_chips(tmp_path: Path) -> None:
    file = tmp_path / "gpiochip0"
    file.touch()
    assert failures(str(file), 17) == {f"{file} line 17: {gpio._NO_CHIP}"}
    assert failures(os.devnull, 17) == {f"/dev/null line 17: {gpio._GONE}"}


@pytest.mark.parametrize(
    ("number", "sentence"),
    [
        (errno.EACCES, gpio._FORBIDDEN),
        (errno.EBUSY, gpio._BUSY),
        (errno.EINVAL, gpio._NO_LINE),
        (errno.ENODEV, gpio._GONE),
        (errno.ENOMEM, "cannot be driven (Cannot allocate memory)"),
    ],
)
def test_what_the_kernel_says_is_told_with_what_to_do(
    number: int, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(gpiod, "request_lines", refuse)
    monkeypatch.setattr(gpiod, "Chip", refuse)
    assert failures("/dev/gpiochip0", 17) == {f"/dev/gpiochip0 line 17: {sentence}"}


def test_a_line_that_the_library_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise ValueError("line offset of out range")

    monkeypatch.setattr(gpiod, "request_lines", refuse)
    monkeypatch.setattr(gpiod, "Chip", refuse)
    assert failures("/dev/gpiochip0", 99) == {f"/dev/gpiochip0 line 99: {gpio._NO_LINE}"}


def test_without_the_library_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gpiod", None)
    (said,) = failures("/dev/gpiochip0", 17)
    assert "pip install 'charging-station-orchestrator[gpio]'" in said
