"""`orchestrator`, and `python -m orchestrator`: two verbs that must not wait for anybody's imports, then the rest."""

import os
import sys


def main() -> int:
    """Run the verb of the command line and return the exit status."""
    _fill_standard_streams()
    arguments = sys.argv[1:]
    if arguments[:1] == ["estop"]:
        from orchestrator.service.estop import main as estop

        return estop(arguments[1:])
    if arguments[:1] == ["run"] and not any(word.startswith("-") for word in arguments) and len(arguments) <= 2:
        from orchestrator.service.guardian import guard

        return guard(arguments[1:] or ["station.yaml"])
    from orchestrator.cli import main as command_line

    return command_line(arguments)


def _fill_standard_streams() -> None:
    """Give descriptors 0 to 2 to nothing where they are free: a serial port with one of them would get what we say."""
    while (fd := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(fd, True)  # noqa: FBT003 - it takes it no other way
    os.close(fd)


if __name__ == "__main__":
    sys.exit(main())
