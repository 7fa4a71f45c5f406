"""The guest's kernel: User Mode Linux, a Linux running as an ordinary program, from Debian or Ubuntu."""

import os
import platform
import shutil
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

PACKAGE = "user-mode-linux"
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "charging-station-orchestrator"
#: In this order: later ones need earlier ones.
MODULES = (
    "fs/overlayfs/overlay",
    "net/can/can",
    "net/can/can-raw",
    "drivers/net/can/dev/can-dev",
    "drivers/net/can/vcan",
    "drivers/net/can/slcan/slcan",
)
#: A processor feature that makes its registers larger than this kernel knows: see xstate.c.
LARGE_REGISTERS = "amx_tile"
#: Programs the guest borrows from this machine, and their packages.
NEEDED = {"/lib/systemd/systemd": "systemd", "/usr/bin/systemd-analyze": "systemd", "/sbin/ip": "iproute2"}


class MissingError(Exception):
    """The guest cannot start on this machine: what is missing and what to do."""


@dataclass(frozen=True)
class Kernel:
    """The program, the modules to load into it, and the library it needs to run here, if any."""

    program: Path
    modules: tuple[Path, ...]
    preload: Path | None = None


def find() -> Kernel:
    """The installed package's kernel, or the one in our cache, downloaded (41 MB) if necessary."""
    if platform.machine() != "x86_64":
        raise MissingError(f"the guest's kernel is packaged for x86_64 only, and this is {platform.machine()}")
    for path, package in NEEDED.items():
        if not Path(path).exists():
            raise MissingError(f"the guest needs {path}: sudo apt-get install {package}")
    unpacked = CACHE / PACKAGE
    kernel = _below(Path("/")) or _below(unpacked)
    if kernel is None:
        _download(unpacked)
        kernel = _below(unpacked)
    if kernel is None:
        raise MissingError(f"{unpacked} has no kernel with {', '.join(MODULES)}: remove it to have it fetched anew")
    large = LARGE_REGISTERS in Path("/proc/cpuinfo").read_text(encoding="ascii").split()
    return replace(kernel, preload=_compiled() if large else None)


def _below(root: Path) -> Kernel | None:
    program = root / "usr/bin/linux.uml"
    for folder in sorted(root.glob("usr/lib/uml/modules/*/kernel"), reverse=True):
        modules = tuple(folder / f"{name}.ko" for name in MODULES)
        if program.exists() and all(module.exists() for module in modules):
            return Kernel(program, modules)
    return None


def _download(target: Path) -> None:
    if not (shutil.which("apt-get") and shutil.which("dpkg-deb")):
        raise MissingError(f"the package {PACKAGE} of Debian or Ubuntu is missing, and there is no apt-get to fetch it")
    CACHE.mkdir(parents=True, exist_ok=True)
    fetched = subprocess.run(["apt-get", "--quiet", "download", PACKAGE], cwd=CACHE, check=False)
    packages = sorted(CACHE.glob(f"{PACKAGE}_*.deb"))
    if fetched.returncode or not packages:
        raise MissingError(
            f"apt-get cannot download {PACKAGE}: is there a network, and was apt-get update ever called? "
            f"A copy that you put into {CACHE} is as good"
        )
    subprocess.run(["dpkg-deb", "--extract", packages[-1], target], check=True)


def _compiled() -> Path:
    compiler = shutil.which("cc")
    if compiler is None:
        raise MissingError("on this processor (AMX) the guest needs a C compiler: sudo apt-get install gcc libc6-dev")
    library = CACHE / "xstate.so"
    source = Path(__file__).with_name("xstate.c")
    CACHE.mkdir(parents=True, exist_ok=True)
    subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", library, source], check=True)
    return library
