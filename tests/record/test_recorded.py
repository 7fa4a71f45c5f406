"""The record of a bay's charges, as it is on the disk: over ends, pauses, restarts and deaths of the service."""

import gzip
import time
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator import __version__
from orchestrator.core.persisted import Persisted
from orchestrator.model import Cause, Decision, Request, Snapshot, State
from orchestrator.record.charges import Charges
from orchestrator.record.forecast import Forecast, follow
from orchestrator.record.look import Foreseen, Look
from orchestrator.record.stamp import Stamp
from orchestrator.record.table import why_ended
from orchestrator.service.asked import Asked
from orchestrator.service.asker import Asker
from orchestrator.service.recorder import Recorder
from tests.record.kept import WALL_S, Kept
from tests.service.bench import the_bay

RUNNING = Decision(State.CHARGING, Cause("charging"))


def _by_the_bmu() -> Foreseen:
    return Foreseen(100.0, 37.0, None)


@pytest.fixture(name="kept")
def _kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kept:
    kept = Kept(tmp_path)
    monkeypatch.setattr("orchestrator.service.bay.time", kept.wall)
    monkeypatch.setattr("orchestrator.record.charge.CHECKPOINT_S", 60.0)  # less to wait for
    return kept


def test_a_charge_has_a_begin_and_an_end_with_all_of_it(kept: Kept) -> None:
    kept.bench.charging()
    decision = kept.bench.bay.decision
    assert decision is not None
    assert decision.session is not None
    session = decision.session
    kept.bench.battery.values["soc_pct"] = 100.0
    kept.bench.until(State.FULL)
    begin, end = kept.records()
    assert (begin["type"], begin["n"], end["type"], end["n"]) == ("begin", 0, "end", 1)
    assert begin["id"] == end["id"]
    assert end["bay"] == "bay-1"
    assert end["battery"] == {"id": "can0:0x10", "source": "assumed", "can": "can0", "node": "0x10"}
    assert end["policy"]["name"] == "li-ion-48v"
    assert len(end["policy"]["sha256"]) == 64
    assert end["by"] is None
    assert end["result"]["id"] == "full"
    assert end["result"]["key"] == "finish.full.soc_pct"
    assert end["values"]["soc_pct"] == {"begin": 50.0, "end": 100.0, "lowest": 50.0, "highest": 100.0}
    assert end["begin"]["unix_s"] == pytest.approx(WALL_S + session.started_s)
    assert end["begin"]["utc"].endswith("Z")
    assert end["pauses"] == []
    assert end["charger"]["ah"] > 0.001
    assert sum(rule["ah"] for rule in end["rules"]) == pytest.approx(end["charger"]["ah"], abs=1e-5)
    assert sum(rule["s"] for rule in end["rules"]) == pytest.approx(end["energised_s"], abs=0.01)
    assert end["bmu"]["ah"] == pytest.approx(end["charger"]["ah"], rel=0.2)
    assert 0 < end["stop_verified_ms"] < 3000
    assert end["contactor_closed"] is None


def test_who_asked_for_a_charge_and_which_battery_it_was_stand_with_it(kept: Kept) -> None:
    kept.bench.charging()
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    kept.bench.bay.ask(Asked(Request.START, Asker(behind="kim", uid=0, because="night shift", unix_s=WALL_S)))
    kept.bench.charging()
    kept.bench.bay.identified.name("B-0042")
    kept.bench.step()
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    kept.bench.ask(Request.START)
    kept.bench.charging()
    _, first, second, second_end, third = kept.records()
    assert first["by"] is None
    assert second["by"] == second_end["by"]
    assert (second["by"]["id"], second["by"]["params"]["because"]) == ("started_by", "night shift")
    assert (second["battery"]["source"], second_end["battery"]["source"]) == ("assumed", "typed")
    assert second_end["battery"]["id"] == third["battery"]["id"] == "B-0042"
    assert third["by"] is None


