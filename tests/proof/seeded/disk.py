"""Seeds about what must be on the disk."""

from tests.proof.seeded.seed import CORE, LASTRESORT, SERVICE, Seed, hostile, part, scene

UNKNOWN_PAST = "return own.persisted if own else Persisted(hold=unknown)"

DISK: tuple[Seed, ...] = (
    scene(
        "a running charge is not kept",
        "disk",
        "that a charger may be running is not persisted",
        ("charging, then no power",),
        (
            f"{CORE}persisted.py",
            "running=memory.state in MAY_RUN or memory.stage.intends or memory.stop.unverified,",
            "running=False,",
        ),
        (
            f"{SERVICE}bay.py",
            "running_persisted=(on_disk := self._store.on_disk(self.place)) is not None and on_disk.running,",
            "running_persisted=True,",
        ),
    ),
    scene(
        "who ran is not held",
        "disk",
        "a charge ended by a crash resumes by itself after the restart",
        ("charging, then no power",),
        (f"{CORE}persisted.py", "        if self.running:\n", "        if False:\n"),
    ),
    scene(
        "a charge begins before it is written down",
        "disk",
        "RUN is sent before the disk has confirmed that the charger may be running",
        ("fsync hangs, begun, killed", "disk full"),
        (
            f"{SERVICE}bay.py",
            "running_persisted=(on_disk := self._store.on_disk(self.place)) is not None and on_disk.running,",
            "running_persisted=True,",
        ),
        (
            f"{SERVICE}store.py",
            "        pending_s, problem = self._pending_s, self._blind or self._problem\n",
            "        pending_s, problem = self._pending_s, self._blind\n",
        ),
        (
            f"{SERVICE}store.py",
            "        if problem is None and pending_s is not None and now_s - pending_s > KEPT_WITHIN_S:",
            "        if False:",
        ),
    ),
    scene(
        "a request is answered before it is kept",
        "disk",
        "a stop is confirmed before it is on the disk",
        ("stopped at rest, then no power at once",),
        (f"{SERVICE}asked.py", "        if answer is not None:\n", "        if True:\n"),
    ),
    part(
        "nobody is told what is not kept",
        "disk",
        "a failing disk is not reported, and a charge may begin",
        ("tests/service/test_store.py",),
        (
            f"{SERVICE}store.py",
            '        """Why a restart would forget something; None while it would not."""\n',
            '        """Why a restart would forget something; None while it would not."""\n        return None\n',
        ),
    ),
    hostile(
        "an end that has kept nothing is a good one",
        "disk",
        "the service exits with 0 though data for the next start is not on the disk",
        ("tests/whole/test_survives.py::test_what_no_disk_takes_is_said_and_the_end_is_a_bad_one",),
        (
            f"{SERVICE}supervisor.py",
            "        not_persisted = self._store.close(KEEP_S)\n",
            "        self._store.close(KEEP_S)\n        not_persisted = None\n",
        ),
    ),
    scene(
        "standard error is written before the state",
        "disk",
        "the writer of the persisted state first waits for the reader of standard error",
        ("standard error is not read",),
        (f"{SERVICE}store.py", "import threading\n", "import os\nimport threading\n"),
        (
            f"{SERVICE}store.py",
            "        stamp = self._stamp()\n        with self._lock:\n",
            '        stamp = self._stamp()\n        os.write(2, b"keeping\\n" * 1000)\n        with self._lock:\n',
        ),
    ),
    scene(
        "a hold is not kept",
        "disk",
        "an operator's stop is forgotten after a restart",
        ("stopped, then no power",),
        (f"{CORE}persisted.py", "            hold=memory.operator.hold,\n", '            hold="",\n'),
    ),
    scene(
        "latches are not kept",
        "disk",
        "a fault waiting for a person is forgotten after a restart",
        ("tripped, taken out, put back", "tripped at rest, then no power"),
        (
            f"{CORE}persisted.py",
            "            if fault.raised_s is not None or fault.strikes\n",
            "            if False\n",
        ),
    ),
    part(
        "a fault is no reason to write",
        "disk",
        "a latching fault is written only with the next counters",
        ("tests/core/test_persisted.py",),
        (
            f"{CORE}persisted.py",
            "return self.running, self.hold, self.paused, self.paused_by, faults, resets,",
            "return self.running, self.hold, self.paused, self.paused_by, resets,",
        ),
    ),
    part(
        "the directory is not synchronised",
        "disk",
        "the directory is not synchronised after the rename",
        ("tests/service/test_store.py",),
        (
            f"{SERVICE}disk.py",
            "    os.replace(fresh, path)\n    sync_directory(path.parent)",
            "    os.replace(fresh, path)",
        ),
    ),
    part(
        "the file is not synchronised",
        "disk",
        "a file is renamed before its bytes are on the disk",
        ("tests/service/test_store.py",),
        (
            f"{SERVICE}disk.py",
            "            data = data[os.write(fd, data) :]\n        os.fsync(fd)",
            "            data = data[os.write(fd, data) :]",
        ),
    ),
    scene(
        "an absent bay is forgotten",
        "disk",
        "entries of bays missing from the station file are dropped, and a bay without an entry counts as new",
        ("tripped, taken out, put back",),
        (f"{SERVICE}past.py", "        if old in pasts or any(", "        if True or any("),
        (
            f"{SERVICE}past.py",
            UNKNOWN_PAST,
            "return own.persisted if own else Persisted()",
        ),
    ),
    part(
        "a bay without a past is free to go",
        "disk",
        "a bay missing from the persisted state charges at once",
        ("tests/service/test_past.py", "tests/service/test_store.py"),
        (
            f"{SERVICE}past.py",
            UNKNOWN_PAST,
            "return own.persisted if own else Persisted()",
        ),
    ),
    scene(
        "what is kept belongs to the name alone",
        "disk",
        "a bay renamed in the station file has no past",
        ("stopped, then renamed",),
        (
            f"{SERVICE}past.py",
            "return self.bay == other.bay or self.is_port_of(other) or self.bmu == other.bmu",
            "return self.bay == other.bay",
        ),
        (
            f"{SERVICE}past.py",
            UNKNOWN_PAST,
            "return own.persisted if own else Persisted()",
        ),
    ),
    scene(
        "estop ignores ports in hand",
        "disk",
        "estop stops the chargers in the file, not those persisted as running",
        ("file edited, then both killed",),
        (f"{LASTRESORT}inhand.py", '            if entry.get("running") and', "            if False and"),
    ),
    hostile(
        "a start ignores ports in hand",
        "disk",
        "a charger removed from the station file runs on under the next service",
        ("tests/whole/test_survives.py::test_a_charger_that_the_station_file_has_lost_is_stopped_by_the_next_start",),
        (
            f"{SERVICE}store.py",
            "            running = [place for place, put in self._table.items() if put.persisted.running]",
            "            running: list[Place] = []",
        ),
    ),
    hostile(
        "two services keep their state in one place",
        "disk",
        "the directory of the persisted state is not locked",
        ("tests/whole/test_survives.py::test_a_second_service_on_the_same_journal_ends_with_a_sentence",),
        (
            f"{SERVICE}disk.py",
            "        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)\n",
            "        fcntl.flock(fd, 0)\n",
        ),
    ),
)
