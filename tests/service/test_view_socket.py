"""Two sockets: operators ask on one, viewers look on the other; groups may use them, and the kernel says who."""

import grp
import json
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from orchestrator.config.load import load_station
from orchestrator.config.station import Control, Language, Station
from orchestrator.errors import ConfigError, ServiceError, StartError
from orchestrator.lastresort.asking import ask
from orchestrator.service import control as control_module
from orchestrator.service.client import Client
from orchestrator.service.control import ControlSocket
from orchestrator.service.published import Published
from orchestrator.service.reload import Reload
from orchestrator.service.sockets import Sockets
from orchestrator.service.strays import Strays
from orchestrator.service.streams import Streams
from orchestrator.service.supply import Feeds
from tests.core.said import into, raises
from tests.service.bench import Bench, fields_of
from tests.service.control_bench import SOON_S, Bays, answer, client, closing_all, connected, listening
from tests.service.hall import Hall
from tests.waiting import wait_until

OWN_GROUP = grp.getgrgid(os.getgid()).gr_name


@contextmanager
def reached(bench: Bench, control: Control) -> Iterator[None]:
    """The sockets of a station with this bay."""
    journal = SimpleNamespace(directory=Path("journal"))
    station = cast(
        "Station",
        SimpleNamespace(station="hall", language=Language.EN, control=control, journal=journal, supplies=None, bays=()),
    )
    strays = Strays(bench.store, lambda _: None, lambda _: None)  # type: ignore[arg-type,return-value]  # there are none
    reload = cast("Reload", None)
    vars(bench.journal)["problem"] = lambda _now_s: None  # nobody writes it here
    sockets = Sockets(
        station,
        [bench.bay],
        bench.journal,
        bench.store,
        strays,
        Feeds.of(station, into(bench.said)),
        reload,
        lambda _: None,
        into(bench.said),
    )
    sockets.start()
    try:
        yield
    finally:
        sockets.close()


def test_viewers_see_everything_and_can_do_nothing(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    control = Control(socket=tmp_path / "control", view_socket=tmp_path / "view")
    with reached(bench, control):
        seen = ask(tmp_path / "view", {"verb": "status"})
        assert [bay["name"] for bay in cast("list[dict[str, object]]", seen["bays"])] == ["bay-1"]
        with client(tmp_path / "view") as reader:
            reader.sendall(b'{"verb": "watch", "version": 1}\n')
            with reader.makefile("rb") as stream:
                assert json.loads(stream.readline())["document"]["station"] == "hall"
        for verb in ("stop", "start", "pause", "reset", "reload", "identify", "nonsense"):
            with pytest.raises(ServiceError, match="takes no commands") as refused:
                ask(tmp_path / "view", {"verb": verb, "bays": None})
            assert cast("dict[str, object]", refused.value.told)["id"] == "view_only"
        assert not bench.bay._requests
        assert (tmp_path / "control").is_socket()
    records = [fields_of(line) for _, _, _, line in bench.journal._waiting[False] if line[0] == "request"]
    assert [(record["request"], record["uid"], record["accepted"]) for record in records][:2] == [
        ("stop", os.getuid(), False),
        ("start", os.getuid(), False),
    ]
    assert not (tmp_path / "view").exists()


def stranger(client: Client) -> tuple[int, int, int]:
    client.uid = 12345
    return 4711, client.uid, client.uid


def test_a_group_may_use_its_socket_and_nobody_else_may(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_module, "NAME_S", 0.02)
    monkeypatch.setattr(Client, "peer", stranger)
    path = tmp_path / "run" / "socket"
    control = ControlSocket(path, answer, time.monotonic, group=OWN_GROUP)
    control.start()
    try:
        for _ in range(2):
            found = path.stat()
            assert (stat.S_IMODE(found.st_mode), found.st_gid) == (0o660, os.getgid())
            assert ask(path, {"verb": "status"})["heard"] == {"verb": "status", "uid": 12345}
            path.unlink()
            wait_until(path.exists, what="the name again")
        assert stat.S_IMODE(path.parent.stat().st_mode) == 0o711
    finally:
        control.close()


def test_a_group_that_does_not_exist_is_one_sentence(tmp_path: Path) -> None:
    with raises(StartError, match="there is no group nobodys here: create it"):
        ControlSocket(tmp_path / "socket", answer, time.monotonic, group="nobodys")


@pytest.mark.parametrize(
    ("control", "said"),
    [
        ("{socket: run/s, view_socket: ./run/s}", "control.view_socket: this is the control socket"),
        (f"{{socket: run/s, view_socket: /{'x' * 120}}}", "control.view_socket: the whole path has 121 bytes"),
        ("{socket: run/s, view_group: viewers}", "control.view_group: there is no control.view_socket"),
    ],
)
def test_sockets_that_cannot_be_are_refused(tmp_path: Path, control: str, said: str) -> None:
    text = Path("configs/stations/two-bays-rs485.yaml").read_text(encoding="utf-8")
    file = tmp_path / "station.yaml"
    file.write_text(text.replace("control: {socket: run/orchestrator.sock}", f"control: {control}"), encoding="utf-8")
    with pytest.raises(ConfigError, match=said):
        load_station(file)


def test_groups_and_a_second_socket_are_read(tmp_path: Path) -> None:
    text = Path("configs/stations/one-bay.yaml").read_text(encoding="utf-8")
    for key in ("group", "view_socket", "view_group"):
        text = text.replace(f"  # {key}:", f"  {key}:")
    file = tmp_path / "station.yaml"
    file.write_text(text, encoding="utf-8")
    control = load_station(file).control
    assert (control.group, control.view_group) == ("orchestrator-operators", "orchestrator-viewers")
    assert control.view_socket == tmp_path / "run" / "view.sock"


def test_a_hundred_idle_clients_at_each_socket_delay_no_stop(tmp_path: Path) -> None:
    """Silent ones, some in the midst of a request, and readers who read nothing."""
    bays = Bays()
    bays.ready.set()
    hall = Hall(128)
    streams = Streams(Published(hall.bays, lambda: {"alarm": "none"}, time.time), time.monotonic, lambda _: None)
    streams.start()
    paths = [tmp_path / "control", tmp_path / "view"]
    with listening(paths[0], bays, streams.take), listening(paths[1], bays, streams.take), closing_all() as idle:
        for number in range(100):
            idle += [connected(path) for path in paths]
            if number % 3 == 0:
                idle[-1].sendall(b'{"verb": ')
        for path in paths:
            for _ in range(8):
                idle.append(connected(path))
                idle[-1].sendall(b'{"verb": "watch"}\n')
        wait_until(lambda: len(streams._readers) == 16, what="all readers")
        for _ in range(5):
            hall.change()
            began_s = time.monotonic()
            ask(paths[0], {"verb": "stop"})
            assert time.monotonic() - began_s < SOON_S
        streams.close()
    assert bays.asked == ["stop"] * 5
