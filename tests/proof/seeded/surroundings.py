"""Seeds about the surroundings: starters, clients, clocks, other programs."""

from tests.proof.seeded.seed import LASTRESORT, SERVICE, Seed, hostile, part

SURROUNDINGS: tuple[Seed, ...] = (
    hostile(
        "a file in the working directory is imported",
        "surroundings",
        "serial.py in the working directory is run by the controller, which drives the chargers",
        (
            "tests/guardian/test_emergency.py::test_a_file_of_the_working_directory_is_not_imported_by_the_controller",
            "tests/test_surroundings.py",
        ),
        (f"{LASTRESORT}guardian.py", 'CONTROLLER = ("-P", "-m",', 'CONTROLLER = ("-m",'),
        ("orchestrator/__main__.py", '    os.environ["PYTHONSAFEPATH"] = "1"\n', ""),
    ),
    hostile(
        "clients are served one after another",
        "surroundings",
        "an idle client at the control socket delays a stop",
        (
            "tests/service/test_control_clients.py::test_one_who_says_nothing_holds_nobody_up_and_is_sent_away",
            "tests/service/test_control_clients.py::test_idle_clients_do_not_count_however_many_they_are",
        ),
        (f"{SERVICE}client.py", "        connection.settimeout(0)\n", "        connection.settimeout(CLIENT_S)\n"),
    ),
    hostile(
        "who asks may wait for ever",
        "surroundings",
        "an answer dripping byte by byte delays the client",
        ("tests/service/test_asking.py::test_who_asks_waits_so_long_and_no_longer",),
        (
            f"{LASTRESORT}asking.py",
            "        client.settimeout(max(end_s - monotonic(), 0.001))\n        part = client.recv(1 << 16)",
            "        client.settimeout(5.0)\n        part = client.recv(1 << 16)",
        ),
        (f"{LASTRESORT}asking.py", " or len(data) > MAX_ANSWER or monotonic() > end_s:", " or len(data) > MAX_ANSWER:"),
    ),
    hostile(
        "a poor terminal makes a traceback",
        "surroundings",
        "text a Latin-1 terminal cannot show ends a verb with a traceback",
        ("tests/test_surroundings.py::test_no_terminal_is_too_poor",),
        (
            "orchestrator/__main__.py",
            '        stream.reconfigure(errors="poor")',
            '        stream.reconfigure(errors="strict")',
        ),
    ),
    part(
        "a thread for each hang-up",
        "surroundings",
        "each SIGHUP starts another thread that reads the files",
        ("tests/service/test_reload.py",),
        (
            f"{SERVICE}reload.py",
            "        self._asked.set()\n",
            "        threading.Thread(target=self.read, args=(reading,), daemon=True).start()\n",
        ),
    ),
    hostile(
        "the demo listens on the network",
        "surroundings",
        "the demo's bus is UDP multicast, on every interface",
        ("tests/whole/test_demo.py::test_nothing_listens_beyond_this_machine",),
        (
            "orchestrator/demo/stage.py",
            "  can0: {{interface: serial, channel: {directory}/can0, bitrate: 250000, timeout: 0.01}}",
            '  can0: {{interface: udp_multicast, channel: "239.74.163.2", port: 43113}}',
        ),
        (
            "orchestrator/demo/stage.py",
            'json.dumps({"interface": "pty", "channel": str(self.directory / "can0")})',
            'json.dumps({"interface": "udp_multicast", "channel": "239.74.163.2", "port": 43113, "hop_limit": 0})',
        ),
    ),
)
