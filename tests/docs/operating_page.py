"""docs/operating.md: `python -m tests.docs.operating_page DIRECTORY > docs/operating.md`, with an empty directory.

The whole service in virtual time, with a real journal, and a real control socket that real commands ask. Every run has
other times.
"""

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

from orchestrator.config.station import JournalConfig
from orchestrator.core.memory import Memory
from orchestrator.model import ControlMode, Request
from orchestrator.model.cause import plain
from orchestrator.record.lines import Record, encoded
from orchestrator.record.months import FOLDER
from orchestrator.record.spread import PARTS as PARTS_OF_VALUES
from orchestrator.record.table import BOM
from orchestrator.service import bay as bay_module
from orchestrator.service import policy_in_force as policy_module
from orchestrator.service.asked import Asked
from orchestrator.service.asker import Asker
from orchestrator.service.control import ControlSocket
from orchestrator.service.journal import GATHER_S, Journal
from orchestrator.sim.faults import FAULTS
from orchestrator.sim.presets import PACKS
from tests.proof.virtual_rig import Nature
from tests.proof.virtual_service import World, station, world
from tests.record.aged_battery import Life
from tests.record.health_lives import charges_of
from tests.record.made import FULL
from tests.waiting import wait_until
from tests.whole.recipe import until_all_charge
from tests.whole.station import whole_station
from tests.whole.terminal import Terminal

