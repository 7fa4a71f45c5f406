"""`watch`: the whole status once, then what changes, to readers of any speed."""

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from time import time
from typing import Any

import pytest

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Alarm, Cause, Decision, State
from orchestrator.service.client import Client
from orchestrator.service.published import MOST, PERIOD_S, RATE, Published
from orchestrator.service.streams import KEEP_ALIVE_S, MOST_READERS, PATIENCE_S, TURN_S, Streams
from orchestrator.text.catalogue import say
from tests.service.bench import Bench
from tests.service.control_bench import answer, client, listening
from tests.service.hall import TRIPPED, Hall


class Site(Hall):
    """Some bays and their readers. The test is the thread, and time passes when it says so."""

    def __init__(self, bays: int = 3) -> None:
        super().__init__(bays)
        self.station: dict[str, object] = {"station": "a hall", "alarm": "none"}
        self.now_s = 1000.0
        self.published = Published(self.bays, lambda: {"time": self.now_s, **self.station}, lambda: self.now_s)
        self.streams = Streams(self.published, lambda: self.now_s, lambda _: None)

    def turn(self, count: int = 1, seconds: float = TURN_S) -> None:
        for _ in range(count):
            self.now_s += seconds
            self.streams.turn(self.now_s)


class Reader:
    """One end of a connection, which reads when the test says so."""

    def __init__(self, site: Site, **more: object) -> None:
        self.ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        self.ours.setblocking(False)
        self.client = Client(theirs, site.now_s)
        self.client.request = {"verb": "watch", **more}
        self.refusal = site.streams.take(self.client)
        self._heard = b""

    def lines(self) -> list[dict[str, Any]]:
        """What has come by now, whole lines."""
        try:
            while part := self.ours.recv(1 << 20):
                self._heard += part
        except BlockingIOError:
            pass
        *lines, self._heard = self._heard.split(b"\n")
        return list(map(json.loads, lines))

    @property
    def is_connected(self) -> bool:
        self.lines()
        try:
            return self.ours.recv(1) != b""
        except BlockingIOError:
            return True


@contextmanager
def reading(site: Site, count: int = 1) -> Iterator[list[Reader]]:
    readers = [Reader(site) for _ in range(count)]
    try:
        yield readers
    finally:
        for one in readers:
            one.ours.close()
            one.client.close()


@pytest.fixture(name="site")
def _site() -> Site:
    return Site()


def test_first_comes_the_whole_document_and_then_only_what_changes(site: Site) -> None:
    with reading(site) as (reader,):
        site.turn()
        (first,) = reader.lines()
        assert (first["ok"], first["instance"]) == (True, site.published.instance)
        document = first["document"]
        assert [bay["name"] for bay in document["bays"]] == ["bay-1", "bay-2", "bay-3"]
        assert document["station"] == "a hall"
        site.bays[1].decision = TRIPPED
        site.station["alarm"] = "attention"
        site.turn()
        (line,) = reader.lines()
        assert line["revision"] > first["revision"]
        assert {name: bay["state"] for name, bay in line["bays"].items()} == {"bay-2": "TRIPPED"}
        assert line["station"] == {"alarm": "attention"}


def test_figures_are_told_within_a_second_and_no_sooner(site: Site) -> None:
    with reading(site) as (reader,):
        site.turn()
        reader.lines()
        told_s: list[float] = []
        for _ in range(int(10 / TURN_S)):
            site.bays[0].volts += 0.01
            site.turn()
            told_s += [site.now_s for line in reader.lines() if "bays" in line]
        gaps_s = [after - before for before, after in pairwise(told_s)]
        assert len(told_s) in (9, 10, 11)
        assert all(PERIOD_S - 2 * TURN_S <= gap_s <= PERIOD_S + 2 * TURN_S for gap_s in gaps_s)


