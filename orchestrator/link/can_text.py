"""What is wrong with a CAN bus, as a cause, from what the libraries and the kernel say."""

import errno
import termios
from collections.abc import Iterator, Mapping

from orchestrator.extras import pip_install
from orchestrator.model import Cause

Settings = Mapping[str, object]

_UP = "ip link set {channel} up type can bitrate {bitrate} restart-ms 100"

#: The cause, by errno; each says what to do.
_CAUSES: Mapping[int, str] = {
    errno.ENETDOWN: "can_down",
    errno.ENODEV: "can_no_interface",
    errno.ENXIO: "can_gone",
    errno.ENOENT: "can_no_device",
    errno.EIO: "can_gone",
    errno.EACCES: "can_forbidden",
    errno.EPERM: "can_forbidden",
    errno.ENOTTY: "can_not_serial",
    errno.EBUSY: "can_busy",
    errno.EAFNOSUPPORT: "can_no_kernel",
    errno.EPROTONOSUPPORT: "can_no_kernel",
    errno.ENOBUFS: "can_queue_full",
}
#: Those that name the command that mends it.
_BY_COMMAND = ("can_down", "can_bus_off")

#: The cause where there is no errno, by a part of what the libraries say.
_HINTS: Mapping[str, str] = {"msgpack": "can_needs_msgpack", "Write timeout": "can_stalled"}

#: Error frames of SocketCAN (linux/can/error.h): the bits of the id.
_CONTROLLER, _NO_ACK, _BUS_OFF, _RESTARTED = 0x004, 0x020, 0x040, 0x100
_PASSIVE, _ACTIVE = 0x30, 0x40  # data byte 1 of a controller error: receive or transmit error-passive; active again

BUS_OFF, PASSIVE, NO_ACK = "can_bus_off", "can_passive", "can_no_ack"
QUEUE_FULL = Cause("can_queue_full")


def place(name: str, settings: Settings) -> Cause:
    """The bus: its name in the station file, with interface and channel."""
    wire = f"{settings.get('interface', '–')} {settings.get('channel', '')}".rstrip()
    return Cause.of("can_bus", bus=name, wire=wire)


def trouble(id_: str, settings: Settings) -> Cause:
    """What an error frame has said, with this bus's channel and bit rate where they are of use."""
    return Cause.of(id_, command=_command(settings)) if id_ in _BY_COMMAND else Cause(id_)


def _command(settings: Settings) -> str:
    channel, bitrate = settings.get("channel", "can0"), settings.get("bitrate", 250_000)
    return _UP.format(channel=channel, bitrate=bitrate)


def chain(error: BaseException) -> Iterator[BaseException]:
    """An exception and the chain of its causes, the outermost first."""
    seen: BaseException | None = error
    while seen is not None:
        yield seen
        seen = seen.__cause__ or seen.__context__


def errno_of(error: BaseException) -> int | None:
    """The operating system's error number, wherever it is in the chain; None if there is none."""
    for link in chain(error):
        number = _number(link)
        if isinstance(number, int) and number > 0:  # name resolution errors have negative numbers
            return number
    return None


def _number(error: BaseException) -> object:
    if isinstance(error, OSError):
        return error.errno
    if isinstance(error, termios.error):  # not an OSError, although it looks like one
        return error.args[0] if error.args else None
    return getattr(error, "error_code", None)  # python-can's


def failure(name: str, settings: Settings, error: BaseException) -> Cause:
    """The cause of an exception of python-can, canopen or the operating system."""
    number = errno_of(error)
    if number is None:
        return _unnumbered(error).with_(where=place(name, settings))
    id_, code = _CAUSES.get(number, "can_failed"), errno.errorcode.get(number, str(number))
    command = {"command": _command(settings)} if id_ in _BY_COMMAND else {}
    return Cause.of(id_, error=code, **command, where=place(name, settings))


def _unnumbered(error: BaseException) -> Cause:
    text = "; ".join(dict.fromkeys(str(link) for link in chain(error) if str(link)))
    if id_ := next((id_ for hint, id_ in _HINTS.items() if hint in text), None):
        install = {"install": pip_install("msgpack")} if id_ == "can_needs_msgpack" else {}
        return Cause.of(id_, error=text, **install)
    kind = type(error).__name__
    return Cause.of("can_not_understood", error=f"{kind}: {text}" if text else kind)


def error_frame(can_id: int, data: bytes) -> str | None:
    """The id of what an error frame says of the bus, "" for recovered; None for passing noise."""
    if can_id & _BUS_OFF:
        return BUS_OFF
    if can_id & _RESTARTED:
        return ""
    if can_id & _CONTROLLER and len(data) > 1:
        if data[1] & _PASSIVE:
            return PASSIVE
        if data[1] & _ACTIVE:
            return ""
    return NO_ACK if can_id & _NO_ACK else None
