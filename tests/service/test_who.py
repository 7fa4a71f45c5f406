"""Who asks, and why: taken from the kernel, shown in the reason, written down, and kept over a restart."""

import json
import os
import time
from collections.abc import Mapping
from pathlib import Path

import pytest

from orchestrator.core.memory import Operator
from orchestrator.core.persisted import Persisted
from orchestrator.lastresort.signing import MOST_BECAUSE, one_line, signed
from orchestrator.model import Cause, Request, State
from orchestrator.service.asked import Asked
from orchestrator.service.asker import NOBODY, Asker, held_by_others, user_name
from orchestrator.service.past import Entry, Place
from orchestrator.service.request_log import BURST, RequestLog
from orchestrator.service.stateformat import Stamp, decode, encode
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import say
from tests.service.bench import Bench, fields_of, the_bay

NOBODY_S_UID = next(uid for uid in range(54321, 60000) if user_name(uid) == f"uid {uid}")
#: 21:09 of some day, here.
AT_S = time.mktime((2026, 11, 28, 21, 9, 30, 0, 0, -1))


def asker(request: Mapping[str, object]) -> Asker:
    return Asker.of(request, AT_S)


def kim(because: str = "") -> Asker:
    return asker({"uid": 0, "sudo_user": "kim", "because": because})


def lee() -> Asker:
    return asker({"uid": 0, "sudo_user": "lee"})


def told(cause: Cause | None, wall_s: float = AT_S, language: str = "en") -> str:
    return say(WallClock(5.0, wall_s).told(cause), language)


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"uid": 0}, "stopped by root at 21:09"),
        ({"uid": NOBODY_S_UID}, f"stopped by uid {NOBODY_S_UID} at 21:09"),
        ({"uid": NOBODY_S_UID, "sudo_user": "kim"}, f"stopped by uid {NOBODY_S_UID} at 21:09"),
        ({"uid": 0, "sudo_user": "kim", "because": "wet floor"}, "stopped by root for kim at 21:09: wet floor"),
        ({"uid": 0, "sudo_user": "root"}, "stopped by root at 21:09"),
        ({"uid": 0, "sudo_user": 5, "because": ["x"]}, "stopped by root at 21:09"),
        ({"uid": 0, "sudo_user": "kim", "means": "estop"}, "stopped by estop (root for kim) at 21:09"),
        ({"uid": 0, "because": "{who} {0!r}"}, "stopped by root at 21:09: {who} {0!r}"),
        (
            {"uid": NOBODY_S_UID, "by": "page, lee, 10.0.0.7"},
            f"stopped by uid {NOBODY_S_UID} for page, lee, 10.0.0.7 at 21:09",
        ),
        ({"uid": 0, "sudo_user": "kim", "by": "page"}, "stopped by root for kim for page at 21:09"),
        ({"uid": 0, "by": {"door": "page"}}, "stopped by root at 21:09"),
        ({"by": "page, lee"}, ""),
        ({}, ""),
    ],
)
def test_the_kernel_says_who_and_root_says_for_whom(request_: Mapping[str, object], said: str) -> None:
    assert told(asker(request_).cause(Request.STOP)) == said


def test_in_korean_too() -> None:
    cause = kim("바닥이 젖음").cause(Request.STOP)
    assert told(cause, language="ko") == "kim(root 권한)이 21:09에 정지했습니다: 바닥이 젖음"
    assert told(asker({"uid": 0, "means": "estop"}).cause(Request.STOP), language="ko").endswith(
        "estop으로 정지했습니다"
    )


def test_of_another_day_it_has_the_date() -> None:
    assert told(kim().cause(Request.STOP), AT_S + 86400) == "stopped by root for kim at 2026-11-28 21:09"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("wet floor", "wet floor"),
        ("  two\nlines\t\x1b[31mred \u202e", "two lines [31mred"),
        ("\udc80", ""),
        ("x" * 1000, "x" * (MOST_BECAUSE - 1) + "…"),
        ("젖은 바닥", "젖은 바닥"),
    ],
)
def test_a_reason_is_one_printable_line_of_bounded_length(text: str, line: str) -> None:
    assert one_line(text) == line
    assert kim(text).because == line


