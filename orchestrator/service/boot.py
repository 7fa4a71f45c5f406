"""The boot of the machine and the time since then: monotonic times are comparable within one boot only."""

from pathlib import Path
from time import CLOCK_BOOTTIME, clock_gettime

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


def boot_id() -> str:
    """The kernel's id of this boot; "" if it has none."""
    try:
        return BOOT_ID.read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return ""


def boottime() -> float:
    """Like `monotonic`, but it also runs while the machine is suspended."""
    return clock_gettime(CLOCK_BOOTTIME)
