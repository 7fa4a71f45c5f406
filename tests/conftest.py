"""Settings for all tests, however they are started and however busy the machine.

Signals ignored by the starter (`nohup`, a background job) are enabled again: an ignored signal stays ignored in all
child processes, and some tests end a service by a signal. Generated examples have no deadline: on a busy machine a slow
one says nothing about the code.
"""

import signal

import pytest
from hypothesis import settings

from tests.ids import name_of

#: The longest files start first, so that the run does not end waiting for them alone: in turn one that waits for real
#: processes and one that computes, so that both are under way at any time.
LONG = (
    "whole/test_operator.py", "proof/test_seeded_bugs.py", "whole/test_survives.py", "proof/test_grid.py",
    "guardian/test_kills.py", "workbench/test_exhaustive.py", "whole/test_ends.py", "proof/test_environment.py",
    "guardian/test_estop.py", "proof/test_campaign.py", "whole/test_charge.py", "proof/test_explore.py",
    "tests/test_surroundings.py", "workbench/test_leap.py", "whole/test_beginning.py", "core/test_decide.py",
    "guardian/test_emergency.py", "proof/test_nth_call.py", "guardian/test_laststop.py",
    "workbench/test_ordinary_charges.py", "whole/test_identity.py", "fuzz/test_short.py", "whole/test_faults.py",
    "proof/test_others_on_the_bus.py", "whole/test_korean.py", "core/test_persisted.py", "whole/test_others.py",
    "proof/test_gist.py", "devices/test_battery_bus.py", "proof/test_journal_size.py", "whole/test_demo.py",
    "workbench/test_replay.py", "tests/test_benchmarks.py", "proof/test_soak.py", "whole/test_start.py",
    "core/test_honest.py", "guardian/test_estop_alone.py", "core/test_faults.py", "whole/test_who.py",
)  # fmt: skip

#: What ends a service, or has it read its files again.
ENDS = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM)


def enable_signals() -> None:
    """As a process that is started from a terminal has them: children inherit what is ignored or blocked."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDS)
    for number in ENDS:
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler if number is signal.SIGINT else signal.SIG_DFL)


enable_signals()

settings.register_profile("all", deadline=None)
settings.load_profile("all")


def pytest_runtest_setup() -> None:
    """What runs in this process may have changed them, and any file may come next."""
    enable_signals()


def pytest_make_parametrize_id(val: object) -> str | None:
    """Readable ids where a table has none."""
    return name_of(val)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """With files in parallel, the longest first."""
    places = {name: at for at, name in enumerate(LONG)}
    items.sort(key=lambda item: places.get("/".join(item.path.parts[-2:]), len(LONG)))
