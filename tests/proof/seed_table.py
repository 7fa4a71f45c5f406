"""The seeds: holes that were closed, each as a small change of the package that opens it again."""

from dataclasses import dataclass

Change = tuple[str, str, str]  #: file, what stands there exactly once, what takes its place


@dataclass(frozen=True, slots=True)
class Seed:
    """One bug. `kind`: the kind of hole; `likely`: the proof that is asked first; `where`: what of it comes first.

    `where` holds names of scenes for the environment, and files or tests for the proofs that pytest runs.
    """

    name: str
    kind: str
    about: str
    changes: tuple[Change, ...]
    likely: str = "environment"
    where: tuple[str, ...] = ()


SERVICE, LASTRESORT, DEVICES, CORE, LINK = (
    "orchestrator/service/",
    "orchestrator/lastresort/",
    "orchestrator/devices/",
    "orchestrator/core/",
    "orchestrator/link/",
)
WORKBENCH = "orchestrator/workbench/"
UNKNOWN_PAST = "return own.persisted if own else Persisted(hold=unknown)"


def scene(name: str, kind: str, about: str, where: tuple[str, ...], *changes: Change) -> Seed:
    """One that a scene of the environment is likely to find."""
    return Seed(name, kind, about, changes, "environment", where)


def hostile(name: str, kind: str, about: str, where: tuple[str, ...], *changes: Change) -> Seed:
    """One that shows in real processes only."""
    return Seed(name, kind, about, changes, "hostile", where)


def part(name: str, kind: str, about: str, where: tuple[str, ...], *changes: Change) -> Seed:
    """One behind which a second guard stands: the station is safe with it, and only the part's own tests tell."""
    return Seed(name, kind, about, changes, "parts", where)


LINES: tuple[Seed, ...] = (
    scene(
        "the controller leaves the line as it is",
        "line",
        "the controller never sets a port up again that another program has changed",
        ("another speed",),
        (f"{DEVICES}charger.py", "            return line.restore()\n", '            return ""\n'),
    ),
    part(
        "settings are not compared each second",
        "line",
        "what another program has set shows only once an answer is missing",
        ("tests/devices/test_charger_port.py::test_what_does_no_harm_at_once_is_set_right_within_a_second",),
        (f"{DEVICES}charger.py", "+ LOOK_S\n        self._found(self._restored(line))\n", "+ LOOK_S\n"),
    ),
    scene(
        "nobody is told of a changed line",
        "line",
        "a port that was set up again is not reported",
        ("another speed",),
        (f"{DEVICES}charger.py", "        if taken_over:\n", "        if False:\n"),
    ),
    scene(
        "estop leaves the line as it is",
        "line",
        "the guardian and estop do not look at the line's settings",
        ("another speed, then killed",),
        (
            f"{LASTRESORT}lastline.py",
            "return self._fd is not None and bool(line_settings.restore(self._fd))",
            "return False",
        ),
    ),
    scene(
        "a stranger's lock keeps the service out",
        "line",
        "a port that another program has locked is not opened",
        ("locked by a stranger",),
        (f"{LINK}serial.py", "!= errno.EAGAIN or holder(path).ours:", "!= errno.EAGAIN or True:"),
    ),
    scene(
        "a stranger's lock is no alarm",
        "line",
        "nobody is alarmed that another program has locked a port",
        ("locked by a stranger",),
        (f"{CORE}alarm.py", "or unknown or locked", "or unknown"),
    ),
    hostile(
        "a stranger's lock is respected at the end",
        "line",
        "estop --leave-held leaves alone what a stranger has locked",
        ("tests/guardian/test_laststop.py::test_a_strangers_lock_keeps_no_stop_away",),
        (f"{LASTRESORT}bareport.py", "        if holder(name, (os.getpid(),)).ours:", "        if True:"),
    ),
)

