"""A pty, an independent fake charger on it, and a port that polls it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.devices.fake_charger import FakeCharger, charger_on
from tests.devices.port_bench import Bench, running
from tests.link.ptys import Pty, plugged


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[Pty]:
    with plugged(tmp_path / "port") as made:
        yield made


@pytest.fixture
def charger(pty: Pty) -> Iterator[FakeCharger]:
    with charger_on(pty) as made:
        yield made


@pytest.fixture
def bench(pty: Pty, charger: FakeCharger) -> Iterator[Bench]:
    """A port that only polls; its first stop is over."""
    with running(pty.path) as made:
        made.wait_online(command=None)
        yield made