def test_the_watts_of_supplies_are_told_once_a_second_however_many_bays_change(site: Site) -> None:
    site.station["supplies"] = [{"name": "hall", "promised_w": 0}]
    with reading(site) as (reader,):
        site.turn()
        reader.lines()
        told_s: list[float] = []
        for watts in range(int(5 / TURN_S)):
            site.station["supplies"] = [{"name": "hall", "promised_w": watts}]
            site.change()
            site.turn()
            (line,) = reader.lines()
            told_s += [site.now_s] if "supplies" in line.get("station", {}) else []
        assert len(told_s) in (4, 5)
        site.turn(seconds=PERIOD_S)
        assert reader.lines()[0]["station"]["supplies"][0]["promised_w"] == watts
        site.turn(int(3 / TURN_S))
        assert reader.lines() == []


def test_what_only_grows_older_is_no_change(site: Site) -> None:
    with reading(site) as (reader,):
        site.turn()
        (first,) = reader.lines()
        for _ in range(20):
            site.bays[0].age_s += 0.1
            site.turn()
        assert site.bays[0].described >= 2
        assert reader.lines() == []
        site.turn(seconds=KEEP_ALIVE_S)
        assert reader.lines() == [{"revision": first["revision"], "time": pytest.approx(site.now_s)}]


def test_how_old_a_value_is_that_is_too_old_is_told_by_the_second_and_then_by_the_minute(site: Site) -> None:
    with reading(site) as (reader,):
        site.bays[0].old = True
        told = []
        for _ in range(3):
            for _ in range(int(5 / TURN_S)):
                site.bays[0].age_s += TURN_S
                site.turn()
                told += [line for line in reader.lines() if "bays" in line]
            site.bays[0].age_s += 60
        assert len(told) in range(4 + 2 + 0, 5 + 3 + 3)


def test_a_reader_is_told_something_every_five_seconds(site: Site) -> None:
    with reading(site) as (reader,):
        told_s = []
        for _ in range(int(30 / TURN_S)):
            site.turn()
            told_s += [site.now_s] * len(reader.lines())
        assert all(after - before < 5 for before, after in pairwise(told_s))
        assert len(told_s) < 10


def test_one_who_reads_slowly_misses_states_between_and_never_the_newest(site: Site) -> None:
    with reading(site) as (slow,):
        site.turn()
        slow.lines()
        for state in (*list(State) * 3, State.TRIPPED):
            site.bays[0].decision = Decision(state, Cause(state.lower()))
            site.turn(2)
        first, *others = slow.lines()  # the one line that was on its way
        assert (first["bays"]["bay-1"]["state"], others) == ("STARTING", [])
        site.turn()
        (newest,) = slow.lines()
        assert newest["bays"]["bay-1"]["state"] == "TRIPPED"
        assert newest["revision"] == site.published.revision


def test_each_reader_is_told_what_is_new_for_it(site: Site) -> None:
    with reading(site, 2) as (quick, slow):
        site.turn()
        quick.lines()
        for bay in site.bays[:2]:
            bay.decision = TRIPPED
            site.turn()
            assert [list(line["bays"]) for line in quick.lines()] == [[bay.name]]
        slow.lines()
        site.turn()
        (line,) = slow.lines()
        assert list(line["bays"]) == ["bay-1", "bay-2"]
        assert line["revision"] == site.published.revision
        site.turn(seconds=KEEP_ALIVE_S)
        assert [one.lines()[0]["time"] for one in (quick, slow)] == [pytest.approx(site.now_s)] * 2


def test_a_document_longer_than_any_buffer_arrives_whole(site: Site) -> None:
    for bay in site.bays:
        bay.more = {"reason": "전" * 100_000}
    with reading(site) as (reader,):
        found: list[dict[str, Any]] = []
        for _ in range(100):
            site.turn(seconds=0.005)
            found += reader.lines()
        assert [len(bay["reason"]) for bay in found[0]["document"]["bays"]] == [100_000] * 3


