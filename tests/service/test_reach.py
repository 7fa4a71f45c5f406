"""What `check` says about a station's journal."""

from dataclasses import replace

import pytest

from orchestrator.config.station import Control, JournalConfig, Station
from orchestrator.service.reach import reach
from tests.service.bench import the_bay


def the_station(bays: int, max_mb: float, *, snapshots: bool = True, buses: int = 1) -> Station:
    config = the_bay()
    return Station(
        station="test",
        can={f"can{number}": {} for number in range(buses)},
        bays=tuple(
            replace(config, name=f"bay-{number}", battery=replace(config.battery, can=f"can{number % buses}"))
            for number in range(bays)
        ),
        control=Control(socket="run/socket"),  # type: ignore[arg-type]  # nobody opens it
        journal=JournalConfig(directory="run", snapshots=snapshots, max_mb=max_mb),  # type: ignore[arg-type]  # it, too
    )


@pytest.mark.parametrize(
    ("station", "said"),
    [
        (
            the_station(1, 256.0),
            "with the bay charging day and night, 256 MB hold about 33 days to replay; about 7 MB",
        ),
        (
            the_station(16, 1000.0),
            "with 16 bays charging day and night, 1000 MB hold about 22 days to replay; about 46",
        ),
        (the_station(64, 500.0, buses=4), "500 MB hold about 65 hours to replay; about 182 MB are written a day"),
        (the_station(16, 1000.0, buses=16), "1000 MB hold about 13 days to replay"),
        (
            the_station(2, 20.0, snapshots=False),
            "20 MB hold the events of about 4 days, and nothing to replay; about 1",
        ),
    ],
    ids=["one", "16", "64", "16 on buses of their own", "no snapshots"],
)
def test_it_says_how_far_the_journal_reaches_and_what_it_writes(station: Station, said: str) -> None:
    (line,) = reach(station)
    assert said in line
    assert line.startswith("<station>: journal: ")


def test_64_bays_write_less_than_a_gigabyte_a_day() -> None:
    (line,) = reach(the_station(64, 1000.0, buses=64))
    assert int(line.rpartition("about ")[2].split()[0]) < 1000
