"""A control socket that answers."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.service.control_bench import listening


@pytest.fixture(name="path")
def _path(tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "run" / "control.sock"
    with listening(path):
        yield path