def test_one_who_reads_nothing_for_half_a_minute_is_sent_away(site: Site) -> None:
    with reading(site, 2) as (deaf, other):
        for _ in range(int(PATIENCE_S - 1)):
            site.bays[0].volts += 1
            site.turn(seconds=1.0)
            other.lines()
        assert len(site.streams._readers) == 2
        site.turn(3, 1.0)
        assert [reader.client for reader in site.streams._readers] == [other.client]
        assert not deaf.is_connected


def test_many_readers_are_no_more_work_than_one(site: Site) -> None:
    with reading(site, MOST_READERS) as readers:
        for _ in range(int(3 / TURN_S)):
            site.bays[0].volts += 1
            site.turn()
        assert all(reader.lines()[0]["document"] for reader in readers)
        assert max(bay.described for bay in site.bays) <= 4


def test_the_seventeenth_is_refused_until_one_leaves(site: Site) -> None:
    with reading(site, MOST_READERS) as readers:
        refusal = Reader(site).refusal
        assert say(refusal) == "16 readers are watching already: end one, or ask for the status"
        site.turn()
        assert Reader(site).refusal == refusal
        readers[0].ours.close()
        site.turn()
        late = Reader(site)
        assert late.refusal is None
        site.turn()
        assert late.lines()[0]["document"]


def test_another_version_is_refused(site: Site) -> None:
    assert say(Reader(site, version=2).refusal) == "this service has version 1 of watch, not 2"
    assert Reader(site, version=1).refusal is None


def test_while_nobody_reads_no_bay_is_looked_at(site: Site) -> None:
    site.turn(20)
    with reading(site) as (reader,):
        site.turn()
        assert reader.lines()
    site.turn()
    described = [bay.described for bay in site.bays]
    assert site.streams.turn(site.now_s + 10) is None
    assert [bay.described for bay in site.bays] == described == [1, 1, 1]


def test_a_long_look_is_done_in_parts_and_the_next_ones_are_short() -> None:
    site = Site(bays=128)
    with reading(site) as (reader,):
        lines: list[dict[str, Any]] = []
        for _ in range(128 // MOST + 1):
            assert not lines  # nobody is told half of a document
            site.turn(seconds=0.01)
            lines = reader.lines()
        assert len(lines[0]["document"]["bays"]) == 128
        site.turn(int(3 / TURN_S))
        looks = []
        for _ in range(int(3 / TURN_S)):
            before = sum(bay.described for bay in site.bays)
            site.turn()
            looks.append(sum(bay.described for bay in site.bays) - before)
        assert max(looks) <= 2 * RATE * TURN_S
        assert sum(looks) == pytest.approx(3 * RATE, rel=0.1)


def test_a_defect_sends_the_readers_away_and_the_next_one_is_served(tmp_path: Path) -> None:
    said: list[Cause] = []
    site = Site()
    streams = Streams(site.published, lambda: site.now_s, said.append)
    streams.start()
    with listening(tmp_path / "socket", answer, streams.take) as control, client(tmp_path / "socket") as first:
        site.bays[0].more = {"reason": object()}
        first.sendall(b'{"verb": "watch"}\n')
        assert first.recv(1) == b""
        assert "not JSON serializable" in say(said[0])
        site.bays[0].more = {}
        with client(tmp_path / "socket") as second:
            second.sendall(b'{"verb": "watch", "version": 1}\n')
            with second.makefile("rb") as stream:
                assert json.loads(stream.readline())["document"]["station"] == "a hall"
            assert not control._clients  # it is none of those who wait for an answer
        with pytest.raises(ServiceError, match="version 1 of watch"):
            ask(tmp_path / "socket", {"verb": "watch", "version": "x"})
        streams.close()


def test_a_real_bay_is_told_as_in_the_status(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    published = Published([bench.bay], lambda: {"alarm": "none"}, time)
    published.look(0.0)
    bench.charging()
    published.look(0.01)
    (bay,) = json.loads(published.document())["document"]["bays"]
    assert bay.keys() == bench.bay.status().keys()
    assert (bay["state"], bay["alarm"]) == ("CHARGING", Alarm.NONE.name.lower())
