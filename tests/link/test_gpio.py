"""The GPIO line where there is none to be had: the id_ for everything that goes wrong, as the library says it."""

import errno
import os
import sys
from pathlib import Path

import gpiod
import pytest

from orchestrator.errors import LinkError
from orchestrator.link.gpio import OutputLine, describe, need_gpiod
from tests.core.said import say


def failures(chip: str, line: int) -> set[str]:
    """The cause of not being able to take the line, and of not even being able to look at it."""
    said = set()
    for attempt in (lambda: OutputLine.open(chip, line, active_low=False), lambda: describe(chip, line)):
        with pytest.raises(LinkError) as caught:
            attempt()
        cause = caught.value.cause
        assert say(cause).startswith(f"{chip} line {line}: ") or not cause.params
        said.add(cause.id)
    return said


def test_a_chip_that_is_not_there(tmp_path: Path) -> None:
    chip = str(tmp_path / "gpiochip9")
    assert failures(chip, 17) == {"gpio_missing"}


def test_a_file_and_a_device_that_are_no_chips(tmp_path: Path) -> None:
    file = tmp_path / "gpiochip0"
    file.touch()
    assert failures(str(file), 17) == {"gpio_missing"}
    assert failures(os.devnull, 17) == {"gpio_gone"}


@pytest.mark.parametrize(
    ("number", "id_"),
    [
        (errno.EACCES, "gpio_forbidden"),
        (errno.EBUSY, "gpio_busy"),
        (errno.EINVAL, "gpio_no_line"),
        (errno.ENODEV, "gpio_gone"),
        (errno.ENOMEM, "gpio_failed"),
    ],
)
def test_what_the_kernel_says_is_told_with_what_to_do(number: int, id_: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(gpiod, "request_lines", refuse)
    monkeypatch.setattr(gpiod, "Chip", refuse)
    assert failures("/dev/gpiochip0", 17) == {id_}


def test_a_line_that_the_library_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise ValueError("line offset of out range")

    monkeypatch.setattr(gpiod, "request_lines", refuse)
    monkeypatch.setattr(gpiod, "Chip", refuse)
    assert failures("/dev/gpiochip0", 99) == {"gpio_no_line"}


def test_without_the_library_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gpiod", None)
    for attempt in (need_gpiod, lambda: describe("/dev/gpiochip0", 17)):
        with pytest.raises(LinkError) as caught:
            attempt()
        assert f"needs the package gpiod: {sys.executable} -m pip install 'gpiod<3,>=2.2'" in say(caught.value.cause)
