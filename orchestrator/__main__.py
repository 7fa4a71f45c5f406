"""`orchestrator`, and `python -m orchestrator`: two verbs that must not wait for imports, then the rest."""

import _codecs
import _signal  # type: ignore[import-not-found]  # the core of `signal`, without that module's import time
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable

#: What a terminal shows for the signs that its encoding lacks, each as wide as the sign: columns stay aligned.
POOR = {"°": " ", "…": "~", "–": "-", "→": ">", "·": "-", "×": "x", "“": '"', "”": '"', "‘": "'", "’": "'"}


def main() -> int:
    """Run the verb of the command line and return the exit status."""
    _import_from_no_working_directory()
    _fill_standard_streams()
    try:
        return _run(sys.argv[1:])
    finally:
        _flush()


def _run(arguments: list[str]) -> int:
    if arguments[:1] == ["estop"]:
        _signal.signal(_signal.SIGINT, _signal.SIG_IGN)  # until it can report what it has stopped
        from orchestrator.lastresort.estop import main as estop

        return estop(arguments[1:], _catch)
    if arguments[:1] == ["run"] and not any(word.startswith("-") for word in arguments) and len(arguments) <= 2:
        stations = arguments[1:] or ["station.yaml"]
        if arguments[1:] or os.path.exists(stations[0]):  # noqa: PTH110 - pathlib takes long to import
            from orchestrator.lastresort.guardian import guard

            return guard(stations)
    from orchestrator.cli import main as command_line

    return command_line(arguments)


def _catch(wish: "Callable[[], None]") -> None:
    """Ctrl-C, `kill` and a closed terminal do not end an emergency stop silently. `nohup` stays in effect."""
    for number in (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP):
        if number == _signal.SIGINT or _signal.getsignal(number) is not _signal.SIG_IGN:
            _signal.signal(number, lambda *_: wish())


def _import_from_no_working_directory() -> None:
    """No process of ours may run a file there that shares a name with one of our libraries, say `serial.py`.

    Python looks there first under `-m`, and for each empty name in PYTHONPATH. Importing from a checkout is allowed.
    """
    home = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - pathlib is a file, too
    try:
        here = os.getcwd()  # noqa: PTH109 - as above
    except OSError:  # deleted: nothing can be there
        here = ""
    if here in (home, os.path.dirname(os.__file__)):  # noqa: PTH120 - as above; the latter is Python's own
        return
    sys.path[:] = [name for name in sys.path if name not in ("", ".", here)]
    os.environ["PYTHONSAFEPATH"] = "1"
    if names := os.environ.get("PYTHONPATH"):
        os.environ["PYTHONPATH"] = os.pathsep.join(name for name in names.split(os.pathsep) if name not in ("", "."))


def _fill_standard_streams() -> None:
    """Make sure that printing never fails.

    Point free descriptors 0 to 2 at /dev/null: a serial port opened on one of them would receive our messages. A
    terminal that cannot show °, → or Korean shows something else as wide.
    """
    _codecs.register_error("poor", _replaced)
    while (fd := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(fd, True)  # noqa: FBT003 - it takes no keyword
    os.close(fd)
    sys.stdout = sys.stdout or open(1, "w", closefd=False)  # noqa: SIM115 - None where it was closed
    sys.stderr = sys.stderr or open(2, "w", closefd=False)  # noqa: SIM115 - as above
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="poor")  # type: ignore[union-attr]  # they are text streams


def _replaced(error: UnicodeError) -> tuple[str, int]:
    """Something to show for letters that an encoding lacks. Bytes of a file name that are no text stay legible."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letters = error.object[error.start : error.end]
    return "".join(map(_poor, letters)), error.end


def _poor(letter: str) -> str:
    from unicodedata import east_asian_width

    if "\ud800" <= letter <= "\udfff":
        return f"\\u{ord(letter):04x}"
    return POOR.get(letter, "??" if east_asian_width(letter) in "WF" else "?")


def _flush() -> None:
    """Drop output that can no longer be delivered (reader of a pipe gone, disk full): no traceback at the end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


if __name__ == "__main__":
    sys.exit(main())