def test_a_target_stands_with_the_charge_that_it_is_for(kept: Kept) -> None:
    kept.bench.charging()
    kept.bench.bay.ask(Asked(Request.START, Asker(behind="kim", uid=0, unix_s=WALL_S), target_pct=80.0))
    kept.bench.step()
    kept.bench.battery.values["soc_pct"] = 80.0
    kept.bench.until(State.FULL)
    _, end = kept.records()
    assert (end["by"]["id"], end["by"]["params"]["target_pct"]) == ("started_to_by", 80.0)
    assert end["result"]["params"]["what"]["id"] == "once_reached"


def test_a_pause_is_part_of_the_charge_with_its_reason(kept: Kept) -> None:
    kept.bench.charging()
    kept.bench.ask(Request.PAUSE)
    kept.bench.until(State.SUSPENDED)
    kept.bench.step(100)
    kept.bench.ask(Request.START)
    kept.bench.charging()
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    records = kept.records()
    assert [one["type"] for one in records] == ["begin", "checkpoint", "checkpoint", "end"]
    assert [one["n"] for one in records] == [0, 1, 2, 3]
    (pause,) = records[-1]["pauses"]
    assert pause["cause"]["id"] == "operator_pause"
    assert pause["lasted_s"] > 20
    assert records[-1]["paused_s"] == pause["lasted_s"]
    assert records[-1]["result"]["id"] == "operator_stop"


def test_what_was_foreseen_and_what_came_of_it_stands_with_it(kept: Kept) -> None:
    kept.bench.charging()
    kept.bench.step(int(70 / 0.2))
    kept.recorder.turn()
    kept.again(kept.persisted(), 60.0)  # it is not forgotten, and not made once more
    kept.bench.until(State.HELD)
    kept.bench.ask(Request.START)
    kept.bench.charging()
    kept.bench.battery.values["soc_pct"] = 100.0
    kept.bench.until(State.FULL)
    *earlier, end = kept.records()
    assert earlier[-1]["forecast"]["elapsed_s"] == end["forecast"]["elapsed_s"] == pytest.approx(40.0, abs=10.0)
    assert (end["forecast"]["target_pct"], end["forecast"]["bmu_min"]) == (100, None)
    assert end["forecast"]["own_min"] > 10
    assert end["forecast"]["took_min"] == pytest.approx((end["lasted_s"] - end["forecast"]["elapsed_s"]) / 60, abs=0.1)
    assert "took_min" not in earlier[-1]["forecast"]
    assert [one["step"] for one in end["steps"]] == [5]
    assert sum(one["ah"] for one in end["steps"]) == pytest.approx(end["charger"]["ah"], abs=1e-5)
    assert sum(one["s"] for one in end["steps"]) == pytest.approx(end["energised_s"], abs=0.01)


def test_the_bmus_forecast_alone_waits_for_ours() -> None:
    forecasts = [Forecast()]
    for elapsed_s in (0.0, 5.0, 110.0, 121.0):
        look = Look(Stamp(WALL_S, 0, 1000.0 + elapsed_s, "b"), Snapshot(), RUNNING, lambda cause: cause, _by_the_bmu)
        forecasts.append(follow(forecasts[-1], look, elapsed_s))
    assert [one.made is not None for one in forecasts] == [False, False, False, False, True]
    assert follow(Forecast(), look, 601.0).made is None, "that is no begin any more"


def test_another_policy_in_mid_charge_is_noted(kept: Kept) -> None:
    kept.bench.charging()
    kept.bench.ask(Request.PAUSE)
    kept.bench.until(State.SUSPENDED)
    mine = the_bay()
    other = replace(mine.policy, policy="other", source=replace(mine.policy.source, digest="f" * 64))
    kept.bench.bay.policy.offer(replace(mine, policy=other))
    kept.bench.step(3)
    assert [one["sha256"] for one in kept.records()[-1]["changes"]] == ["f" * 64], "at once"
    kept.again(kept.persisted(), 60.0)  # the next run has the first policy again
    kept.bench.step(10)
    kept.bench.ask(Request.STOP)
    kept.bench.step(10)
    end = kept.records()[-1]
    assert end["policy"]["sha256"] == mine.policy.source.digest
    assert [(one["policy"], one["sha256"]) for one in end["changes"]] == [
        ("other", "f" * 64),
        (mine.policy.policy, mine.policy.source.digest),
    ]
    assert all(one["utc"].endswith("Z") and one["software"] == __version__ for one in end["changes"])


