"""A policy changed while a bay charges: reread on request, in force at the next standby, never half."""

import threading
import time
from pathlib import Path

import pytest

from orchestrator.config.load import load_station
from orchestrator.config.shipped import shipped_dir
from orchestrator.config.station import Station
from orchestrator.model import Request, State
from orchestrator.service.reload import Reading, Reload
from tests.core.said import into
from tests.service.bench import Bench
from tests.waiting import wait_until

STATION = """\
station: test
can: {can0: {interface: virtual}}
bays:
  - name: bay-1
    charger: {port: /dev/ttyX, control: manual, steps_a: [2.0, 5.0, 8.0, 11.0, 14.0]}
    battery: {can: can0, node_id: 0x10, map: tabos}
    limits: {voltage_v: 58.4, current_a: 15.0, temperature_c: [0, 45]}
    policy: mine.yaml
control: {socket: run/socket}
journal: {directory: run/journal}
"""


class Site:
    """A station file with a policy next to it, and its bay."""

    def __init__(self, directory: Path) -> None:
        self.station_file, self.policy_file = directory / "station.yaml", directory / "mine.yaml"
        self.policy_file.write_text((shipped_dir() / "policies/li-ion-48v.yaml").read_text())
        self.station_file.write_text(STATION)
        station = load_station(self.station_file)
        self.bench = Bench(directory, bay=station.bays[0])
        self.said: list[str] = []
        self.reload = Reload(station, [self.bench.bay], into(self.said))

    def edit(self, file: Path, old: str, new: str, *, read: bool = True) -> None:
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new))
        self.said.clear()
        if read:
            self.read()

    def read(self) -> Reading:
        reading = Reading()
        self.reload.read(reading)
        return reading

    def edit_finish(self, *, read: bool = True) -> None:
        self.edit(self.policy_file, "target_soc_pct: 100 ", "target_soc_pct: 99 ", read=read)

    def pause(self) -> None:
        """Let the thread that reads go on."""
        threading.Event().wait(0.01)

    @property
    def policy(self) -> dict[str, str]:
        return self.bench.bay.status()["policy"]  # type: ignore[return-value]  # a JSON document


@pytest.fixture(name="site")
def _site(tmp_path: Path) -> Site:
    return Site(tmp_path)


def test_a_charge_goes_on_by_the_policy_that_it_began_with(site: Site) -> None:
    site.bench.charging()
    before = site.policy
    site.edit_finish()
    (said,) = site.said
    assert said.startswith("bay-1: reload: policy li-ion-48v (")
    assert "): finish.target_soc_pct 100 → 99; comes" in said
    assert said.endswith("comes into force when the bay stands by")
    site.bench.step(50)
    assert site.bench.bay.status()["state"] == "CHARGING"
    waiting = site.policy["waiting_sha256"]
    assert waiting not in ("", before["sha256"])
    assert site.policy == before | {"waiting_sha256": waiting}
    site.bench.ask(Request.PAUSE)
    site.bench.until(State.SUSPENDED)
    site.bench.step(2)
    assert site.policy == before | {"sha256": waiting, "since": site.policy["since"]}
    site.bench.ask(Request.START)
    site.bench.charging()
    site.bench.battery.values["soc_pct"] = 99.0
    site.bench.until(State.FULL)


def test_what_stands_by_takes_it_over_at_once(site: Site) -> None:
    site.bench.battery.values["soc_pct"] = 99.0
    site.bench.until(State.IDLE)
    before = site.policy["sha256"]
    site.edit_finish()
    site.bench.step()
    assert site.policy["sha256"] != before
    assert any("is in force" in line for line in site.bench.said)


def test_many_hangups_are_one_thread_and_one_more_reading(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk hangs during repeated requests: nobody waits, nothing piles up."""
    readings, go = [], threading.Event()

    def hanging(file: Path) -> Station:
        readings.append(file)
        go.wait()
        return load_station(file)

    monkeypatch.setattr("orchestrator.service.reload.load_station", hanging)
    before = threading.active_count()
    site.reload.start()
    site.reload.ask()
    wait_until(lambda: len(readings) == 1, what="the first reading")
    began_s = time.monotonic()
    for _ in range(1000):
        site.reload.ask()
    assert time.monotonic() - began_s < 1
    assert threading.active_count() == before + 1
    go.set()
    wait_until(lambda: len(site.said) == 2, what="what came of it")
    assert len(readings) == 2


def test_a_reading_that_fails_in_our_own_code_is_not_the_last(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as broken_world:
        broken_world.setattr("orchestrator.service.reload.load_station", lambda _: 1 / 0)
        site.reload.start()
        site.reload.ask()
        wait_until(lambda: "reload failed, every policy stays as it is: ZeroDivisionError" in "".join(site.said))
    site.reload.ask()
    wait_until(lambda: "bay-1: reload: policy" in "".join(site.said), what="the next one")


def test_a_comment_changes_the_lines_that_reasons_name(site: Site) -> None:
    site.bench.battery.values["soc_pct"] = 99.0
    site.bench.until(State.IDLE)
    site.edit(site.policy_file, "policy: li-ion-48v", "# one more line\npolicy: li-ion-48v")
    site.bench.step(2)
    line = (
        site.policy_file.read_text()
        .splitlines()
        .index("  soc_below_pct: 98                    # below this; a fuller one is left alone")
        + 1
    )
    assert f"mine.yaml:{line}" in str(site.bench.bay.status()["reason"])


def test_a_file_with_an_error_changes_nothing(site: Site) -> None:
    site.bench.step()
    before = site.policy
    site.edit(site.policy_file, "target_soc_pct: 100 ", "target_soc_pct: 101 ")
    (said,) = site.said
    first, *_, last = said.splitlines()
    assert first.startswith(f"{site.policy_file}:") or "mine.yaml:" in first
    assert ": error: " in first
    assert last.endswith("reload refused, every policy stays as it is")
    site.bench.step(20)
    assert site.policy == before


def test_what_is_as_it_was_is_left_alone(site: Site) -> None:
    site.bench.step()
    site.read()
    (said,) = site.said
    assert said.endswith("is unchanged")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("current_a: 15.0", "current_a: 8.0", {"bay-1": "limits.current_a 15 → 8"}),
        ("[0, 45]}", "[0, 46]}", {"bay-1": "limits.temperature_c 0 … 45 → 0 … 46"}),
        ("manual, ", "automatic, ", {"bay-1": "charger.control manual → automatic"}),
        ("name: bay-1", "name: bay-2", {"bay-1": "this bay is no longer in it", "bay-2": "this bay is new in it"}),
        ("run/socket", "run/other", {"station.yaml": "control.socket HERE/run/socket → HERE/run/other"}),
    ],
)
def test_hard_limits_and_wiring_are_for_a_restart(site: Site, old: str, new: str, said: dict[str, str]) -> None:
    before = site.policy
    site.edit(site.station_file, old, new)
    found = [line.replace(str(site.station_file.parent), "HERE") for line in site.said]
    restart = "only a restart of the service brings that into force"
    assert [line for line in found if not line.endswith("is unchanged")] == [
        f"{name}: reload: the station file has changed here ({what}): {restart}" for name, what in said.items()
    ]
    site.bench.step(20)
    assert site.policy == before


def test_what_is_taken_back_before_it_came_into_force_never_does(site: Site) -> None:
    site.bench.charging()
    before = site.policy
    site.edit_finish()
    site.edit(site.policy_file, "target_soc_pct: 99 ", "target_soc_pct: 100 ")
    assert site.policy == before
