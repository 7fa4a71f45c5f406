"""Seeds about internal errors."""

from tests.proof.seeded.seed import CORE, SERVICE, WORKBENCH, Change, Seed, part, scene

#: Arithmetic on a reading without a range check.
DIVIDES: Change = (
    f"{CORE}witnesses/measured.py",
    "    if abs(volts - pack_v) <= volts_differ(f.rules.policy.faults, pack_v):",
    "    if abs(volts - pack_v) / pack_v <= volts_differ(f.rules.policy.faults, pack_v) / pack_v:",
)
#: A row that raises aborts the whole decision.
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
        "a check that raises aborts the whole decision",
        ("tests/core/test_failed.py",),
        NOT_CAUGHT,
    ),
    scene(
        "after an exception nothing is known",
        "exception",
        "an exception leaves the memory unchanged: no fault is shown, and a stop is never given up",
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
        "a journal with one unreadable line is not replayed",
        ("a record over lives",),
        (
            f"{SERVICE}journal_files.py",
            "                except (LookupError, TypeError, ValueError, RecursionError, OverflowError) as error:\n",
            "                except (RecursionError, OverflowError) as error:\n",
        ),
    ),
    scene(
        "runs are one run",
        "record",
        "a restart in a journal counts as a deviation",
        ("a record over lives",),
        (f"{WORKBENCH}replay/recording.py", 'BREAKS = frozenset({"run", "lost"})', 'BREAKS = frozenset({"lost"})'),
        (f"{WORKBENCH}replay/again.py", "if recorded.gap or recorded.memory.last_s is None:", "if recorded.gap:"),
        (
            f"{WORKBENCH}replay/again.py",
            "elif ours is not None and ours.last_s == recorded.memory.last_s:",
            "elif ours is not None:",
        ),
    ),
    part(
        "a reboot loses events",
        "record",
        "events of the second boot are searched in the first boot's decisions",
        ("tests/workbench/test_replay.py",),
        (
            f"{WORKBENCH}replay/events.py",
            "        while self._run != run and run in self._runs and self._next is not None:\n",
            "        while not self._run and self._next is not None:\n",
        ),
    ),
)
