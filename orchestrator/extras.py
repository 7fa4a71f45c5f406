"""What to type where a package of an extra is missing.

A bare `pip install` is refused by Debian's own Python (PEP 668) and might reach another Python than this one; so the
line names this one. It names the packages as well: that works whether this program came from a checkout or a wheel.
"""

import shlex
import sys

#: As installed; its metadata knows each extra's packages.
DISTRIBUTION = "charging-station-orchestrator"


def pip_install(*requirements: str) -> str:
    """The command that installs these packages where this program finds them."""
    return shlex.join([sys.executable or "python3", "-m", "pip", "install", *requirements])


def install_extra(extra: str, distribution: str = DISTRIBUTION) -> str:
    """The command that installs an extra's packages; the extra by its name if this program is not installed."""
    from importlib.metadata import PackageNotFoundError, requires  # noqa: PLC0415 - 20 ms, and only for an error

    try:
        lines = [line.partition(";") for line in requires(distribution) or ()]
    except PackageNotFoundError:
        lines = []
    wanted = f"extra == '{extra}'"
    named = [what.strip() for what, _, marker in lines if marker.strip().replace('"', "'") == wanted]
    return pip_install(*named or [f"{distribution}[{extra}]"])
