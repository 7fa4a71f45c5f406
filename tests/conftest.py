"""Settings for all tests, however they are started and however busy the machine.

Signals ignored by the starter (`nohup`, a background job) are enabled again: an ignored signal stays ignored in all
child processes, and some tests end a service by a signal. Generated examples have no deadline: on a busy machine a slow
one says nothing about the code.
"""

import signal

import pytest
from hypothesis import settings

from tests.ids import name_of

#: The longest tests start first, so that the run does not end waiting for them alone.
LONG = (
    "proof/test_explore.py", "whole/test_faults.py", "proof/test_seeded_bugs.py", "workbench/test_exhaustive.py",
    "proof/test_grid.py", "whole/test_survives.py", "proof/test_environment.py", "whole/test_operator.py",
    "proof/test_nth_call.py", "whole/test_ends.py", "guardian/test_estop.py", "core/test_witnesses.py",
)  # fmt: skip

for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.default_int_handler if number is signal.SIGINT else signal.SIG_DFL)

settings.register_profile("all", deadline=None)
settings.load_profile("all")


def pytest_make_parametrize_id(val: object) -> str | None:
    """Readable ids where a table has none."""
    return name_of(val)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """With files in parallel, the longest first."""
    items.sort(key=lambda item: next((at for at, name in enumerate(LONG) if item.path.as_posix().endswith(name)), 99))
