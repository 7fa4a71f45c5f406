"""Problems of a CAN bus, in sentences for the technician on site."""

import errno
import os
import termios
from collections.abc import Iterator, Mapping

Settings = Mapping[str, object]

_UP = "ip link set {channel} up type can bitrate {bitrate} restart-ms 100"

#: What to do, by errno.
_ADVICE: Mapping[int, str] = {
    errno.ENETDOWN: f"the interface is down; bring it up: {_UP}",
    errno.ENODEV: "there is no such interface: is the adapter plugged in? `ip link` lists what there is",
    errno.ENXIO: "the adapter is gone: plug it in again",
    errno.ENOENT: "there is no such device: is the adapter plugged in? Best name it by /dev/serial/by-path",
    errno.EIO: "the adapter is gone: plug it in again",
    errno.EACCES: "not allowed: the service's user needs access to this device (for a serial adapter, group dialout)",
    errno.EPERM: "not allowed: the service's user needs access to this device",
    errno.ENOTTY: "this is no serial port: check the channel in the station file",
    errno.EBUSY: "another program holds it: end that program",
    errno.EAFNOSUPPORT: "this kernel has no CAN: modprobe can_raw, or use another interface",
    errno.EPROTONOSUPPORT: "this kernel has no raw CAN: modprobe can_raw, or use another interface",
    errno.ENOBUFS: "the transmit queue is full, nobody acknowledges: check cable, terminators, bit rate, BMU's power",
}

#: What to do without an errno, by a part of the library's message.
_HINTS: Mapping[str, str] = {
    "msgpack": "udp_multicast needs it: pip install msgpack",
    "Write timeout": "the adapter takes nothing any more: unplug it and plug it in again",
}

#: Error frames of SocketCAN (linux/can/error.h): the bits of the id.
_CONTROLLER, _NO_ACK, _BUS_OFF, _RESTARTED = 0x004, 0x020, 0x040, 0x100
_PASSIVE, _ACTIVE = 0x30, 0x40  # data byte 1 of a controller error: receive or transmit error-passive; active again

BUS_OFF = f"the controller is bus-off; check cable, terminators and bit rate. It recovers by itself only with {_UP}"
PASSIVE = "the controller is error-passive: check cable, terminators and bit rate"
NO_ACK = "nobody acknowledges our frames: check the BMU's power, cable and bit rate"
QUEUE_FULL = _ADVICE[errno.ENOBUFS]


def place(name: str, settings: Settings) -> str:
    """The bus: its name in the station file, with interface and channel."""
    return f"CAN bus {name} ({settings.get('interface', 'no interface')} {settings.get('channel', '')}".rstrip() + ")"


def filled(text: str, settings: Settings) -> str:
    """The advice with this bus's channel and bit rate filled in."""
    channel, bitrate = settings.get("channel", "can0"), settings.get("bitrate", 250_000)
    return text.replace("{channel}", str(channel)).replace("{bitrate}", str(bitrate))


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


def failure(name: str, settings: Settings, error: BaseException) -> str:
    """The sentence for an exception of python-can, canopen or the operating system."""
    number = errno_of(error)
    if number is not None:
        advice = filled(_ADVICE.get(number, ""), settings)
        what = f"{os.strerror(number)} (errno {number})"
    else:
        what, advice = _unnumbered(error)
    return f"{place(name, settings)}: {what}" + (f": {advice}" if advice else "")


def _unnumbered(error: BaseException) -> tuple[str, str]:
    text = "; ".join(dict.fromkeys(str(link) for link in chain(error) if str(link)))
    if advice := next((advice for hint, advice in _HINTS.items() if hint in text), None):
        return text, advice
    kind = type(error).__name__
    what = f"{kind}: {text}" if text else kind
    return what, "check the bus's settings in the station file, and that the interface's driver is installed"


def error_frame(can_id: int, data: bytes) -> str | None:
    """The bus state in an error frame: `BUS_OFF`, `PASSIVE`, `NO_ACK`, "" for recovered; None for transient noise."""
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