def test_only_root_reports_for_whom(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SUDO_USER", "kim")
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert signed({"verb": "stop"}, "wet floor") == {"verb": "stop", "sudo_user": "kim", "because": "wet floor"}
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert signed({"verb": "stop"}) == {"verb": "stop"}


# --- in the bay -------------------------------------------------------------------------------------------------------


@pytest.fixture(name="bench")
def _bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def ask(bench: Bench, request: Request, by: Asker, *, spares: bool = False) -> str:
    asked = Asked(request, by, spares=spares)
    bench.bay.ask(asked)
    bench.step()
    assert asked.done.is_set()
    return say(asked.answer)


def test_a_stop_has_a_name_in_the_reason_the_session_and_the_file(bench: Bench, tmp_path: Path) -> None:
    bench.charging()
    assert ask(bench, Request.STOP, kim("wet floor")) == ""
    bench.until(State.HELD)
    reason = str(bench.bay.status()["reason"])
    assert reason.startswith("stopped by root for kim at ") and ": wet floor; to go on: " in reason
    (end,) = [
        fields_of(line) for _, _, _, line in bench.journal._waiting[False] if line[0] == "session"
        and fields_of(line)["event"] == "end"
    ]  # fmt: skip
    assert "stopped by root for kim" in str(end["result"])
    document = json.loads((tmp_path / "persisted.json").read_text())
    assert document["entries"][0]["hold"]["id"] == "stopped_by"
    again = Bench(tmp_path / "2", bench.store.past(Place.of(the_bay())))
    again.until(State.HELD)
    assert again.bay.status()["reason"] == reason


def test_a_file_from_before_there_were_names_is_read() -> None:
    stamp = Stamp(AT_S, 10.0, "boot")
    place = Place.of(the_bay())
    written = json.loads(encode(stamp, 1, [Entry(place, bench_state(), 1)]))
    del written["entries"][0]["paused_by"]
    written["entries"][0]["hold"] = {"id": "operator_stop", "params": [], "key": "", "place": "", "advice": ""}
    _, (entry,) = decode(json.dumps(written).encode(), stamp)
    assert say(entry.persisted.hold) == "stopped by the operator"
    assert entry.persisted.paused_by is None


def bench_state() -> Persisted:
    return Persisted(hold=kim().cause(Request.STOP), paused=True, paused_by=kim().cause(Request.PAUSE))


def test_a_start_of_all_spares_what_another_person_holds(bench: Bench) -> None:
    bench.charging()
    ask(bench, Request.STOP, kim("wet floor"))
    bench.until(State.HELD)
    refused = ask(bench, Request.START, lee(), spares=True)
    assert refused.startswith("left alone: stopped by root for kim at ")
    assert refused.endswith(": wet floor; if it may charge: orchestrator start bay-1, or --force")
    bench.step(5)
    assert bench.bay.status()["state"] == "HELD"
    assert ask(bench, Request.START, kim(), spares=True) == ""
    bench.charging()
    ask(bench, Request.PAUSE, kim())
    assert ask(bench, Request.START, lee(), spares=True).startswith("left alone: paused by root for kim at ")
    assert ask(bench, Request.START, lee()) == ""


def test_what_is_asked_between_is_decided_before(bench: Bench) -> None:
    """A stop that is not decided yet holds the bay as well."""
    bench.charging()
    stop, start = Asked(Request.STOP, kim()), Asked(Request.START, lee(), spares=True)
    bench.bay.ask(stop)
    bench.bay.ask(start)
    bench.step(2)
    assert say(start.answer).startswith("left alone: ")


@pytest.mark.parametrize(("by", "spared"), [(kim(), False), (lee(), True), (asker({"uid": 0}), True), (NOBODY, True)])
def test_who_holds_it_may_start_it(by: Asker, spared: bool) -> None:
    operator = Operator(hold=kim().cause(Request.STOP))
    assert (held_by_others(operator, by.person) is not None) is spared
    assert held_by_others(Operator(hold=Cause("operator_stop")), by.person) is None, "nobody knows whose"


def passing(by: str) -> Asker:
    return asker({"uid": NOBODY_S_UID, "by": by})


def test_a_program_that_passes_on_is_as_many_people(bench: Bench) -> None:
    bench.charging()
    assert ask(bench, Request.STOP, passing("page, kim")) == ""
    bench.until(State.HELD)
    for other in (passing("page, lee"), asker({"uid": NOBODY_S_UID}), lee()):
        assert ask(bench, Request.START, other, spares=True).startswith(
            f"left alone: stopped by uid {NOBODY_S_UID} for page, kim"
        )
    assert "page, kim" in str(bench.bay.status()["reason"])
    assert ask(bench, Request.START, passing("page, kim"), spares=True) == ""


def test_whose_wish_it_is_has_a_bound() -> None:
    assert len(passing("x" * 1000).by) == MOST_BECAUSE


# --- in the journal ---------------------------------------------------------------------------------------------------


def test_a_program_that_asks_without_end_fills_no_journal(bench: Bench) -> None:
    log = RequestLog(bench.journal, lambda: bench.now_s, "en")
    for _ in range(BURST + 500):
        log.write("bay-1", "start", kim(), Cause("overtaken"))
    bench.now_s += 1.0
    log.write("bay-1", "stop", kim("wet floor"), None)
    lines = [fields_of(line) for _, _, _, line in bench.journal._waiting[False] if line[0] == "request"]
    assert len(lines) == BURST + 1
    assert lines[-1] == {
        "request": "stop", "by": "root for kim", "uid": 0, "user": "root", "sudo_user": "kim", "because": "wet floor",
        "passed_on": "", "means": "", "accepted": True, "answer": "", "cause": None, "left_out": 500,
    }  # fmt: skip


def test_our_own_name_is_the_system_s() -> None:
    assert asker({"uid": os.getuid()}).person == user_name(os.getuid())


def test_the_record_has_the_user_and_whose_wish_it_was(bench: Bench) -> None:
    RequestLog(bench.journal, lambda: bench.now_s, "en").write("bay-1", "stop", passing("page, lee"), None)
    (line,) = [fields_of(line) for _, _, _, line in bench.journal._waiting[False] if line[0] == "request"]
    user = f"uid {NOBODY_S_UID}"
    assert (line["uid"], line["user"], line["by"]) == (NOBODY_S_UID, user, f"{user} for page, lee")
    assert line["passed_on"] == "page, lee"
