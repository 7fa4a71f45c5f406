"""The emulated station as the product sees it: another process, real ptys, a bus between processes."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.sim.client import PlantProcess
from orchestrator.sim.plant import arguments
from tests.sim.wires import Client, Port, framed, on_bus, udp_keys
from tests.waiting import wait_until

STATUS = framed("90 05 01 90 13 1F")
STATUS_BYTES = 9 + 16
STOP = "AF FA 90 04 10 90 00 34 AF A0"


@pytest.fixture(name="keys", scope="module")
def _keys() -> dict[str, object]:
    return udp_keys()


@pytest.fixture(name="plant", scope="module")
def _plant(tmp_path_factory: pytest.TempPathFactory, keys: dict[str, object]) -> Iterator[PlantProcess]:
    directory = tmp_path_factory.mktemp("ports")
    with PlantProcess(directory, "--bays", "2", "--can", json.dumps(keys), "--soc", "50") as plant:
        yield plant


@pytest.fixture(name="port")
def _port(plant: PlantProcess) -> Iterator[Port]:
    port = Port(plant.bays[0]["port"])
    yield port
    port.close()


@pytest.fixture(name="client")
def _client(plant: PlantProcess, keys: dict[str, object]) -> Iterator[Client]:
    with on_bus(**keys) as client:
        yield client


def test_it_says_where_everything_is(plant: PlantProcess) -> None:
    assert [(bay["name"], bay["node_id"], bay["can"]) for bay in plant.bays] == [("bay-1", 16, 0), ("bay-2", 17, 0)]
    assert all(Path(bay["port"]).is_symlink() for bay in plant.bays)


def test_both_lines_show_one_battery(plant: PlantProcess, port: Port, client: Client) -> None:
    for order in ("90 04 10 90 01", "90 05 02 90 02 02", "90 05 02 90 04 04", "90 05 02 90 01 01"):
        port.write(framed(order))
    wait_until(lambda: plant.state()["current_a"] == 8.0)
    reply = bytes.fromhex(port.ask(STATUS, STATUS_BYTES))
    charger_v, charger_a = int.from_bytes(reply[6:8], "big") / 100, int.from_bytes(reply[8:10], "big") / 100
    answer = client.ask(0x610, "40 00 60 00 00 00 00 00")
    assert answer is not None
    word = bytes.fromhex(answer)[4:]
    bmu_v, bmu_a = int.from_bytes(word[2:], "little") / 100, int.from_bytes(word[:2], "little") / 100
    assert charger_a == bmu_a == 8.0
    assert 48.0 < bmu_v < charger_v < bmu_v + 0.5
    port.write(STOP)
    port.write(framed("90 05 02 90 01 00"))
    wait_until(lambda: plant.state()["current_a"] == 0)
    state = plant.state()
    assert (state["operation"], state["run"], state["resting"]) == (0, False, True)


def test_its_clock_is_everybody_s(plant: PlantProcess, port: Port) -> None:
    before_s = time.monotonic()
    injected_s = plant.inject("heal")
    port.write(STOP)
    wait_until(lambda: plant.state()["first_stop_s"] is not None)
    state = plant.state()
    assert before_s <= injected_s == state["injected_s"] <= state["first_stop_s"] <= time.monotonic()


def test_packs_can_be_set(plant: PlantProcess) -> None:
    plant.set(2, soc_pct=77, soh_pct=80, temperature_c=30)
    state = plant.state(2)
    assert (state["soc_pct"], state["temperature_c"]) == (77, 30)
    assert plant.state(1)["soc_pct"] != 77


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ({"bay": 3, "query": "state"}, r"bay 3: there are 1 … 2"),
        ({"bay": "x", "inject": "heal"}, "bay x"),
        ({"inject": "flood"}, "unknown fault 'flood': there are reverse_polarity"),
        ({"set": {"colour": 1}}, "cannot set colour"),
        ({"dance": True}, "unknown command"),
        ([], "a command is a JSON object"),
    ],
)
def test_what_it_cannot_do_it_says(plant: PlantProcess, command: dict[str, object], reason: str) -> None:
    with pytest.raises(RuntimeError, match=reason):
        plant.ask(command)


def test_an_unplugged_port_and_its_return(plant: PlantProcess) -> None:
    plant.inject("port_gone", 2)
    name = Path(plant.bays[1]["port"])
    assert not name.is_symlink()
    plant.inject("heal", 2)
    port = Port(str(name))
    assert port.ask(STATUS, STATUS_BYTES).startswith("AF FA 90 13 03")
    port.close()


def test_a_rebooting_bmu_says_so(plant: PlantProcess, client: Client) -> None:
    plant.inject("bmu_reboot", 2)
    assert client.wait(0x711) == "00"


def test_an_emergency_is_on_the_bus(plant: PlantProcess, client: Client) -> None:
    plant.inject("emergency", 2, 0x3210)
    assert client.wait(0x091) == "10 32 01 00 00 00 00 00"


def start(directory: Path, *args: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-m", "orchestrator.sim.plant", "--dir", str(directory), *args],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def test_it_quits_when_told_and_takes_its_ports_along(tmp_path: Path) -> None:
    process = start(tmp_path, "--can", json.dumps(udp_keys()), "--line", "perfect", "--pack", "demo", "--automatic")
    out, _ = process.communicate(b'nonsense\n{"query": "state"}\n{"quit": true}\n', timeout=20)
    ready, complaint, state = map(json.loads, out.splitlines())
    assert ready["ready"]
    assert "not JSON" in complaint["error"]
    assert state["bays"][0]["charge_mode"] == 1, "in automatic it looks for a battery"
    assert process.returncode == 0
    assert list(tmp_path.iterdir()) == []


def test_it_ends_in_order_on_sigterm(tmp_path: Path) -> None:
    process = start(tmp_path, "--can", json.dumps(udp_keys()))
    assert process.stdout is not None
    assert json.loads(process.stdout.readline())["ready"]
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=20)
    assert process.returncode == 0
    assert list(tmp_path.iterdir()) == []


def test_it_ends_when_nobody_is_left_to_command_it(tmp_path: Path) -> None:
    process = start(tmp_path, "--can", json.dumps(udp_keys()))
    process.communicate(timeout=20)  # closes its stdin
    assert process.returncode == 0


def test_bays_are_dealt_to_several_buses(tmp_path: Path) -> None:
    one, two = udp_keys(), udp_keys()
    buses = ("--can", json.dumps(one), "--can", json.dumps(two))
    with PlantProcess(tmp_path, "--bays", "3", *buses, "--node", "0x7E") as plant, on_bus(**two) as client:
        assert [(bay["can"], bay["node_id"]) for bay in plant.bays] == [(0, 126), (0, 127), (1, 126)]
        assert client.ask(0x67E, "40 00 60 00 00 00 00 00") is not None
        assert client.ask(0x67F, "40 00 60 00 00 00 00 00", within_s=0.1) is None


@pytest.mark.parametrize("args", [["--bays", "0"], ["--bays", "113"], ["--node", "0"], ["--soc", "full"]])
def test_wrong_arguments_are_refused(args: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refusal:
        arguments(["--dir", "x", *args])
    assert refusal.value.code == 2
    assert capsys.readouterr().err


def test_a_plant_that_cannot_start_is_an_error_at_once(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="ended with status 2"):
        PlantProcess(tmp_path, "--bays", "0")