DISK: tuple[Seed, ...] = (
    scene(
        "a running charge is not kept",
        "disk",
        "it is not written down that a charger may be running",
        ("charging, then no power",),
        (
            f"{CORE}persisted.py",
            "running=memory.state in RUNNING or memory.intends or memory.unverified,",
            "running=False,",
        ),
        (
            f"{SERVICE}bay.py",
            "running_kept=(on_disk := self._store.on_disk(self.place)) is not None and on_disk.running,",
            "running_kept=True,",
        ),
    ),
    scene(
        "who ran is not held",
        "disk",
        "a charge that a crash has ended goes on by itself after the restart",
        ("charging, then no power",),
        (f"{CORE}persisted.py", "        if self.running:\n", "        if False:\n"),
    ),
    scene(
        "a charge begins before it is written down",
        "disk",
        "RUN goes out though the disk has not taken that the charger may be running",
        ("fsync hangs, begun, killed", "disk full"),
        (
            f"{SERVICE}bay.py",
            "running_kept=(on_disk := self._store.on_disk(self.place)) is not None and on_disk.running,",
            "running_kept=True,",
        ),
        (
            f"{SERVICE}store.py",
            '        if self._problem:\n            return f"a restart',
            '        if False:\n            return f"a restart',
        ),
        (
            f"{SERVICE}store.py",
            "        if pending_s is not None and now_s - pending_s > KEPT_WITHIN_S:",
            "        if False:",
        ),
    ),
    scene(
        "a request is answered before it is kept",
        "disk",
        "a stop is answered with yes while the disk has not taken it",
        ("stopped at rest, then no power at once",),
        (f"{SERVICE}asked.py", "        if answer is not None:\n", "        if True:\n"),
    ),
    part(
        "nobody is told what is not kept",
        "disk",
        "a disk that takes nothing is not reported, and a charge may begin",
        ("tests/service/test_store.py",),
        (
            f"{SERVICE}store.py",
            '        """Why a restart would forget something; "" while it would not."""\n',
            '        """Why a restart would forget something; "" while it would not."""\n        return ""\n',
        ),
    ),
    hostile(
        "an end that has kept nothing is a good one",
        "disk",
        "the service ends with 0 though the disk has not taken what the next start must know",
        ("tests/whole/test_survives.py::test_what_no_disk_takes_is_said_and_the_end_is_a_bad_one",),
        (
            f"{SERVICE}supervisor.py",
            "        unkept = self._store.close(KEEP_S)\n",
            '        self._store.close(KEEP_S)\n        unkept = ""\n',
        ),
    ),
    scene(
        "standard error is written before the state",
        "disk",
        "who writes the persisted state first waits for whoever reads standard error",
        ("standard error is not read",),
        (
            f"{SERVICE}store.py",
            "        stamp = self._stamp()\n        with self._lock:\n",
            '        stamp = self._stamp()\n        os.write(2, b"keeping\\n" * 1000)\n        with self._lock:\n',
        ),
    ),
    scene(
        "a hold is not kept",
        "disk",
        "an operator's stop is forgotten with a restart",
        ("stopped, then no power",),
        (f"{CORE}persisted.py", "            hold=memory.hold,\n", '            hold="",\n'),
    ),
    scene(
        "latches are not kept",
        "disk",
        "a fault that waits for a person is forgotten with a restart",
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
        "a fault that latches is written down with the next counters only",
        ("tests/core/test_persisted.py",),
        (
            f"{CORE}persisted.py",
            "return self.running, self.hold, self.paused, faults, resets,",
            "return self.running, self.hold, self.paused, resets,",
        ),
    ),
    part(
        "the directory is not synchronised",
        "disk",
        "after the rename the directory is not brought to the disk",
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
        "entries of bays that the station file lacks are dropped, and a bay without an entry is a new one",
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
        "a bay that the persisted state does not know charges at once",
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
        "a bay that has got another name in the station file has no past",
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
        "estop stops what the file names, not what was written down as running",
        ("file edited, then both killed",),
        (f"{LASTRESORT}inhand.py", '            if entry.get("running") and', "            if False and"),
    ),
    hostile(
        "a start ignores ports in hand",
        "disk",
        "a charger that the station file has lost runs on under the next service",
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

WITNESSES: tuple[Seed, ...] = (
    scene(
        "a stop while the service ends is lost",
        "reasons",
        "the reason of the end takes the place of an operator's stop in the same second",
        ("stopped while it ends",),
        (
            f"{SERVICE}bay.py",
            "        persisted = Persisted.of(memory, now_s)\n",
            "        persisted = Persisted.of(memory, now_s)\n        if self._ending:\n"
            '            persisted = replace(persisted, hold="")\n',
        ),
    ),
    scene(
        "the end of the service is a hold",
        "reasons",
        "a bay waits for a person after an orderly restart",
        ("restarted in order",),
        (
            f"{SERVICE}bay.py",
            "        self._ending = why\n",
            "        self._ending = why\n        if self._memory is not None:\n"
            '            self._memory.hold = self._memory.hold or Cause.of("service_ends", why=why)\n',
        ),
    ),
    part(
        "one sample verifies a stop",
        "witness",
        "one reply that shows standby is a proof of it",
        ("tests/core/test_witnesses.py",),
        (f"{CORE}witnesses/standby.py", "len(known.proof) < 2", "len(known.proof) < 1"),
    ),
    scene(
        "the charger alone verifies a stop",
        "witness",
        "the current that the BMU sees does not count",
        ("says standby",),
        (f"{CORE}witnesses/standby.py", "return f.pack_a is not None and f.pack_a > CHARGING_A", "return False"),
    ),
    part(
        "out of control is left at once",
        "witness",
        "UNCONTROLLABLE ends with the first standby, not with a lasting one",
        ("tests/core/test_witnesses.py",),
        (
            f"{CORE}safestop.py",
            "proved_to_last(f) if f.memory.state is State.UNCONTROLLABLE else f.stopped",
            "f.stopped",
        ),
    ),
    scene(
        "returns are not counted",
        "witness",
        "a charger that runs again within ten seconds begins anew each time",
        ("runs again",),
        (f"{CORE}safestop.py", "        runs_again = (f.runs", "        runs_again = False and (f.runs"),
    ),
    scene(
        "mode 5 alone is full",
        "witness",
        "a charger that somebody has stopped by other means is taken for full",
        ("stopped by other means",),
        (f"{CORE}finish.py", "    pack, trail = f.rules", "    return True\n    pack, trail = f.rules"),
    ),
    hostile(
        "estop believes one answer",
        "witness",
        "one answer in two that shows standby is a proof for estop",
        ("tests/guardian/test_laststop.py::test_one_answer_in_two_is_no_proof",),
        (f"{LASTRESORT}lastline.py", "PROOFS = 2\n", "PROOFS = 1\n"),
    ),
    hostile(
        "estop does not ask the BMU",
        "witness",
        "estop takes the service's charger at its word, whatever the BMU sees",
        ("tests/guardian/test_emergency.py::test_both_witnesses_have_to_agree",),
        (
            f"{LASTRESORT}running_service.py",
            ' if battery["online"] and bmu_a > BMU_STANDBY_A else ""',
            ' if False else ""',
        ),
    ),
)

PORTS: tuple[Seed, ...] = (
    scene(
        "ports are stopped one after another",
        "ports",
        "estop opens and stops one port after the other",
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
        "the guardian waits for a driver that takes its time over a close",
        ("tests/guardian/test_guardian.py::test_a_port_whose_close_hangs_keeps_nobody_from_watching",),
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
        "a port that was opened does not begin with a stop",
        ("tests/devices/test_charger_port.py::test_an_opened_port_stops_the_whole_charger_before_it_asks_anything",),
        (
            f"{DEVICES}schedule.py",
            "        self.order: Command | None = STOP  #: the standing order\n        self._urgent = True",
            "        self.order: Command | None = None  #: the standing order\n        self._urgent = False",
        ),
    ),
    scene(
        "the service ends at once",
        "ports",
        "SIGTERM ends the service without a stop",
        ("restarted in order",),
        (
            f"{SERVICE}supervisor.py",
            "            bay.end(self._ending, orderly=not self._lost)\n",
            "            return 0\n",
        ),
    ),
)

RESTARTS: tuple[Seed, ...] = (
    scene(
        "what flowed before a kill is forgotten",
        "restart",
        "ampere-hours that went in after the counters were last written count as nothing",
        ("ampere-hours over kills",),
        (
            f"{CORE}persisted.py",
            "min(seconds if unseen_s is None else unseen_s, COUNTERS_S) if self.running else 0.0",
            "0.0",
        ),
    ),
    part(
        "a charger that ran at the start was never stopped",
        "restart",
        "one that ran at the start and runs again after each stop is called uncontrollable one return later",
        ("tests/core/test_safestop.py::test_a_charger_that_ran_at_the_start_has_been_stopped_once_already",),
        (
            f"{CORE}safestop.py",
            '        if memory.stopping_s is None and "found_running" in f.raised:',
            "        if False:",
        ),
    ),
    scene(
        "the open charge is not kept",
        "restart",
        "ampere-hours and seconds of a charge begin anew with a restart",
        ("ampere-hours over restarts",),
        (
            f"{CORE}persisted.py",
            "            session=replace(session, started_s=now_s - session.started_s) if session is not "
            "None else None,\n            full_pct=memory.full_pct,",
            "            full_pct=memory.full_pct,",
        ),
    ),
    scene(
        "a lost BMU ends the charge",
        "restart",
        "the limits of a charge begin anew when its BMU was silent for a while",
        ("ampere-hours over silences",),
        (
            f"{CORE}step.py",
            "frozenset({State.FULL, State.IDLE, State.HELD, State.TRIPPED})",
            "frozenset({State.FULL, State.IDLE, State.HELD, State.TRIPPED, State.OFFLINE, State.SUSPENDED})",
        ),
    ),
    scene(
        "a precharge begins anew",
        "restart",
        "the time in which a precharged pack must rise begins anew with a restart",
        ("precharge over restarts",),
        (
            f"{CORE}persisted.py",
            "            session=replace(session, started_s=now_s - session.started_s) if session is not "
            "None else None,\n            full_pct=self.full_pct,",
            "            session=replace(session, started_s=now_s - session.started_s, rise_s=0.0, rise_v=None) "
            "if session is "
            "not None else None,\n            full_pct=self.full_pct,",
        ),
    ),
    part(
        "strikes are not kept",
        "restart",
        "a fault that comes again after each restart never latches",
        ("tests/core/test_persisted.py",),
        (
            f"{CORE}persisted.py",
            "                strikes=tuple(now_s - t_s for t_s in fault.strikes),\n",
            "                strikes=(),\n",
        ),
    ),
    part(
        "resets are not kept",
        "restart",
        "a restart allows three more resets",
        ("tests/core/test_persisted.py",),
        (f"{CORE}persisted.py", "            resets=tuple((now_s - t_s, name) for t_s, name in memory.resets),\n", ""),
    ),
)

CONDITIONS: tuple[Seed, ...] = (
    scene(
        "a debounce begins anew",
        "comes and goes",
        "one clean sample resets the time for which a condition has held",
        ("apart for most of the time",),
        (f"{CORE}drain.py", "max(0.0, seconds - DRAIN * passed_s)", "0.0"),
    ),
    scene(
        "a limit that goes back is not seen",
        "comes and goes",
        "neither a setting that goes back nor a current above the step is a fault",
        ("limit goes back",),
        (f"{CORE}checks/obedience.py", "    if step is None or len(recent) < MAX_REVERTS:\n", "    if True:\n"),
        (f"{CORE}checks/obedience.py", "    if f.amps <= allowed_a:\n", "    if True:\n"),
    ),
    part(
        "returns of a setting are not counted",
        "comes and goes",
        "a charger that confirms each step and drops it is well",
        ("tests/core/test_witnesses.py",),
        (f"{CORE}checks/obedience.py", "    if step is None or len(recent) < MAX_REVERTS:\n", "    if True:\n"),
    ),
    scene(
        "a loose plug never latches",
        "comes and goes",
        "a battery that leaves and comes back is charged again each time",
        ("loose plug",),
        (f"{CORE}track.py", "f.now_s if gap_s < LOOSE_PLUG_S and not _is_another(f) else None", "None"),
    ),
    scene(
        "another kind of pack is charged",
        "battery",
        "volts a cell, SOC and chemistry are not compared",
        ("a pack of 36 V",),
        (
            f"{CORE}witnesses/pack.py",
            "    if f.pack_v is None or f.soc is None:\n        return None\n",
            "    return None\n",
        ),
    ),
    scene(
        "another kind of pack is deeply discharged",
        "battery",
        "a pack of 24 V is said to be too deeply discharged",
        ("a pack of 24 V",),
        (f"{CORE}checks/battery.py", " or another_pack(f) is not None:", ":"),
    ),
    scene(
        "a pack may collapse",
        "battery",
        "a voltage that falls in mid-charge is no fault",
        ("a pack that collapses",),
        (
            f"{CORE}witnesses/pack.py",
            "    if f.memory.state is not State.CHARGING or f.pack_v is None",
            "    if True or f.pack_v is None",
        ),
    ),
    scene(
        "a BMU may stand still",
        "battery",
        "a BMU whose values do not change any more is believed",
        ("a BMU that is frozen",),
        (
            f"{CORE}witnesses/measured.py",
            "    if frozen is None or session is None or f.volts is None or",
            "    if True or session is None or",
        ),
    ),
    scene(
        "the first answer counts",
        "battery",
        "of two different answers to one request the first is believed",
        ("a temperature that is forged",),
        (f"{DEVICES}two_answers.py", "        if not apart:\n", "        if True:\n"),
    ),
    part(
        "nobody proves the pairing",
        "battery",
        "the first amperes need not show on the bay's own BMU",
        ("tests/core/test_witnesses.py",),
        (f"{CORE}witnesses/paired.py", "    if not f.energised or known.proved or", "    if True or known.proved or"),
    ),
    scene(
        "charges begin together",
        "battery",
        "the charges of a station do not begin one after the other",
        ("nothing happens",),
        (f"{SERVICE}starts.py", "        if not self._stagger_s:\n", "        if True:\n"),
    ),
    scene(
        "hot is not seen",
        "battery",
        "no current flows above 45 °C, the limit of pack and policy: now 50 °C",
        ("hot",),
        (f"{CORE}checks/battery.py", "    high = f.rules.temperature_c.high\n    again", "    high = 50.0\n    again"),
    ),
)

#: An arithmetic on a reading without its bounds.
DIVIDES: Change = (
    f"{CORE}witnesses/measured.py",
    "    if abs(volts - pack_v) <= volts_differ(f.rules.policy.faults, pack_v):",
    "    if abs(volts - pack_v) / pack_v <= volts_differ(f.rules.policy.faults, pack_v) / pack_v:",
)
#: A row that raises takes the whole step with it.
NOT_CAUGHT: Change = (
    f"{CORE}latches.py",
    "    except Exception as error:  # noqa: BLE001 - one row must not take the others, nor the machine, with it\n",
    "    except KeyError as error:\n",
)
OURS: tuple[Seed, ...] = (
    scene(
        "a reading is divided by",
        "exception",
        "a BMU that reads 0.00 V makes a check raise",
        ("a BMU that reads 0.00 V",),
        DIVIDES,
    ),
    part(
        "a row takes the others with it",
        "exception",
        "a check that raises ends the whole step",
        ("tests/core/test_failed.py",),
        NOT_CAUGHT,
    ),
    scene(
        "after an exception nothing is known",
        "exception",
        "an exception leaves the memory as it was: no fault is shown, and a stop is never given up",
        ("a BMU that reads 0.00 V",),
        DIVIDES,
        NOT_CAUGHT,
        (
            f"{SERVICE}bay.py",
            "            self.decision, self._memory = carry_on(now_s, snapshot, memory, internal, self.name)\n",
            '            self.decision = Decision(State.STOPPING, f"internal error: {internal}", STOP)\n',
        ),
    ),
    part(
        "after an exception a stop is not given up",
        "exception",
        "a bay that cannot be judged is never out of control",
        ("tests/core/test_failed.py",),
        (f"{CORE}failed.py", "    if tried_s >= OBEY_STOP_S:\n", "    if False:\n"),
    ),
    scene(
        "a torn line ends the replay",
        "record",
        "a journal with one line that cannot be read is not replayed",
        ("a record over lives",),
        (
            f"{WORKBENCH}replay/recording.py",
            "        except (BaseValidationError, LookupError, TypeError, ValueError, ",
            "        except (",
        ),
    ),
    scene(
        "runs are one run",
        "record",
        "a restart in a journal is taken for a deviation",
        ("a record over lives",),
        (f"{WORKBENCH}replay/recording.py", 'BREAKS = frozenset({"run", "lost"})', 'BREAKS = frozenset({"lost"})'),
        (f"{WORKBENCH}replay/again.py", "if recorded.gap or recorded.memory.last_s is None:", "if recorded.gap:"),
    ),
    part(
        "a reboot loses events",
        "record",
        "events of the second boot are looked for in the first one's steps",
        ("tests/workbench/test_replay.py",),
        (
            f"{WORKBENCH}replay/recording.py",
            '            later = [step for step in near if step.wall >= line["wall"]]  # a step is '
            "written down after its events\n",
            "            later = near[-1:]\n",
        ),
    ),
)

WORDS: tuple[Seed, ...] = (
    scene(
        "out of control is told with advice about cables",
        "words",
        "UNCONTROLLABLE does not begin with what to do",
        ("says standby", "cut off, then killed"),
        (
            f"{CORE}outofcontrol.py",
            '    id_ = "uncontrollable" if _heard(f) and f.runs else "uncontrollable_unproved"\n',
            "    return _witnesses(f)\n",
        ),
    ),
    scene(
        "a restart ends the alarm",
        "words",
        "a charger that ran when the service died and is not heard is no alarm",
        ("cut off and not heard, then killed",),
        (f"{CORE}alarm.py", "    unknown = memory.unverified and", "    unknown = False and"),
        (f"{CORE}safestop.py", "        return memory.unverified and f.state_s >= LOST_S\n", "        return False\n"),
        (
            f"{CORE}course.py",
            "if state is State.STARTING and not memory.unverified and not f.charger.online",
            "if state is State.STARTING and not f.charger.online",
        ),
    ),
    hostile(
        "a stop that is not verified is a success",
        "words",
        "orchestrator stop ends with 0 whatever becomes of the stop",
        ("tests/whole/test_operator.py::test_a_stop_that_is_not_obeyed_begins_with_what_to_do",),
        (
            "orchestrator/cli.py",
            "        unverified, then = _wait_for_standby(path, looked_at, every=arguments.all), ",
            "        unverified, then = dict[str, str](), ",
        ),
    ),
    hostile(
        "estop finds no station by itself",
        "words",
        "estop without arguments knows the file of this folder only",
        ("tests/guardian/test_emergency.py::test_else_those_of_the_services_that_run",),
        (
            f"{LASTRESORT}inhand.py",
            "    for place in PLACES:\n        yield _existing([place])\n    yield _existing(",
            "    yield _existing([PLACES[0]])\n    return\n    yield _existing(",
        ),
    ),
    part(
        "old values are not marked",
        "words",
        "a current that was last heard long ago is shown as one of now",
        ("tests/service/test_status.py", "tests/service/test_show.py"),
        (f"{SERVICE}status.py", '"old": age_s is not None and age_s > CHARGER_STALE_S,', '"old": False,'),
    ),
    hostile(
        "a success reads like a failure",
        "words",
        "an estop without a service ends with a complaint",
        ("tests/guardian/test_estop.py::test_ports_without_a_service",),
        (f"{LASTRESORT}running_service.py", "        if not _listens(self._named):\n", "        if False:\n"),
    ),
)

BUS: tuple[Seed, ...] = (
    scene(
        "another master's answer is a second node",
        "bus",
        "answers that another master asked for count as a second BMU's",
        ("on the bus, reads all", "on the bus, master"),
        (f"{DEVICES}whose_answer.py", "    if not others.active:\n", "    if True:\n"),
    ),
    part(
        "a refusal to another master is ours",
        "bus",
        "an abort that answers somebody else's write trips the bay",
        ("tests/devices/test_battery_others.py",),
        (
            f"{DEVICES}whose_answer.py",
            "    if isinstance(reply, SdoValue):\n        client.asked_s",
            "    if True:\n        client.asked_s",
        ),
    ),
    scene(
        "CAN FD frames are CANopen's",
        "bus",
        "a CAN FD frame with a BMU's id is taken for its answer",
        ("on the bus, fd",),
        (f"{LINK}can.py", " or message.is_fd or", " or"),
    ),
    scene(
        "a heartbeat that somebody has set stays so",
        "bus",
        "a heartbeat period that another master has set stays",
        ("on the bus, heartbeat",),
        (
            f"{DEVICES}bmu_setup.py",
            '        if period_ms == round(self._heartbeat_s * 1000):\n            return ""\n',
            '        if True:\n            return ""\n',
        ),
    ),
    part(
        "a filter of the station's own is refused",
        "bus",
        "can_filters in the station file are refused, whatever they let through",
        ("tests/config",),
        ("orchestrator/config/station_rules.py", "        if passed is None:\n", "        if True:\n"),
    ),
    part(
        "the kernel filters nothing",
        "bus",
        "every frame of a shared bus comes to the service",
        ("tests/link/test_can_filter.py",),
        (
            f"{LINK}can.py",
            "            if self._filtered and self._callbacks and",
            "            if False and self._callbacks and",
        ),
    ),
)

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
        "an idle client at the control socket holds up a stop",
        (
            "tests/service/test_control.py::test_one_who_says_nothing_holds_nobody_up_and_is_sent_away",
            "tests/service/test_control.py::test_idle_clients_do_not_count_however_many_they_are",
        ),
        (f"{SERVICE}client.py", "        connection.settimeout(0)\n", "        connection.settimeout(CLIENT_S)\n"),
    ),
    hostile(
        "who asks may wait for ever",
        "surroundings",
        "an answer that drips byte for byte holds up whoever asks",
        ("tests/service/test_control.py::test_who_asks_waits_so_long_and_no_longer",),
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
        "what a Latin-1 terminal cannot show ends a verb with a traceback",
        ("tests/test_surroundings.py::test_no_terminal_is_too_poor",),
        (
            "orchestrator/__main__.py",
            '        stream.reconfigure(errors="backslashreplace")',
            '        stream.reconfigure(errors="strict")',
        ),
    ),
    part(
        "a thread for each hang-up",
        "surroundings",
        "each SIGHUP starts one more thread that reads the files",
        ("tests/service/test_reload.py",),
        (
            f"{SERVICE}reload.py",
            "        self._asked.set()\n",
            "        threading.Thread(target=self.read, daemon=True).start()\n",
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

SEEDS: tuple[Seed, ...] = (
    *LINES,
    *DISK,
    *WITNESSES,
    *PORTS,
    *RESTARTS,
    *CONDITIONS,
    *OURS,
    *WORDS,
    *BUS,
    *SURROUNDINGS,
)
