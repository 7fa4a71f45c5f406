"""An operator's actions, with the real command line and with the plugs."""

import json
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.sim.client import PlantProcess
from tests.sim.wires import udp_keys
from tests.waiting import wait_until
from tests.whole.station import Document, Service, orchestrator, unnamed, whole_station

Station = tuple[PlantProcess, Service]


def one_automatic(document: Document) -> None:
    """The third bay's charger is configured as automatic; the fourth one's port does not exist. Charges take turns."""
    del document["stagger_s"]
    document["bays"][2]["charger"]["control"] = "automatic"
    document["bays"][3]["charger"]["port"] += "-missing"


@pytest.fixture(name="unplugged", scope="module")
def _unplugged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """Another station of two bays: what happens to their plugs takes its time beside the tests that follow."""
    with whole_station(tmp_path_factory.mktemp("unplugged"), 2) as (plant, service):
        service.start()
        yield plant, service


@pytest.fixture(name="station", scope="module")
def _station(unplugged: Station, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    with whole_station(tmp_path_factory.mktemp("operator"), 4, change=one_automatic) as (plant, service):
        service.start().wait("CHARGING", ["bay-1", "bay-2"])
        yield plant, service


def charging(station: Station, bay: int = 1) -> None:
    """Bring a bay to the start of most of these tests, and wait until its current is up."""
    plant, service = station
    service.ask("start", f"bay-{bay}")
    service.wait("CHARGING", [f"bay-{bay}"])
    wait_until(lambda: plant.state(bay)["current_a"] > 13, 10, "the current")


def test_two_bays_share_a_bus(station: Station) -> None:
    charging(station, 1)
    charging(station, 2)


def test_status_shows_every_bay_and_why(station: Station) -> None:
    charging(station)
    _, service = station
    table = service.cli("status")
    assert table.returncode == 0
    gist, head, *bays = table.stdout.splitlines()
    assert re.fullmatch(r"4 bays: 2 charging, 1 needs you, 1 offline; 2\d A, 1\.\d kW · \d\d:\d\d:\d\d", gist)
    assert head.split() == ["BAY", "STATE", "SOC", "PACK", "CURRENT", "TEMP", "STEP", "WHY"]
    assert [line[:8] for line in bays if "bay-" in line[:8]] == ["!  bay-3", "   bay-1", "   bay-2", "   bay-4"]
    assert "\x1b" not in table.stdout
    assert "5 (14.0 A)  step 5 (14.0 A): the highest step, nothing limits it" in table.stdout
    one = service.cli("status", "bay-2", "--json")
    document = json.loads(one.stdout)
    assert document["station"] == "whole"
    assert [bay["name"] for bay in document["bays"]] == ["bay-2"]
    assert document["bays"][0]["charger"]["online"] is True
    directory = str(service.directory / "run" / "journal")
    assert document["journal"] == {"directory": directory, "problem": "", "cause": None}


def test_an_adapter_that_is_unplugged_and_plugged_in_again(unplugged: Station) -> None:
    plant, service = unplugged
    service.wait("CHARGING", ["bay-1"])
    wait_until(lambda: plant.state(1)["current_a"] > 13, 10, "the current")
    plant.inject("port_gone", 1)
    bay = service.wait("UNCONTROLLABLE", ["bay-1"])["bay-1"]
    assert bay["alarm"] == "danger"
    assert "no such port" in bay["reason"]
    assert bay["charger"]["old"] is True and bay["charger"]["age_s"] > 2
    table = service.cli("status", "bay-1").stdout
    assert table.splitlines()[1].startswith("ALARM: bay-1: CUT THE MAINS of this charger (")
    assert " A (old)" in table and "OLD: the charger's " in table and "; the BMU sees " in table
    plant.inject("heal", 1)
    service.wait("SUSPENDED", ["bay-1"])
    truth = plant.state(1)
    assert (truth["operation"], truth["resting"]) == (0, True)
    assert truth["first_stop_s"] == truth["first_byte_s"]  # the first frame on the new line was a stop


def test_a_battery_that_leaves_and_another_that_comes(unplugged: Station) -> None:
    plant, service = unplugged
    service.wait("CHARGING", ["bay-2"])
    wait_until(lambda: plant.state(2)["current_a"] > 13, 10, "the current")
    plant.inject("battery_removed", 2)
    assert service.wait("IDLE", ["bay-2"])["bay-2"]["reason"] == "no battery"
    plant.set(2, soc_pct=99)
    plant.inject("heal", 2)
    wait_until(
        lambda: "SOC 99 % is not below 98 %" in service.bay("bay-2")["reason"], 10, "the fuller battery is left alone"
    )
    plant.set(2, soc_pct=40)


def test_pause_and_start(station: Station) -> None:
    charging(station)
    plant, service = station
    done = service.cli("pause", "bay-1")
    assert plant.state()["operation"] == 0  # as soon as the command line confirms it
    assert (done.returncode, done.stdout) == (0, "bay-1: pause accepted; stands by, verified\n")
    service.wait("SUSPENDED")
    assert service.bay("bay-2")["state"] == "CHARGING"
    assert service.cli("start", "bay-1").returncode == 0
    service.wait("CHARGING")


def test_a_pause_does_not_end_the_session_and_a_stop_does(station: Station) -> None:
    charging(station)
    _, service = station
    before = len(service.journal("bay-1", "session"))
    service.ask("pause", "bay-1")
    service.wait("SUSPENDED")
    charging(station)
    service.ask("stop", "bay-1")
    service.wait("HELD")
    wait_until(lambda: len(service.journal("bay-1", "session")) > before, what="the journal")
    (end,) = service.journal("bay-1", "session")[before:]
    assert (end["event"], unnamed(end["result"])) == ("end", "stopped by the operator")


def test_stop_holds_until_start(station: Station) -> None:
    charging(station)
    plant, service = station
    charging(station, 2)
    stopped = service.cli("stop", "bay-1", "bay-2")
    assert (plant.state(1)["operation"], plant.state(2)["operation"]) == (0, 0)
    assert (stopped.returncode, stopped.stderr) == (0, "")
    assert stopped.stdout == "".join(f"bay-{number}: stop accepted; stands by, verified\n" for number in (1, 2))
    service.wait("HELD", ["bay-1", "bay-2"])
    refused = service.cli("pause", "bay-1", "bay-2")
    assert refused.returncode == 1
    assert unnamed(refused.stderr) == "".join(
        f"bay-{number}: not running: stopped by the operator\n" for number in (1, 2)
    )
    assert unnamed(service.bay()["reason"]) == "stopped by the operator; to go on: orchestrator start bay-1"
    charging(station)


def test_a_start_to_a_target_and_one_at_a_time_of_day(station: Station) -> None:
    plant, service = station
    charging(station, 2)
    service.ask("stop", "bay-2")
    service.wait("HELD", ["bay-2"])
    plant.set(2, soc_pct=99.2)
    wait_until(lambda: service.bay("bay-2")["battery"]["soc_pct"] >= 99, 10, "the SOC")
    wrong = service.cli("start", "bay-2", "--to", "99")
    assert (wrong.returncode, wrong.stderr) == (1, "bay-2: its SOC is already 99.0 %, the target is 99 %\n")
    then = time.localtime(time.time() + 7200)
    noted = service.cli("start", "bay-*", "--except", "bay-[134]", "--to", "100", "--at", time.strftime("%H:%M", then))
    assert noted.stdout.startswith("bay-2: start accepted; it starts at ") and ", in 1 h " in noted.stdout
    assert " and charges once to 100 % (asked by " in service.cli("status", "bay-2").stdout
    assert service.cli("start", "bay-2", "--to", "100").stdout == "bay-2: start accepted\n"
    service.wait("CHARGING", ["bay-2"])
    bay = service.bay("bay-2")
    assert bay["timed_start"] is None and bay["target"]["text"].startswith("charges once to 100 %, asked by ")
    record = service.journal("bay-2", "request")[-1]
    assert (record["request"], record["target_soc_pct"], record["accepted"]) == ("start", 100.0, True)
    plant.set(2, soc_pct=50.0)
    service.ask("stop", "bay-2")


def test_a_stop_that_nobody_could_verify_is_no_success(station: Station) -> None:
    """The fourth bay's port is missing: its charger may be doing anything."""
    _, service = station
    done = service.cli("stop", "bay-4", "bay-2")
    assert done.returncode == 1
    assert done.stderr.startswith("LOOK at bay-4's charger (")
    assert done.stdout == "bay-4: stop accepted\nbay-2: stop accepted; stands by, verified\n"


def test_a_stop_that_is_not_obeyed_begins_with_what_to_do(station: Station) -> None:
    charging(station, 2)
    plant, service = station
    plant.inject("ignore_stop", 2)
    done = service.cli("stop", "bay-2")
    assert done.returncode == 1
    assert done.stderr.startswith(f"bay-2: CUT THE MAINS of this charger ({plant.bays[1]['port']})")
    assert done.stdout == "bay-2: stop accepted\n"
    table = service.cli("status").stdout.splitlines()
    assert table[1].startswith("ALARM: bay-2: CUT THE MAINS of this charger (")
    bays = [line[:8] for line in table if line[3:6] == "bay"]
    assert bays == ["!! bay-2", "!  bay-3", "   bay-1", "   bay-4"]
    plant.inject("heal", 2)
    service.wait("TRIPPED", ["bay-2"])
    assert service.cli("stop", "bay-2").returncode == 0
    assert service.cli("reset", "bay-2").returncode == 0


def test_a_trip_is_refused_a_start_and_reset_only_when_its_cause_is_gone(station: Station) -> None:
    charging(station, 2)
    plant, service = station
    plant.inject("status_bits", 2)
    service.wait("TRIPPED", ["bay-2"])
    start = service.cli("start", "bay-2")
    assert start.returncode == 1
    assert "status_trip: start is refused before a reset: " in start.stderr
    reset = service.cli("reset", "bay-2")
    assert reset.returncode == 1
    assert "status_trip: reset is refused while it lasts: " in reset.stderr
    plant.inject("heal", 2)
    wait_until(lambda: not service.ask("reset", "bay-2")["bay-2"], what="a reset that is accepted")
    service.wait("HELD", ["bay-2"])
    wait_until(
        lambda: unnamed(service.bay("bay-2")["reason"]) == "reset by the operator; to go on: orchestrator start bay-2",
        what="the hold",
    )
    assert plant.state(2)["operation"] == 0
    charging(station, 2)


def test_wrong_use_is_told(station: Station) -> None:
    _, service = station
    nobody = service.cli("start", "bay-9")
    assert nobody.returncode == 1
    assert (
        nobody.stderr
        == "orchestrator: no bay 'bay-9' here: bay-1, bay-2, bay-3, bay-4; start was carried out at no bay\n"
    )
    assert service.cli("status", "bay-9").returncode == 1
    assert service.cli("start").returncode == 2
    assert service.cli("start", "bay-1", "--all").returncode == 2
    assert service.cli("explode").returncode == 2
    for strange in ({"verb": "explode"}, {"verb": ["stop"]}, {}, {"verb": "stop", "bays": "bay-1"}):
        with pytest.raises(ServiceError, match=r"unknown verb|'bays' is a list"):
            ask(service.socket, strange)
    nowhere = orchestrator("status", "--socket", str(service.directory / "no.sock"))
    assert nowhere.returncode == 2
    assert "no service answers on" in nowhere.stderr
    none = orchestrator("status", env={"ORCHESTRATOR_SOCKET": ""})
    assert none.returncode == 2
    assert none.stderr.startswith("orchestrator: no service found: ")
    here = orchestrator("status", env={"ORCHESTRATOR_SOCKET": ""}, cwd=service.directory)
    assert here.returncode == 0


def test_a_charger_that_is_not_there_at_the_start_is_used_once_it_is(station: Station) -> None:
    plant, service = station
    bay = service.wait("OFFLINE", ["bay-4"])["bay-4"]
    assert "no such port" in bay["reason"]
    assert bay["charger"]["online"] is False
    assert bay["battery"]["online"] is True
    port = Path(plant.bays[3]["port"])
    port.with_name(f"{port.name}-missing").symlink_to(port)
    charging(station, 4)
    assert plant.state(4)["stops"] > 0


def test_a_charger_in_another_mode_than_the_file_says_is_not_used(station: Station) -> None:
    _, service = station
    bay = service.wait("HELD", ["bay-3"])["bay-3"]
    assert [fault["id"] for fault in bay["faults"]] == ["mode_taken_over"]


def test_a_second_service_is_refused(station: Station) -> None:
    _, service = station
    second = orchestrator("run", str(service.file))
    assert second.returncode == 1
    assert re.search(r"bay-1: another service \(pid \d+\) has this port and commands its charger: ", second.stderr)
    assert service.bay("bay-2")["charger"]["online"] is True


def test_a_second_service_cannot_take_the_ports(station: Station, tmp_path: Path) -> None:
    charging(station)
    plant, service = station
    document = json.loads(service.file.read_text(encoding="utf-8"))
    document["can"]["can0"] |= udp_keys()  # two masters on one bus would rightly stop the charge
    thief = tmp_path / "thief.yaml"
    thief.write_text(json.dumps(document), encoding="utf-8")  # its own socket and journal, beside itself
    refused = orchestrator("run", str(thief))
    assert refused.returncode == 1
    assert "let only one station file name this port" in refused.stderr
    assert plant.state()["operation"] == 1


def test_probe_is_refused_while_the_service_runs(station: Station) -> None:
    _, service = station
    refused = orchestrator("probe", str(service.file))
    assert refused.returncode == 1
    assert refused.stderr.startswith("orchestrator: a service is running this station")


def test_a_service_that_may_open_too_few_files_says_so(tmp_path: Path) -> None:
    with whole_station(tmp_path) as (_, service):
        done = subprocess.run(
            [sys.executable, "-m", "orchestrator", "run", str(service.file)],
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (12, 12)),
            capture_output=True, text=True, timeout=30, check=False,
        )  # fmt: skip
        assert done.returncode == 1
        assert "Traceback" not in done.stderr
        assert done.stderr.startswith("orchestrator: at most 12 files may be open at once, and this station needs ")
        assert len(done.stderr.splitlines()) == 1


def test_after_the_backoff_of_their_faults_both_charge_again_by_themselves(unplugged: Station) -> None:
    """The adapter that was plugged in again, and the battery that another one had left in mid-charge."""
    _, service = unplugged
    service.wait("CHARGING", ["bay-1", "bay-2"], timeout_s=40)


def test_the_end_names_the_charger_that_nobody_could_verify(station: Station) -> None:
    """The last one here."""
    plant, service = station
    plant.inject("port_gone", 3)
    service.wait("OFFLINE", ["bay-3"])
    service.signal(signal.SIGTERM)
    assert service.ended() == 1
    log = service.log().splitlines()
    assert log[-1] == "ended: NOT verified: bay-3"
    assert [plant.state(bay)["operation"] for bay in (1, 2, 4)] == [0, 0, 0]
    assert all(line.startswith(("bay-", "whole: ", "SIGTERM: ", "ended: ")) for line in log)  # no traceback
