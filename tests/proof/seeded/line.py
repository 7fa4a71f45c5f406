"""Seeds about the line: settings changed by another program."""

from tests.proof.seeded.seed import CORE, DEVICES, LASTRESORT, LINK, Seed, hostile, part, scene

LINES: tuple[Seed, ...] = (
    scene(
        "the controller leaves the line as it is",
        "line",
        "the controller never restores port settings changed by another program",
        ("another speed",),
        (f"{DEVICES}charger.py", "            return line.restore()\n", "            return None\n"),
    ),
    part(
        "settings are not compared each second",
        "line",
        "changed port settings are noticed only once an answer is missing",
        ("tests/devices/test_charger_port_taken_over.py::test_what_does_no_harm_at_once_is_set_right_within_a_second",),
        (f"{DEVICES}charger.py", "+ LOOK_S\n        self._found(self._restored(line))\n", "+ LOOK_S\n"),
    ),
    scene(
        "nobody is told of a changed line",
        "line",
        "restored port settings are not reported",
        ("another speed",),
        (f"{DEVICES}charger.py", "        if taken_over is not None:\n", "        if False:\n"),
    ),
    scene(
        "estop leaves the line as it is",
        "line",
        "the guardian and estop do not check the line's settings",
        ("another speed, then killed",),
        (
            f"{LASTRESORT}lastport.py",
            "return self._fd is not None and bool(line_settings.restore(self._fd))",
            "return False",
        ),
    ),
    scene(
        "a stranger's lock keeps the service out",
        "line",
        "a port locked by another program is not opened",
        ("locked by a stranger",),
        (f"{LINK}serial.py", "!= errno.EAGAIN or holder(path).ours:", "!= errno.EAGAIN or True:"),
    ),
    scene(
        "a stranger's lock is no alarm",
        "line",
        "a port locked by another program raises no alarm",
        ("locked by a stranger",),
        (f"{CORE}alarm.py", "or unknown or locked", "or unknown"),
    ),
    hostile(
        "a stranger's lock is respected at the end",
        "line",
        "estop --leave-held leaves ports locked by other programs alone",
        ("tests/guardian/test_laststop.py::test_a_strangers_lock_keeps_no_stop_away",),
        (f"{LASTRESORT}bareport.py", "        if holder(name, (os.getpid(),)).ours:", "        if True:"),
    ),
)
