"""docs/operating.md, with what each command says of an emulated station.

`python -m tests.docs.operating_page DIRECTORY > docs/operating.md`, with an empty directory, on a machine that has
nothing else to do. It takes two minutes, and every run has other times and figures.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event

from tests.waiting import wait_until
from tests.whole.station import Document, Service, whole_station
from tests.whole.terminal import Terminal

COLUMNS, LINES = 100, 90
WINDOW = (30, 80)
#: Where the page says that the station is.
SHOWN = "/srv/depot"
HEAD = """\
# Operating a station: a question, a command

Each command below was run against an emulated station, and its output is as it came, on a terminal of 100 columns:
three bays at work, one overheated, one with a loose plug, after somebody had killed the service. The batteries live
eight times as fast as the clock, so our own estimate, which counts ampere-hours, is not what a real one would show.
`python -m tests.docs.operating_page DIRECTORY` makes this page again.

"""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a question is asked with, and what to look at."""

    question: str
    look: str
    command: str
    also: tuple[str, ...] = ()  #: further questions that the same output answers


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
        "What did this bay do last week?",
        "The same, further back; `--until` ends it earlier.",
        "history bay-3 --since 7d",
    ),
    Answer(
        "What was the last failure of the station itself?",
        "Its beginnings, ends and failures; the latter are marked.",
        "history --station --limit 6",
    ),
    Answer(
        "Pause all bays but one",
        "`start` lets them go on; each charge goes on where it was.",
        "pause --all --except bay-1",
    ),
)
MANY = Answer(
    "Which of 64 bays need me?",
    "In a window of 80 × 30; `status --problems` has the whole sentences.",
    "status --group",
)


def shown(service: Service, command: str, lines: int = LINES, columns: int = COLUMNS) -> str:
    """The command and what it says, as in a terminal, with its exit status if that is not 0."""
    env = {"ORCHESTRATOR_SOCKET": str(service.socket), "NO_COLOR": "1", "LC_ALL": "en_US.UTF-8"}
    with Terminal(lines, columns, *command.split(), env=env) as terminal:
        status = terminal.end()
        assert not terminal.screen.wrapped and not terminal.screen.scrolled, command
        text = "\n".join(line.rstrip() for line in terminal.screen.lines).rstrip()
    text = text.replace(str(service.directory), SHOWN)
    code = f"\n$ echo $?\n{status}" if status else ""
    return f"```text\n$ orchestrator {command}\n{text}{code}\n```\n"


def section(answer: Answer, output: str) -> str:
    also = "".join(f"- {one}\n" for one in answer.also)
    return f"## {answer.question}\n{answer.look}\n\n{also}{chr(10) if also else ''}{output}\n"


def shipped_policy(document: Document) -> None:
    document["station"] = "depot-1"
    for bay in document["bays"]:
        bay["policy"] = "li-ion-48v"


def small(directory: Path) -> Iterator[str]:
    """The sections of the station with three bays."""
    pause = Event()
    with whole_station(directory, 3, "--soc", "55", "--speed", "8", change=shipped_policy) as (plant, service):
        names = ["bay-1", "bay-2", "bay-3"]
        service.start().wait("CHARGING", names, 60)
        pause.wait(5)
        service.kill_all()
        service.start().wait("HELD", names, 60)
        service.ask("start")
        service.wait("CHARGING", names, 60)
        pause.wait(35)
        plant.set(2, temperature_c=57.0)
        plant.inject("battery_removed", 3)
        service.wait("TRIPPED", ["bay-2"], 30)
        service.wait("IDLE", ["bay-3"], 30)
        plant.inject("heal", 3)
        service.wait("SUSPENDED", ["bay-3"], 30)
        for answer in ANSWERS:
            yield section(answer, shown(service, answer.command))


def large(directory: Path) -> Iterator[str]:
    """The section of the station with 64 bays."""
    with whole_station(directory, 64, "--soc", "55", "--speed", "8", change=shipped_policy, buses=4) as (
        plant,
        service,
    ):
        service.start()
        wait_until(
            lambda: sum(bay["state"] == "CHARGING" for bay in service.status().values()) > 60, 120, "they charge"
        )
        for bay in (7, 23):
            plant.set(bay, temperature_c=57.0)
        service.wait("TRIPPED", ["bay-7", "bay-23"], 60)
        yield section(MANY, shown(service, MANY.command, *WINDOW))


#: The parts of the page, by the names of their directories.
PARTS = {"small": small, "large": large}


def main(directory: Path, only: Sequence[str] = ()) -> None:
    """Print the page, or only these parts of it."""
    for name in only or PARTS:
        (directory / name).mkdir(parents=True, exist_ok=True)
    parts = [part for name in only or PARTS for part in PARTS[name](directory / name)]
    print(("" if only else HEAD) + "\n".join(part.rstrip() + "\n" for part in parts), end="")  # noqa: T201 - the page


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
