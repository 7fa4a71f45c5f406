"""Seeds about ports that hang, are busy, or come and go."""

from tests.proof.seeded.seed import DEVICES, LASTRESORT, SERVICE, Seed, hostile, part, scene

PORTS: tuple[Seed, ...] = (
    scene(
        "ports are stopped one after another",
        "ports",
        "estop opens and stops one port after another",
        ("half dead adapter, estop",),
        (
            f"{LASTRESORT}laststop.py",
            "        self._waiting += lines\n        self._start()\n",
            "        for line in lines:\n            line.first()\n"
            "        self._waiting += lines\n        self._start()\n",
        ),
    ),
    hostile(
        "a close holds the guardian up",
        "ports",
        "the guardian waits for a driver with a slow close",
        ("tests/guardian/test_guardian_messages.py::test_a_port_whose_close_hangs_keeps_nobody_from_watching",),
        (f"{LASTRESORT}guardian.py", "            aside(partial(drop_port, old))", "            drop_port(old)"),
    ),
    hostile(
        "a hung driver holds the others up",
        "ports",
        "the guardian writes its first stops one after another, in one thread",
        ("tests/guardian/test_laststop.py::test_a_driver_that_hangs_delays_no_other_port",),
        (f"{LASTRESORT}laststop.py", "                sweeper.join(STUCK_S)\n", "                sweeper.join()\n"),
    ),
    scene(
        "a hung controller is left alone",
        "ports",
        "the guardian waits ten times as long for a heartbeat",
        ("frozen",),
        (f"{LASTRESORT}guardian.py", "SILENCE_S = 0.5", "SILENCE_S = 5.0"),
    ),
    part(
        "an opened port goes on",
        "ports",
        "an opened port does not begin with a stop",
        ("tests/devices/test_charger_port.py::test_an_opened_port_stops_the_whole_charger_before_it_asks_anything",),
        (
            f"{DEVICES}schedule.py",
            "        self.command: Command | None = STOP  #: the command to repeat\n        self._urgent = True",
            "        self.command: Command | None = None  #: the command to repeat\n        self._urgent = False",
        ),
    ),
    scene(
        "the service ends at once",
        "ports",
        "SIGTERM ends the service without a stop",
        ("restarted in order",),
        (
            f"{SERVICE}supervisor.py",
            "            bay.end(why, orderly=self._lost is None)\n",
            "            return 0\n",
        ),
    ),
)
