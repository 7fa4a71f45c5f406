"""The service, whose threads tell the kernel their names, so that `top -H` and the profile know which is which.

    python -m benchmarks.named STATION

Python does so itself from 3.14 on.
"""

import runpy
import sys
import threading
from pathlib import Path

from orchestrator.lastresort.guardian import guard

CONTROLLER = "orchestrator.service.controller"


def main() -> int:
    """Be the guardian, or the controller that it starts."""
    if sys.argv[1] != CONTROLLER:
        return guard(sys.argv[1:], ("-m", "benchmarks.named", CONTROLLER))
    del sys.argv[1]
    threading.setprofile(_name)
    runpy.run_module(CONTROLLER, run_name="__main__", alter_sys=True)
    return 0


def _name(*_: object) -> None:
    """A thread's first call of any function; afterwards it is not observed any more."""
    sys.setprofile(None)
    name = threading.current_thread().name.encode()[:15]  # as much as the kernel takes
    Path(f"/proc/self/task/{threading.get_native_id()}/comm").write_bytes(name)


if __name__ == "__main__":
    sys.exit(main())
