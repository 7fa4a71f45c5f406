"""The machine that is measured on."""

import os
import platform
from collections.abc import Mapping
from pathlib import Path

from benchmarks import gateway


def facts() -> dict[str, object]:
    """What figures depend on. `gateway_factor` makes those of two machines comparable."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "kernel": platform.release(),
        "load": round(os.getloadavg()[0], 2),
        gateway.FACT: gateway.factor(),
    }


def line(of: Mapping[str, object]) -> str:
    """Above every table."""
    return ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in of.items())


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
