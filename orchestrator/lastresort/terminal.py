"""Whether this process was started from a terminal. Standard library only."""

import os


def has_terminal() -> bool:
    """Whether we were started from a terminal: we end with it. For a service, SIGHUP means reload."""
    try:
        os.close(os.open("/dev/tty", os.O_RDONLY))
    except OSError:
        return False
    return True
