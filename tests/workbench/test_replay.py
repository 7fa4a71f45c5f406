"""A journal, read and replayed: the same decisions from the same rules, and the differences with other rules."""

import gzip
import json
import os
import re
import shutil
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from orchestrator.cli import main
from orchestrator.config.load import load_policy
from orchestrator.core import next_transition
from orchestrator.model import Cause, Decision, Request, State
from orchestrator.service.records import MAX_ROWS, WHOLE_S
from orchestrator.workbench.replay.again import again
from orchestrator.workbench.replay.otherwise import Difference, compare, told
from orchestrator.workbench.replay.recording import Recorded, Recording, read
from tests.core.said import reason_of
from tests.service.bench import STEP_S, Bench


@pytest.fixture(name="journal", scope="module")
def _journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A charge to full, with a cold hour, a pause and a quiet night after it."""
    bench = Bench(tmp_path_factory.mktemp("journal"), max_mb=100.0)

    def pass_s(seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            bench.step()

    pass_s(20)
    for temperature_c in (17.0, 14.0, 11.0, 9.0):
        bench.battery.values["temperature_c"] = temperature_c
        pass_s(2)
    pass_s(WHOLE_S)
    bench.ask(Request.PAUSE)
    pass_s(5)
    bench.ask(Request.START)
    pass_s(10)
    bench.battery.values["soc_pct"] = 91.0
    pass_s(20)
    bench.battery.values["soc_pct"] = 100.0
    pass_s(20)
    bench.ask(Request.STOP)
    bench.journal._write()
    return unpacked(bench.journal._directory)


def unpacked(journal: Path) -> Path:
    """With plain files only, so that tests can change lines."""
    for path in journal.glob("*.gz"):
        path.with_suffix("").write_bytes(gzip.decompress(path.read_bytes()))
        path.unlink()
    return journal


def differences(journal: Path, policy: str | Path) -> list[Difference]:
    return compare(again(read([journal]).bays["bay-1"]), load_policy(policy))


def changed_policy(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    text = Path(__file__).parents[2].joinpath("policies", "li-ion-48v.yaml").read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = tmp_path / "changed.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def decided_lines(journal: Path) -> list[dict[str, Any]]:
    """All but those with which a run begins, and those of which battery it is: they decide nothing."""
    lines = [json.loads(line) for line in (journal / "events.jsonl").read_text(encoding="utf-8").splitlines()]
    return [one for one in lines if one["kind"] not in ("run", "battery")]


def test_the_same_rules_decide_the_same_bit_for_bit(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    taken = list(again(read([journal]).bays["bay-1"]))
    assert [one.wrong for one in taken if one.wrong] == []
    states = {one.decision.state for one in taken}
    assert {State.QUALIFYING, State.CHARGING, State.STOPPING, State.SUSPENDED, State.FULL} <= states
    assert sum(one.recorded.memory is not None for one in taken) > 3, "the record begins anew after the quiet"
    events = [event for one in taken for event in one.recorded.events]
    assert len(events) == len(decided_lines(journal)), "every line of the journal was compared"
    assert main(["replay", str(journal)]) == 0
    assert capsys.readouterr().out.endswith("taken again: all as recorded\n")


def test_a_core_that_decides_otherwise_is_seen(
    journal: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(next_transition, "QUALIFY_S", 2.5)
    assert main(["replay", str(journal)]) == 1
    assert "the journal says ['transition', {'from': 'QUALIFYING'" in capsys.readouterr().out


def test_a_value_that_was_altered_is_seen_in_the_memory(journal: Path, tmp_path: Path) -> None:
    """Where the sentences do not show it, the resulting memory does."""
    copy = tmp_path / "copy"
    shutil.copytree(journal, copy)
    (path,) = copy.glob("snapshots*.jsonl")
    text, count = re.subn(
        r'("charger.current_a":\[(?:0,)*)14000', r"\g<1>13900", path.read_text(encoding="utf-8"), count=1
    )
    assert count == 1
    path.write_text(text, encoding="utf-8")
    wrong = [one.wrong for one in again(read([copy]).bays["bay-1"]) if one.wrong]
    assert any(text.startswith("memory.session was Session(") for text in wrong)


def test_a_gentler_policy_is_told_with_both_lines(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = differences(journal, "long-life-48v")[0]
    assert not first.parted
    assert first.ah < 0
    assert main(["replay", str(journal), "--policy", "long-life-48v"]) == 0
    out = capsys.readouterr().out
    assert "was  CHARGING: step 5 (14.0 A): the highest step" in out
    assert "policies/long-life-48v.yaml:" in out
    assert "Ah less, by a lower step" in out


def test_a_policy_that_ends_earlier_parts_from_the_record(journal: Path, tmp_path: Path) -> None:
    earlier = changed_policy(tmp_path, ("target_soc_pct: 100 ", "target_soc_pct: 90 "),
                             ("soc_below_pct: 98", "soc_below_pct: 90"),
                             ("soc_below_pct: 95", "soc_below_pct: 80"))  # fmt: skip
    found = [one for one in differences(journal, earlier) if one.was.state is State.CHARGING and one.parted]
    (one,) = found
    assert one.now.state is State.STOPPING
    assert "SOC 91 % reached 90 %" in reason_of(one.now)
    assert one.ended_s - one.began_s > 10
    assert "would not have been charged" in list(told(one))[-1]


def test_a_policy_that_stops_for_cold_earlier_is_compared_anew_from_the_next_rest(
    journal: Path, tmp_path: Path
) -> None:
    colder = changed_policy(tmp_path, ("temperature_c: [0, 45]", "temperature_c: [10, 45]"),
                            ("- {from: 0, to: 10, max_c: 0.05} ", "- {from: 9, to: 10, max_c: 0.05} "))  # fmt: skip
    found = differences(journal, colder)
    assert (found[0].was.state, found[0].now.state) == (State.CHARGING, State.STOPPING)
    assert "the limit is 10 °C" in reason_of(found[0].now)
    assert (found[1].was.state, found[1].now.state) == (State.QUALIFYING, State.SUSPENDED)


def test_the_same_policy_differs_in_nothing(journal: Path) -> None:
    same = load_policy("li-ion-48v", changes={"finish.full.soc_pct": "100"})
    assert compare(again(read([journal]).bays["bay-1"]), same) == []


def gzipped(journal: Path, to: Path) -> None:
    for path in journal.glob("*.jsonl"):
        (to / f"{path.name}.gz").write_bytes(gzip.compress(path.read_bytes()))


def test_files_may_be_named_and_gzipped(journal: Path, tmp_path: Path) -> None:
    gzipped(journal, tmp_path)
    assert main(["replay", *map(str, tmp_path.glob("*.gz"))]) == 0


BROKEN: dict[str, tuple[Callable[[str], str], str]] = {
    "no JSON": (lambda text: "{oh no\n" + text, ":1:1: error: this is no line of a journal: it is not JSON"),
    "no line of ours": (lambda text: '{"a": 1}\n' + text, "it has t, wall, bay and kind"),
    "no time": (lambda text: '{"kind":"fault","bay":"bay-1","wall":"","t":"x"}\n' + text, "could not convert string"),
    "a text for a number": (lambda text: text.replace('{"t":', '{"t":"x","y":', 1), "could not convert string"),
    "a row too many": (lambda text: text.replace('"at":[', '"moves":[300,""],"at":[', 1), "IndexError"),
    "half a change": (lambda text: text.replace('"at":[', '"moves":[3],"at":[', 1), "ValueError"),
    "an unknown state": (lambda text: text.replace('"state":"STARTING"', '"state":"FLYING"', 1), "FLYING"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_line_that_is_none_of_ours_is_named_and_passed_over(name: str, journal: Path, tmp_path: Path) -> None:
    spoil, said = BROKEN[name]
    first = max(journal.glob("snapshots*.jsonl"), key=lambda path: path.name)
    path = tmp_path / "snapshots.jsonl"
    path.write_text(spoil(first.read_text(encoding="utf-8")), encoding="utf-8")
    record = read([path])
    (broken,) = record.broken
    assert str(broken).startswith(f"{path}:")
    assert said in str(broken)
    assert record.bays["bay-1"], "what follows is there"


def test_a_line_that_a_power_failure_cut_off_is_passed_over(journal: Path, tmp_path: Path) -> None:
    path = tmp_path / "snapshots.jsonl"
    text = (journal / "snapshots.jsonl").read_text(encoding="utf-8")
    path.write_text(text[:-20], encoding="utf-8")
    record = read([path])
    last = json.loads(text.splitlines()[-1])
    before = read([journal]).bays["bay-1"]
    assert len(record.bays["bay-1"]) == len(before) - 1 - len(last.get("at", []))
    assert len(record.broken) == 1


# --- over restarts, power cuts and reboots ----------------------------------------------------------------------------


def one_run(directory: Path, began_s: float, wall_s: float, *, trip: bool = False) -> None:
    """The service runs for a while from this monotonic time and ends; or it trips and stays."""
    bench = Bench(directory, max_mb=100.0, now_s=began_s, wall=lambda: wall_s + bench.now_s - began_s)
    bench.charging()
    if trip:
        bench.battery.values["temperature_c"] = 80.0
    else:
        bench.bay.end(Cause.of("signal", name="SIGTERM"))
    bench.step(20)
    bench.journal._write()
    bench.store._ownership.give_up()


def replayed(directory: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """The output of `replay` on it; decisions must be as recorded."""
    code = main(["replay", str(directory)])
    out = capsys.readouterr().out
    assert code == 0, out
    assert "all as recorded" in out
    return out


def texts(directory: Path) -> set[str]:
    """The recorded faults in words, with their dates."""
    steps = read([directory]).bays["bay-1"]
    return {
        f"{step.wall[:10]} {fields['id']}" for step in steps for kind, fields in step.events if kind == "fault"
    }  # fmt: skip


DAY_S = 86_400.0
MONDAY_S = 1_795_996_800.0


def test_a_restart_is_as_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in range(3):
        one_run(tmp_path, 1000.0 + 100 * number, MONDAY_S + 100 * number)
    steps = read([tmp_path]).bays["bay-1"]
    begun = [step for step in steps if step.memory is not None and step.memory.last_s is None]
    assert len(begun) == 3
    assert "lines cannot be read" not in replayed(tmp_path, capsys)


@pytest.mark.parametrize("began_s", [1000.0, 1000.3, 20.0, 90_000.0])
def test_a_reboot_loses_nothing_of_either_boot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], began_s: float
) -> None:
    """The monotonic clock starts again and may repeat times."""
    one_run(tmp_path, 1000.0, MONDAY_S)
    one_run(tmp_path, began_s, MONDAY_S + DAY_S, trip=True)
    replayed(tmp_path, capsys)
    assert "2026-12-01 hot_trip" in texts(tmp_path)
    events = sum(len(step.events) for step in read([tmp_path]).bays["bay-1"])
    assert events == len(decided_lines(tmp_path))


ENDS = {
    "a torn line": lambda data: data[:-25],
    "nothing but zeros": lambda data: data + b"\0" * 500,
    "half a character": lambda data: data[:-1] + b"\xc2",
    "a torn line in the middle": lambda data: data[:-400] + b"\n" + data[-100:],
}  # fmt: skip


@pytest.mark.parametrize("stream", ["events", "snapshots"])
@pytest.mark.parametrize("name", ENDS)
def test_what_a_power_cut_tears_costs_itself_only(
    name: str, stream: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one_run(tmp_path, 1000.0, MONDAY_S)
    path = tmp_path / {"events": "events.jsonl", "snapshots": "snapshots.jsonl.gz"}[stream]
    path.write_bytes(ENDS[name](path.read_bytes()))
    one_run(tmp_path, 20.0, MONDAY_S + DAY_S, trip=True)
    out = replayed(tmp_path, capsys)
    torn = tmp_path / {"events": "events.jsonl", "snapshots": "snapshots-000001.jsonl.gz"}[stream]
    assert f" passed over, the first: {torn}:" in out
    second = [step for step in read([tmp_path]).bays["bay-1"] if step.wall.startswith("2026-12-01")]
    assert second[0].memory is not None
    assert second[0].memory.last_s is None, "the first line of the second run is there"
    assert sum(len(step.events) for step in second) > 5


def test_steps_that_no_disk_took_are_a_gap_and_no_other_decision(
    journal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(journal, tmp_path, dirs_exist_ok=True)
    path = tmp_path / "snapshots.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    whole = [number for number, line in enumerate(lines) if b'"whole":true' in line]
    lost = b'{"t":1001.0,"wall":"2026-11-30T00:00:01.000Z","bay":"","kind":"lost","lines":3}\n'
    missing = b"".join(lines[whole[1] - 9 : whole[1]])
    path.write_bytes(b"".join([*lines[: whole[1] - 9], lost, *lines[whole[1] - 6 :]]))
    steps, before = read([tmp_path]).bays["bay-1"], read([journal]).bays["bay-1"]
    assert [step.memory is not None for step in steps if step.gap] == [True], "it begins anew with the next whole line"
    assert len(steps) == len(before) - sum(len(json.loads(line)["at"]) + 1 for line in missing.splitlines())
    replayed(tmp_path, capsys)


def test_a_stretch_of_time_alone_begins_at_a_complete_snapshot(
    journal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = read([journal]).bays["bay-1"]
    second = [step for step in steps if step.memory is not None][1]
    later = next(step for step in steps if step.at_s > second.at_s + 5)
    assert main(["replay", str(journal), "--since", later.wall]) == 0
    said = re.search(r"bay-1: (\d+) decisions in .* all as recorded", capsys.readouterr().out)
    assert said is not None
    assert int(said[1]) == sum(step.wall >= later.wall for step in steps)
    begun = list(Recording([journal], since=later.wall))
    assert begun[0].memory is not None
    assert begun[0].wall <= later.wall, "what leads up to it is decided, too"
    assert main(["replay", str(journal), "--since", "2100-01-01"]) == 1
    assert "nothing is recorded of bay-1 since 2" in capsys.readouterr().err
    assert main(["replay", str(journal), "--since", "yesterday"]) == 2
    assert "--since yesterday: expected 90min, 2h, 7d, 2026-11-28" in capsys.readouterr().err


def test_parts_before_that_time_are_not_read(tmp_path: Path) -> None:
    one_run(tmp_path, 1000.0, MONDAY_S)
    shutil.move(tmp_path / "snapshots.jsonl.gz", tmp_path / "snapshots-000001.jsonl.gz")
    one_run(tmp_path, 20.0, MONDAY_S + DAY_S)
    with (tmp_path / "snapshots-000001.jsonl.gz").open("ab") as file:
        file.write(b"what nobody looks at")
    everything, later = Recording([tmp_path]), Recording([tmp_path], since="2026-12-01T00:20:00.000Z")
    assert {step.wall[:10] for step in everything} == {"2026-11-30", "2026-12-01"}
    assert list(later) == []
    assert (everything.broken_count, later.broken_count) == (1, 0)


@pytest.mark.parametrize("policy", [[], ["--policy", "long-life-48v"]])
def test_processes_share_the_bays_of_a_journal(
    policy: list[str], journal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in journal.glob("*.jsonl"):
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        both = (line + line.replace('"bay":"bay-1"', '"bay":"bay-2"', 1) for line in lines)
        (tmp_path / path.name).write_text("".join(both), encoding="utf-8")
    outs = []
    for jobs in ("1", "2"):
        assert main(["replay", str(tmp_path), "--jobs", jobs, *policy]) == 0
        outs.append(capsys.readouterr().out)
    assert outs[0] == outs[1]
    assert outs[0].count("bay-2: ") == 1


def test_however_long_a_journal_is_little_of_it_is_in_memory(journal: Path) -> None:
    recording, alive = Recording([journal]), list[weakref.ref[Recorded]]()
    most = 0
    for step in recording:
        alive.append(weakref.ref(step))
        most = max(most, sum(one() is not None for one in alive[-1000:]))
    assert len(alive) > 2000
    assert most <= MAX_ROWS + 1, "only those of one line"


def test_what_was_not_recorded_is_said(journal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(tmp_path)]) == 1
    assert "there is no journal here" in capsys.readouterr().err
    assert main(["replay", str(journal), "--bay", "bay-9"]) == 1
    assert "nothing is recorded of bay-9 (recorded: bay-1)" in capsys.readouterr().err
    assert main(["replay", str(tmp_path / "nowhere.jsonl")]) == 1
    assert "nowhere.jsonl:1:1: error: cannot be read: No such file or directory" in capsys.readouterr().err
    os.mkfifo(tmp_path / "pipe.jsonl")
    assert main(["replay", str(tmp_path / "pipe.jsonl")]) == 1
    assert (
        "pipe.jsonl:1:1: error: cannot be read: this is a pipe (FIFO); expected is a journal" in capsys.readouterr().err
    )


@pytest.mark.parametrize("version", [2, 3])
def test_steps_of_a_version_with_sentences_are_refused_in_one_sentence(
    journal: Path, tmp_path: Path, version: int
) -> None:
    (tmp_path / "journal").mkdir()
    for path in journal.glob("*.jsonl"):
        lines = path.read_text(encoding="utf-8").splitlines()
        old = [json.dumps(_with_sentences(json.loads(line), version)) for line in lines]
        (tmp_path / "journal" / path.name).write_text("\n".join(old) + "\n", encoding="utf-8")
    record = read([tmp_path / "journal"])
    assert record.bays == {}
    assert {finding.text for finding in record.broken} == {
        "an older version of this service has recorded this step: only that version can decide it again"
    }


def _with_sentences(line: dict[str, Any], version: int) -> dict[str, Any]:
    if line.get("whole"):
        line["charger_link"]["problem"] = ""
        if version == 2:
            del line["memory"]["cause"]
            line["memory"]["reason"] = "no battery"
    return line


def test_the_moments_in_a_difference_are_times_of_day() -> None:
    held = Cause.of("stopped_by", who="kim", asked_unix_s=1_795_905_808.0)
    decision = Decision(State.HELD, held)
    for wall, asked, raised in (
        ("2026-11-28T22:49:42.404Z", "22:43:28Z", "22:49:22Z"),
        ("2026-11-29T00:00:02.000Z", "2026-11-28T22:43Z", "2026-11-28T23:59Z"),
        ("never", "2026-11-28T22:43Z", "80 s"),
    ):
        _, was, *_ = told(Difference(wall, 100.0, 100.0, decision, decision))
        assert was == f"    was  HELD: stopped by kim at {asked}", wall
        hot = Cause.of("operator_stop", raised_t_s=80.0)
        _, was, *_ = told(Difference(wall, 100.0, 100.0, Decision(State.HELD, hot), decision))
        assert was == f"    was  HELD: at {raised}, stopped by the operator", wall
