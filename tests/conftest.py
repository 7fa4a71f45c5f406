"""What holds for all tests, whoever starts them and on however busy a machine.

Signals that the starter has ignored (`nohup`, a job in the background) are heard again: what is ignored stays ignored
in all child processes, and ending a service by a signal is what some tests are about. Generated examples have no
deadline: on a busy machine a slow one says nothing of the code.
"""

import signal

import pytest
from hypothesis import settings

from tests.ids import name_of

#: What takes longest begins first, so that nobody waits for it alone at the end.
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
    """Ids that can be read, where a table has none of its own."""
    return name_of(val)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files side by side: the longest first."""
    items.sort(key=lambda item: next((at for at, name in enumerate(LONG) if item.path.as_posix().endswith(name)), 99))