def test_a_running_charge_is_recorded_again_and_again(kept: Kept) -> None:
    kept.bench.charging()
    kept.bench.step(int(130 / 0.2))
    assert [one["type"] for one in kept.records()] == ["begin", "checkpoint", "checkpoint"]


def test_a_death_of_the_service_is_a_pause_of_the_same_charge(kept: Kept) -> None:
    kept.bench.charging()
    kept.bench.step(400)  # beyond a checkpoint
    died_s = kept.wall()
    persisted = kept.persisted()
    assert persisted.session is not None
    before_ah = persisted.session.charged_ah
    kept.recorder.turn()
    kept.again(persisted, 60.0)
    kept.bench.until(State.HELD)
    kept.recorder.turn()
    (listed,) = Charges(kept.directory / "sessions").listed()
    why = why_ended(listed, "en")
    assert why.startswith("not ended; paused since 2026-11-28 ")
    assert ": the service died; last sign of life: 2026-11-28 " in why
    assert why == why_ended(next(Charges(kept.directory / "sessions").whole([listed["id"]])), "en")
    kept.bench.ask(Request.START)
    kept.bench.charging()
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    records = kept.records()
    assert len({one["id"] for one in records}) == 1
    assert [one["type"] for one in records].count("begin") == 1
    assert [one["n"] for one in records] == list(range(len(records)))
    end = records[-1]
    (pause,) = end["pauses"]
    assert pause["cause"]["id"] == "service_died"
    assert pause["lasted_s"] > 60
    assert pause["unix_s"] == pytest.approx(died_s, abs=1.0), "by the core's counters, not at the last record"
    assert end["charger"]["ah"] > before_ah
    assert end["charger"]["ah"] == pytest.approx(end["counted"][0], abs=1e-5)


def test_a_charge_that_nothing_goes_on_with_says_that_the_service_died(kept: Kept) -> None:
    kept.bench.charging()
    kept.recorder.turn()
    kept.again(Persisted())  # the state was lost
    kept.bench.step(5)
    begin, end = kept.records()
    assert (begin["id"], begin["n"], end["type"], end["n"]) == (end["id"], 0, "end", 1)
    assert end["result"]["id"] == "service_died"
    assert end["result"]["params"]["last_at"].startswith("2026-11-28 ")


def test_another_charge_than_the_one_left_open_is_another_one(kept: Kept) -> None:
    kept.bench.charging()
    kept.recorder.turn()
    kept.bench.battery.values["soc_pct"] = 100.0
    kept.bench.until(State.FULL)
    kept.bench.battery.values["soc_pct"] = 50.0
    kept.bench.charging()  # neither that end nor this begin reaches the disk
    kept.again(kept.persisted())
    kept.bench.step(5)
    records = kept.records()
    assert [one["type"] for one in records] == ["begin", "end", "begin", "checkpoint"]
    assert records[1]["result"]["id"] == "service_died"
    assert records[2]["id"] > records[0]["id"]


def test_an_end_that_the_core_has_forgotten_is_not_recorded_again(kept: Kept) -> None:
    kept.bench.charging()
    kept.recorder.turn()
    persisted = kept.persisted()
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    recorded = kept.records()
    assert recorded[-1]["type"] == "end"
    kept.again(persisted)
    kept.bench.until(State.HELD)
    assert kept.records() == recorded
    kept.bench.ask(Request.START)
    kept.bench.charging()
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    one, other = (one for one in kept.records() if one["type"] == "end")
    assert one["id"] < other["id"]
    assert other["charger"]["ah"] < 0.03  # what has come since, not what the core remembers of the other


