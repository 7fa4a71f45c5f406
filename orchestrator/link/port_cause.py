"""What is wrong with a serial port, as a cause, from what the kernel and pyserial say."""

import errno
import os

from orchestrator.lastresort.port_owner import Holder, controller_on, holder
from orchestrator.model import Cause

#: An adapter that is not there any more.
GONE = "port_gone"

#: The cause, by what the kernel says; each says what to do.
_CAUSES = {
    errno.ENOENT: "port_missing",
    errno.EACCES: "port_forbidden",
    errno.EPERM: "port_forbidden",
    errno.EAGAIN: "port_busy",  # its lock (flock) is taken
    errno.EBUSY: "port_taken",
    errno.EIO: GONE,
    errno.ENXIO: GONE,
    errno.ENODEV: GONE,
    errno.ENOTTY: "port_not_serial",
    errno.EINVAL: "port_not_serial",
    errno.EISDIR: "port_not_serial",
    errno.EMFILE: "port_too_many_files",
    errno.ENFILE: "port_too_many_files",
}


def port_cause(error: BaseException, path: str, *, otherwise: str) -> Cause:
    """What has gone wrong, by its errno; `otherwise`: by what pyserial has said."""
    number = errno_of(error)
    if number is None:
        return Cause.of(otherwise, port=path, error=str(error))
    id_ = _CAUSES.get(number, otherwise)
    if id_ == "port_busy" and (pid := controller_on(path)):
        return of_service(path, pid)
    if id_ == "port_taken":
        found = holder(path, (os.getpid(),))
        return Cause.of(id_, port=path, program=program(found) if found.pid else None)
    return Cause.of(id_, port=path, error=errno.errorcode.get(number, str(number)))


def of_service(port: str, pid: int) -> Cause:
    """Another service has this port: unlike a stop tool it keeps it, and commands the charger."""
    return Cause.of("port_of_service", port=port, pid=pid)


def program(found: Holder) -> Cause:
    """Who holds a port."""
    return Cause.of("program", name=found.name, pid=found.pid) if found.pid else Cause("program_unknown")


def settings_found(found: str) -> Cause | None:
    """What `line_settings` has found: speeds and disciplines with their numbers, all else by its word."""
    return Cause.of("settings_found", found=tuple(map(_setting, found.split(", ")))) if found else None


def _setting(word: str) -> str | Cause:
    first, _, last = word.partition(" ")
    if last == "baud" and first.isdecimal():
        return Cause.of("baud", baud=int(first))
    number = word.removeprefix("line discipline ")
    return Cause.of("line_discipline", number=int(number)) if number != word else word


def errno_of(error: BaseException) -> int | None:
    """An error's errno: often pyserial keeps that only in the error's cause or first argument."""
    cause: BaseException | None = error
    while cause is not None:
        number = getattr(cause, "errno", None) or (cause.args[0] if cause.args else None)
        if isinstance(number, int):
            return number
        cause = cause.__context__
    return None