LINES, COLUMNS = 90, 100
WINDOW = (30, 80)
#: Where the page says that the station is.
SHOWN = "/srv/depot"
#: How long the station of three bays runs before its power fails, and after that, in virtual time.
BEFORE_S, AFTER_S, MANY_S = 60.0, 900.0, 60.0
#: Virtual time has this start over the clock, which then is waited for.
LEAD_S = 150.0
#: The bays of the smaller station, and the SOC in the last of them.
FEW, FULL_PCT = 5, 99.0
#: The seed of a battery that has aged.
AGED = 22
HEAD = """\
# Operating a station: a question, a command

Each command below was run on an emulated station, and its output is as it came, on a terminal of 100 columns: five
bays, one overheated, one with a loose plug, one stopped, one full, a quarter of an hour after a power failure.
`python -m tests.docs.operating_page DIRECTORY` makes this page again.

"""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a question is asked with, and what to look at."""

    question: str
    look: str
    command: str
    also: tuple[str, ...] = ()  #: further questions that the same output answers
    columns: int = COLUMNS  #: of the terminal


ANSWERS = (
    Answer(
        "What does each bay do, and why?", "What needs a person comes first. WHY ends with what comes next.", "status"
    ),
    Answer(
        "Is anything wrong? (for a script)",
        "The exit status: 1 if anything needs a person.",
        "status --check --problems",
    ),
    Answer(
        "All about one bay",
        "The page of a bay answers most of an operator's questions:",
        "status bay-1",
        (
            "since when: STATE",
            "how much so far: SESSION",
            "when full: FORECAST (the BMU's own, and [ours](journal.md#how-long-a-charge-takes))",
            "what limits the current: LIMITS, the lowest first; the one that sets the step *binds*",
            "which policy is in force, and since when: POLICY",
        ),
    ),
    Answer("May I reset it, and when?", "NEXT says it, and which command to type.", "status bay-2"),
    Answer("Does it go on by itself, and when?", "NEXT again: with a time, where there is one.", "status bay-3"),
    Answer("Why did it stop an hour ago?", "What needed a person is marked.", "history bay-2 --since 2h"),
    Answer(
        "Who stopped it, and why?",
        "Each stop, pause and start has a name, a time and, with `--because`, a reason. `status bay-4` says it, too.",
        "history bay-4 --limit 3",
    ),
    Answer(
        "Let it start at 22:00",
        "It stays as it is until then. `stop`, `pause`, or another start, cancels it, and it is not made where "
        "somebody must look first. With `--to`, it also has a target.",
        "start bay-4 --at 22:00",
    ),
    Answer(
        "Does it start by itself, and when?",
        "NEXT says it. BATTERY begins with which one it is. "
        "If it was not made, or a stop or a pause has cancelled it, NOTES says why, for a day.",
        "status bay-4",
    ),
    Answer(
        "Charge it although it is at 99 %",
        "`--to` replaces the policy's target for this one charge; its limits hold as ever. A plain `start` says that "
        "there is nothing to do, and names this command.",
        "start bay-5 --to 100",
    ),
    Answer("How far does it charge, and who wants that?", "NOTES says it until the charge is over.", "status bay-5"),
    Answer(
        "How much energy today?",
        "KWH of each charge, and the sum below. A charge that goes on has what it took until it was last recorded. "
        "`report` sums up a month.",
        f"sessions --since 1d --journal {SHOWN}/journal",
    ),
    Answer(
        "The last ten charges, for a spreadsheet",
        "Into a file: `> charges.csv`.",
        f"sessions --limit 10 --csv --journal {SHOWN}/journal",
        columns=900,
    ),
    Answer(
        "What did this bay do last week?",
        "The same, further back; `--until` ends it earlier.",
        "history bay-3 --since 7d",
    ),
    Answer(
        "What was the last failure of the station itself?",
        "Its beginnings, ends and failures; the latter are marked.",
        "history --station --limit 6",
    ),
)
MANY = Answer(
    "Which of 64 bays need me?",
    "In a window of 80 × 30; `status --problems` has the whole sentences.",
    "status --group",
)
PAUSE = Answer(
    "Pause all bays but one",
    "The exit status is 0 once all of them stand by. `start` lets them go on; each charge goes on where it was.",
    "pause --all --except bay-1",
)
BATTERIES = (
    Answer(
        "Which battery gets old?",
        "Those of a month that need a look, last. Each charge measures its battery: what it still holds and its "
        "resistance, each with an interval that says how far to believe it, and a warning where the BMU's own SOH does "
        "not fit. What the figures mean, and when there are none: [health.md](health.md).",
        f"report --month 2025-11 --journal {SHOWN}/journal",
    ),
    Answer(
        "How old is this one?",
        "Its life, its health, its charges.",
        f"battery B-0042 --limit 3 --journal {SHOWN}/journal",
    ),
)


def shown(directory: Path, command: str, lines: int = LINES, columns: int = COLUMNS) -> str:
    """The command and what it says, as in a terminal, with its exit status if that is not 0."""
    env = {
        "ORCHESTRATOR_SOCKET": str(directory / "socket"),
        "NO_COLOR": "1",
        "LC_ALL": "en_US.UTF-8",
        "SUDO_USER": "kim",
    }
    with Terminal(lines, columns, *command.replace(SHOWN, str(directory)).split(), env=env) as terminal:
        status = terminal.end()
        text = "\n".join(line.rstrip() for line in terminal.screen.lines).rstrip()
        assert not terminal.screen.wrapped, command
        assert not terminal.screen.scrolled, command
    text = text.replace(str(directory), SHOWN).replace(BOM, "")
    code = f"\n$ echo $?\n{status}" if status else ""
    return f"```text\n$ orchestrator {command}\n{text}{code}\n```\n"


def section(answer: Answer, output: str) -> str:
    """A question, where to look, and the output."""
    also = "".join(f"- {one}\n" for one in answer.also)
    return f"## {answer.question}\n{answer.look}\n\n{also}{chr(10) if also else ''}{output}\n"


def shown_of(directory: Path, answer: Answer) -> str:
    return section(answer, shown(directory, answer.command, columns=answer.columns))


@contextmanager
def living(
    directory: Path, bays: int, boot: str, began_s: float, kept: Mapping[str, Memory] | None = None
) -> Iterator[World]:
    """A station in virtual time, `began_s` in Unix time, that writes its journal and answers on its socket."""
    settings = replace(
        station([ControlMode.MANUAL] * bays), station="depot-1", stagger_s=0.0,
        journal=JournalConfig(directory=directory / "journal", snapshots=False),
    )  # fmt: skip
    natures = []
    for number in range(bays):
        pack = PACKS["48v"]()
        pack.set_soc(FULL_PCT if bays == FEW and number == FEW - 1 else 40.0 + number * 7 % 50)
        natures.append(Nature(pack, seed=number + 1))
    now: list[Callable[[], float]] = [lambda: began_s]
    with (
        patch.object(policy_module, "time", lambda: now[0]()),
        patch.object(bay_module, "time", lambda: now[0]()),
        world(settings, natures, end_s=3600.0, kept=kept) as made,
        patch.object(bay_module, "monotonic", lambda: made.time.now_s),
    ):
        begin_s = made.time.now_s
        now[0] = lambda: began_s + made.time.now_s - begin_s
        journal = Journal(directory / "journal", 100.0, lambda: made.time.now_s, lambda: now[0](), boot=boot)
        recorder = made.supervisor._recorder
        assert recorder is not None
        recorder.boot = boot
        made.journal.put, made.journal.note = journal.put, journal.note  # type: ignore[method-assign]
        made.journal.problem = lambda _: None  # type: ignore[attr-defined]

        def write() -> None:
            made.time.call_later(GATHER_S, write)
            journal._write()

        write()
        yield made


def ask(made: World, directory: Path, questions: Callable[[], list[str]]) -> list[str]:
    """The answers of real commands, while virtual time stands still, but for the bay of which something is asked."""
    told_s = vars(bay_module)["time"]()
    wait_until(lambda: time.time() >= told_s, 2 * LEAD_S, "the time that the station tells", every_s=0.1)

    def answer(request: Mapping[str, object]) -> object:
        found = made.supervisor._sockets.handler.answer(request)
        for bay in made.bays:
            if bay._requests:
                bay.run(made.time.now_s)
        return found

    socket = ControlSocket(directory / "socket", answer, time.monotonic)  # type: ignore[arg-type]  # as the handler's
    socket.start()
    try:
        return questions()
    finally:
        socket.close()


def small(directory: Path) -> Iterator[str]:
    """The sections of the station with five bays, which was without power meanwhile."""
    began_s, found = time.time() + LEAD_S - AFTER_S, list[str]()
    with living(directory, FEW, "boot-1", began_s - BEFORE_S - 30) as made:
        made.time.call_later(BEFORE_S, setattr, made.journal, "put", lambda *_: None)
        made.time.call_later(BEFORE_S, setattr, made.journal, "note", lambda *_: None)
        kept: dict[str, Memory] = {}

        def fail() -> None:
            kept.update({name: one.memory(1000.0) for name, one in made.store.persisted.items()})
            made.end()

        made.time.call_later(BEFORE_S, fail)
        made.run()
    with living(directory, FEW, "boot-2", began_s, kept) as made:
        later, (_, second, third, *_) = made.time.call_later, made.rigs
        for number in range(4):
            later(40.0, made.ask, Request.START, number)
        kim = Asker(uid=0, behind="kim", because="wet floor", unix_s=began_s + AFTER_S - 600)
        later(AFTER_S - 600, made.bays[3].ask, Asked(Request.STOP, kim))
        later(AFTER_S - 30, setattr, second.bay.pack, "temperature_c", 57.0)
        later(AFTER_S - 25, third.inject, lambda rig: FAULTS["battery_removed"].happen(rig, None))
        later(AFTER_S - 15, third.inject, lambda rig: FAULTS["heal"].happen(rig, None))

        def look() -> None:
            found.extend(ask(made, directory, lambda: [shown_of(directory, one) for one in ANSWERS]))
            made.end()

        later(AFTER_S, look)
        made.run()
    yield from found


def large(directory: Path) -> Iterator[str]:
    """The section of the station with 64 bays."""
    found: list[str] = []
    with living(directory, 64, "boot-1", time.time() + LEAD_S - MANY_S) as made:
        for number in (6, 22):
            made.time.call_later(MANY_S - 20, setattr, made.rigs[number].bay.pack, "temperature_c", 57.0)

        def look() -> None:
            found.extend(ask(made, directory, lambda: [section(MANY, shown(directory, MANY.command, *WINDOW))]))
            made.end()

        made.time.call_later(MANY_S, look)
        made.run()
    yield from found


def real(directory: Path) -> Iterator[str]:
    """The section that waits for chargers: an emulated plant, and the service in real time."""
    with whole_station(directory, 3) as (plant, service):
        service.start()
        until_all_charge(plant, service)
        (directory / "socket").symlink_to(service.socket)
        yield section(PAUSE, shown(directory, PAUSE.command))


def whole(record: Record) -> Record:
    """The record of such a charge with the figures of its stretch."""
    found = record["measured"]["stretch"]
    ah, soc = found["charger_ah"], (found["from_pct"], found["to_pct"], found["from_pct"], found["to_pct"])
    values = {**record["values"], "soc_pct": dict(zip(PARTS_OF_VALUES, soc, strict=True))}
    charger, bmu = {"ah": ah, "wh": 50.0 * ah}, {"ah": found["bmu_ah"], "wh": 50.0 * found["bmu_ah"]}
    return {**record, "station": "depot-1", "values": values, "charger": charger, "bmu": bmu, "result": plain(FULL)}


def old(directory: Path) -> Iterator[str]:
    """The sections of a battery that has aged, while its BMU has not noticed."""
    folder = directory / "journal" / FOLDER
    folder.mkdir(parents=True)
    life = Life(AGED)
    life.count, life.hall_c, life.season_k, life.deepest_pct, life.stale_soh = 12, 25.0, 0.0, 10.0, True
    (folder / "2025-12.jsonl").write_bytes(b"".join(map(encoded, map(whole, charges_of(life)))))
    yield from (shown_of(directory, one) for one in BATTERIES)


#: The parts of the page, by the names of their directories.
PARTS = {"small": small, "large": large, "real": real, "old": old}


def main(directory: Path, only: Sequence[str] = ()) -> None:
    """Print the page, or only these parts of it."""
    for name in only or PARTS:
        (directory / name).mkdir(parents=True, exist_ok=True)
    parts = [part for name in only or PARTS for part in PARTS[name](directory / name)]
    print(("" if only else HEAD) + "\n".join(part.rstrip() + "\n" for part in parts), end="")  # noqa: T201 - the page


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