@pytest.mark.parametrize("off_s", [-400 * 86400.0, -WALL_S, 70 * 365 * 86400.0])
def test_steps_of_the_clock_change_neither_ids_nor_lengths(kept: Kept, off_s: float) -> None:
    kept.bench.charging()
    kept.recorder.turn()
    kept.off_s = off_s
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    kept.bench.ask(Request.START)
    kept.bench.charging()
    kept.recorder.turn()
    kept.off_s = 0.0
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    kept.recorder.turn()
    records = sorted(kept.records(), key=lambda one: (one["id"], one["n"]))
    assert [one["type"] for one in records] == ["begin", "end", "begin", "end"]
    assert all(0 < one["lasted_s"] < 60 for one in records if one["type"] == "end")


def test_a_torn_line_spoils_only_itself(kept: Kept) -> None:
    kept.bench.charging()
    kept.recorder.turn()
    (file,) = (kept.directory / "sessions").iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole + b'{"type":"checkpoint","id":"0')
    kept.again(kept.persisted())
    kept.bench.step(5)
    kept.recorder.turn()
    begin, torn, checkpoint, *_ = file.read_bytes().splitlines()
    assert begin + b"\n" == whole
    assert torn == b'{"type":"checkpoint","id":"0'
    assert b'"type":"checkpoint"' in checkpoint


def test_a_disk_that_is_full_keeps_no_record_waiting_for_ever(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("orchestrator.service.recorder.append", full)
        kept.bench.charging()
        kept.recorder.turn()
        kept.bench.ask(Request.STOP)
        kept.bench.until(State.HELD)
        kept.recorder.turn()
    assert [cause.id for cause in kept.said] == ["record_failed"]
    assert [one["type"] for one in kept.records()] == ["begin", "end"]
    assert [cause.id for cause in kept.said] == ["record_failed", "record_again"]


def test_a_defect_in_the_record_costs_no_charge(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("orchestrator.record.charge.begun", broken)
    kept.bench.charging()
    assert {cause.id for cause in kept.said} == {"record_internal"}


def test_the_thread_writes_and_ends(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, 5.0, time.time)
    recorder.start()
    recorder.put({"type": "begin", "id": "0" * 26, "n": 0})
    recorder.close()
    assert recorder.stalled(0.0)
    (file,) = (tmp_path / "sessions").iterdir()
    assert file.read_bytes().endswith(b'"n":0}\n')


def test_a_finished_month_is_compressed_and_still_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Kept(tmp_path)
    monkeypatch.setattr("orchestrator.service.bay.time", kept.wall)
    for _ in range(4):
        kept.bench.charging()
        kept.recorder.turn()
        kept.off_s += 31 * 86400.0
        kept.bench.ask(Request.STOP)
        kept.bench.until(State.HELD)
        kept.bench.ask(Request.START)
        kept.recorder.turn()
    names = sorted(path.name for path in (tmp_path / "sessions").glob("*.jsonl*"))
    packed, plain = ["2026-11", "2026-12", "2027-01"], ["2027-03", "2027-04"]
    assert names == [*(f"{month}.jsonl.gz" for month in packed), *(f"{month}.jsonl" for month in plain)]
    found = list(Charges(tmp_path / "sessions").listed())
    assert [one["type"] for one in found] == ["end"] * 4


@pytest.mark.parametrize("data", [b"no gzip", gzip.compress(bytes(1000))[:-9]], ids=["no gzip", "torn"])
def test_a_damaged_month_keeps_no_charge_from_the_record(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "sessions").mkdir()
    (tmp_path / "sessions" / "2026-11.jsonl.gz").write_bytes(data)
    said = list[Cause]()
    recorder = Recorder(tmp_path, 5.0, lambda: WALL_S, said.append)
    recorder.turn()
    assert recorder.loaded
    assert said == []
