"""`orchestrator probe` on the emulated station: what it shows, what it leaves alone, its report on silent devices."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread

import pytest

from orchestrator.commissioning.compare_maps import comparison
from orchestrator.commissioning.probe import probe
from orchestrator.commissioning.volts import Volts, compared
from orchestrator.config.load import load_map, load_station
from orchestrator.config.shipped import shipped_dir
from orchestrator.config.station import Station
from orchestrator.errors import ServiceError
from orchestrator.link.can_gate import refusal
from orchestrator.model import Measurement
from orchestrator.protocol.words import Decoded
from orchestrator.service.control import ControlSocket
from orchestrator.sim.client import PlantProcess
from tests.core.said import cause
from tests.link.strangers import holding
from tests.sim.wires import on_bus, udp_keys
from tests.whole.station import Document, orchestrator, station_document


def no_change(_: Document) -> None:
    return None


class Site:
    """A plant with station files for it."""

    def __init__(self, directory: Path, *plant_args: str) -> None:
        self.directory = directory
        self.keys = udp_keys()
        self.plant = PlantProcess(directory, "--bays", "2", "--can", json.dumps(self.keys), *plant_args)

    def file(self, change: Callable[[Document], None] = no_change) -> Path:
        document = station_document(self.directory, [self.keys], 2)
        change(document)
        path = self.directory / "station.yaml"
        path.write_text(json.dumps(document), encoding="utf-8")
        return path

    def station(self, change: Callable[[Document], None] = no_change) -> Station:
        return load_station(self.file(change))

    def probe(
        self, *bays: str, nmt: str | None = None, old: bool = False, change: Callable[[Document], None] = no_change
    ) -> tuple[int, str]:
        """The exit status and the output."""
        shown: list[str] = []
        status = probe(self.station(change), bays or ("bay-1",), nmt, old_protocol=old, show=shown.append)
        return status, "\n".join(shown)


@pytest.fixture(name="site", scope="module")
def _site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    site = Site(tmp_path_factory.mktemp("site"), "--soc", "50")
    yield site
    site.plant.close()


@pytest.fixture(name="other_site", scope="module")
def _other_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Its BMUs have the first value in the low bits; its chargers are in automatic mode."""
    site = Site(tmp_path_factory.mktemp("other"), "--soc", "50", "--layout", "first-low", "--automatic")
    yield site
    site.plant.close()


def test_a_port_that_a_stranger_has_locked_is_probed_and_told(site: Site) -> None:
    with holding(str(site.plant.bays[0]["port"])) as stranger:
        status, shown = site.probe()
    assert status == 0
    assert f"(pid {stranger.pid}) has locked this port, and may take its answers" in shown


def set_map(name: str) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        for bay in document["bays"]:
            bay["battery"]["map"] = name

    return change


def test_everything_that_both_devices_say_is_shown(site: Site) -> None:
    status, shown = site.probe()
    assert status == 0
    assert shown.splitlines()[-1] == "every device answered"
    for text in (
        "=== bay-1",
        "data      13     kind 1: voltage, current, control mode",
        "voltage 48.1 V",
        "battery connection 1 (normal)",
        "BMU 0x10 on can0: answers",
        "  device type: 00 00 00 00 = 0x00000000 = 0, 4 bytes",
        "  heartbeat period, ms (0: off): 00 00       = 0x0000 = 0, 2 bytes",
        "  NMT state: unknown, no heartbeat came",
        "  0x6000:00  00 00 CA 12 = 0x12CA0000 = 315228160, 4 bytes",
    ):
        assert text in shown


def test_both_maps_stand_side_by_side_and_the_right_one_is_named(site: Site) -> None:
    _, shown = site.probe()
    lines = [line.split() for line in shown.splitlines()]
    assert ["value", "tabos", "tabos-lsb"] in lines
    assert ["voltage_v", "48.1", "48.1"] in lines
    assert ["soc_pct", "50", "cannot", "be"] in lines
    assert "  map tabos: nothing speaks against it" in shown
    assert "  map tabos-lsb: status 65535 is outside 0 … 127 (raw 0xFFFF)" in shown
    assert "→ map tabos, as in the station file" in shown
    assert "→ the station file says map tabos-lsb, but tabos fits better" in site.probe(change=set_map("tabos-lsb"))[1]


def test_the_other_layout_is_recognised(other_site: Site) -> None:
    status, shown = other_site.probe(old=True, change=set_map("tabos"))
    assert status == 0
    assert "→ the station file says map tabos, but tabos-lsb fits better" in shown
    assert "→ map tabos-lsb, as in the station file" in other_site.probe(change=set_map("tabos-lsb"))[1]


def test_a_map_of_ones_own_has_a_column_too(site: Site) -> None:
    text = (shipped_dir() / "configs/maps/tabos.yaml").read_text(encoding="utf-8")
    own = text.replace("map: tabos\n", "map: mine\n").replace("scale: 0.1, range: [-39.9", "scale: 1, range: [-39.9")
    (site.directory / "mine.yaml").write_text(own, encoding="utf-8")
    _, shown = site.probe(old=True, change=set_map("./mine.yaml"))
    assert ["value", "tabos", "tabos-lsb", "mine", "(yours)", "older", "protocol"] in map(str.split, shown.splitlines())
    assert "map mine (yours): temperature 200 is outside -39.9 … 124.9 (raw 0x00C8)" in shown
    assert "→ the station file says map mine (yours), but tabos fits better" in shown


def test_the_older_protocol_is_asked_only_when_wanted(site: Site) -> None:
    assert "older" not in site.probe()[1]
    _, shown = site.probe(old=True)
    assert "  older protocol, COB-ID 0x4F0, page 1: 70 01 CA 12 00 00 00 00" in shown
    assert ["temperature_c", "20", "20", "20"] in [line.split() for line in shown.splitlines()]


def test_nothing_is_commanded(site: Site) -> None:
    before = site.plant.state()
    site.probe(old=True)
    after = site.plant.state()
    assert after["polls"] == before["polls"] + 1
    assert [after[name] - before[name] for name in ("orders", "stops", "resumes", "bad")] == [0, 0, 0, 0]


def test_charger_and_bmu_are_compared_and_the_nodes_on_the_bus_listed(site: Site) -> None:
    site.plant.set(2, soc_pct=60)
    _, shown = site.probe("bay-1", "bay-2")
    lines = shown.splitlines()
    assert "nodes heard on can0 (0x10 … 0x1F): 0x10 (bay-1), 0x11 (bay-2)" in lines
    assert "bay-1: charger 48.1 V, BMU 48.1 V: they agree" in lines
    assert "swapped?" not in shown and "not heard" not in shown


def swapped_ports(document: Document) -> None:
    one, other = (bay["charger"] for bay in document["bays"])
    one["port"], other["port"] = other["port"], one["port"]


def test_swapped_cables_are_named(site: Site) -> None:
    site.plant.set(2, soc_pct=90)
    status, shown = site.probe("bay-1", "bay-2", change=swapped_ports)
    assert status == 1
    assert "swapped? bay-1 and bay-2: each charger reads the volts of the other's battery: exchange" in shown


def test_a_node_at_another_switch_is_named(site: Site) -> None:
    def wrong_node(document: Document) -> None:
        document["bays"][0]["battery"]["node_id"] = 0x1A

    _, shown = site.probe(change=wrong_node)
    assert "nodes heard on can0 (0x10 … 0x1F): 0x10 (no bay has it), 0x11 (bay-2)" in shown
    assert "not heard: 0x1A (bay-1); is battery.node_id, or the switch, one of 0x10?" in shown


def volts(bay: str, charger_v: float | None, bmu_v: float | None) -> Volts:
    return Volts(bay, charger_v, bmu_v, 1.0)


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ([volts("a", 50.0, 51.0)], ["a: charger 50.0 V, BMU 51.0 V: they agree"]),
        ([volts("a", 50.0, 51.1)], ["a: charger 50.0 V, BMU 51.1 V: they differ by 1.1 V, at most 1.0 V is right"]),
        ([volts("a", 0.2, 51.1)], ["a: charger 0.2 V, BMU 51.1 V: the charger sees no battery; is a contactor open?"]),
        ([volts("a", None, 51.1)], ["a: charger –, BMU 51.1 V: nothing to compare"]),
        (
            [volts("a", 50.0, 50.0), volts("b", 50.5, 50.5)],
            ["a and b have batteries of the same volts: cables swapped between them would not show here"],
        ),
        (
            [volts("a", 50.0, 44.0), volts("b", 44.0, 50.0), volts("c", 53.0, 53.0)],
            ["swapped? a and b: each charger reads the volts of the other's battery: exchange their serial ports, or "
             "their node ids, in the station file or at the cables"],
        ),
        (
            [volts("a", 50.0, 44.0), volts("b", 50.0, 50.0)],
            ["swapped? a's charger reads the volts of b's battery: see which cables go where"],
        ),
        (
            [volts("a", 50.0, 41.0), volts("b", 44.0, 50.0), volts("c", 41.0, 44.0)],
            [f"swapped? {one}'s charger reads the volts of {other}'s battery: see which cables go where"
             for one, other in ("ab", "bc", "ca")],
        ),
        ([volts("a", 0.2, 44.0), volts("b", 30.0, 0.2)], []),
    ],
)  # fmt: skip
def test_what_is_compared_and_what_may_be_swapped(found: list[Volts], said: list[str]) -> None:
    lines = list(compared(found))
    assert [line for line in lines if line in said] == said
    assert sum(line.startswith("swapped?") for line in lines) == sum(line.startswith("swapped?") for line in said)


def test_an_nmt_command_is_sent_first(site: Site) -> None:
    assert "NMT reset node to node 0x10: it booted" in site.probe(nmt="reset-node")[1]
    status, shown = site.probe(nmt="stop")
    assert status == 1
    assert "BMU 0x10 on can0: no answer: " in shown
    status, shown = site.probe(nmt="start")
    assert status == 0
    assert "NMT start to node 0x10: sent" in shown


def test_a_charger_in_another_mode_than_the_file_says_is_pointed_out(other_site: Site) -> None:
    status, shown = other_site.probe()
    assert status == 0
    assert "! it is in automatic mode, the station file says manual: look at its rotary switch" in shown


def test_silent_devices_are_told_what_to_check(site: Site) -> None:
    site.plant.inject("charger_cut_off", 2)
    site.plant.inject("bmu_silent", 2)
    try:
        status, shown = site.probe("bay-1", "bay-2")
    finally:
        site.plant.inject("heal", 2)
    assert status == 1
    assert "no answer: check the charger's power, the cable, and for swapped wires (RX and TX, or + and −)" in shown
    assert "BMU 0x11 on can0: no answer: nothing at all is heard: check its power, the cable, the terminators" in shown
    assert shown.splitlines()[-1] == "NO ANSWER: bay-2's charger, bay-2's BMU"


def test_a_wrong_node_id_is_told_from_a_silent_bus(site: Site) -> None:
    """Foreign frames prove that wiring and bit rate are right."""

    def wrong_node(document: Document) -> None:
        document["bays"][0]["battery"]["node_id"] = 0x33

    with on_bus(**site.keys) as client:
        ended = Event()

        def talk() -> None:
            while not ended.wait(0.05):
                client.send(0x711, "05")

        talking = Thread(target=talk)
        talking.start()
        try:
            status, shown = site.probe(change=wrong_node)
        finally:
            ended.set()
            talking.join()
    assert status == 1
    assert "but other frames come in (COB-ID 0x711), so wiring and bit rate are right: check its node switch" in shown


def test_a_port_that_is_missing_or_taken_is_told_and_the_bmu_asked_all_the_same(site: Site) -> None:
    def missing(document: Document) -> None:
        document["bays"][0]["charger"]["port"] += "-missing"

    status, shown = site.probe(change=missing)
    assert status == 1
    assert "charger: " in shown
    assert "no such port: check that the adapter is plugged in" in shown
    assert "BMU 0x10 on can0: answers" in shown


def test_a_contactor_that_cannot_be_looked_at_is_told(site: Site) -> None:
    def no_chip(document: Document) -> None:
        document["bays"][0]["contactor"] = {"chip": "./gpiochip9", "line": 17}

    status, shown = site.probe(change=no_chip)
    assert status == 1
    assert "contactor: " in shown
    assert "gpiochip9 line 17: no such GPIO chip: check the name in the station file" in shown
    assert shown.endswith("NO ANSWER: bay-1's contactor")


def test_a_contactors_line_is_shown(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    def low(document: Document) -> None:
        document["bays"][0]["contactor"] = {"chip": "/dev/gpiochip0", "line": 17, "active_low": True}

    monkeypatch.setattr(
        "orchestrator.commissioning.probe.describe", lambda chip, line: f"{chip} line {line}: input, free"
    )
    status, shown = site.probe(change=low)
    assert status == 0
    assert "contactor on /dev/gpiochip0 line 17: input, free; closed while the pin is low" in shown


def test_a_bus_that_cannot_be_opened_is_told(site: Site) -> None:
    def no_adapter(document: Document) -> None:
        document["can"]["can0"] = {"interface": "slcan", "channel": "/dev/not-there", "bitrate": 250000}

    status, shown = site.probe(change=no_adapter)
    assert status == 1
    assert "BMU: CAN bus can0 (slcan /dev/not-there)" in shown


def test_a_refused_object_is_an_answer(site: Site) -> None:
    site.plant.inject("sdo_abort", 1)
    try:
        status, shown = site.probe()
    finally:
        site.plant.inject("heal", 1)
    assert status == 0
    assert "0x6004:00  aborted with 0x06020000: object does not exist in the object dictionary" in shown


def test_a_bay_that_is_not_there_and_a_service_that_runs_are_refused(site: Site) -> None:
    with pytest.raises(ServiceError, match="no bay 'bay-9' in this station: bay-1, bay-2"):
        site.probe("bay-9")
    control = ControlSocket(site.station().control.socket, lambda _: {}, lambda: 0.0)
    try:
        with pytest.raises(ServiceError, match=r"a service is running this station .*: stop it first, or ask it"):
            site.probe()
    finally:
        control.close()


def test_the_command_line(site: Site) -> None:
    done = orchestrator("probe", str(site.file()), "--bay", "bay-2", "--old-protocol")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("=== bay-2\n")
    assert "COB-ID 0x4F1, page 3" in done.stdout
    assert orchestrator("probe", str(site.file()), "--nmt", "explode").returncode == 2


# --- without devices -------------------------------------------------------------------------------------------------


def test_the_gate_lets_the_older_request_out_only_for_a_probe() -> None:
    assert refusal(0x470, b"\x70", {0x10})
    assert not refusal(0x470, b"\x70", {0x10}, pages=True)
    for cob_id, data in ((0x471, b"\x71"), (0x470, b"\x71"), (0x470, b"\x70\0"), (0x470, b""), (0x200, b"\x70")):
        assert refusal(cob_id, data, {0x10}, pages=True)


WORDS = {(0x6000, 0): (0x12CA0000, 4), (0x6002, 0): (0xFFFF3264, 4)}


def lines_of(pages: dict[str, Decoded]) -> str:
    maps = {name: load_map(name) for name in ("tabos", "tabos-lsb")}
    return "\n".join(comparison(maps, maps["tabos"], WORDS, pages))


def test_objects_that_were_not_answered_leave_gaps() -> None:
    shown = [line.split() for line in lines_of({}).splitlines()]
    assert ["temperature_c", "–", "–"] in shown
    assert ["time_to_empty_min", "not", "available", "12900"] in shown


@pytest.mark.parametrize(
    ("page_v", "said"), [(48.1, ""), (47.0, ""), (40.0, "voltage_v 48.1, but 40 by the older protocol")]
)
def test_the_older_protocol_agrees_within_what_a_second_may_change(page_v: float, said: str) -> None:
    shown = lines_of(
        {"voltage_v": Measurement(page_v, 0.0), "status": None, "soc_pct": cause("soc_pct 140 is outside")}
    )
    assert f"map tabos: {said or 'nothing speaks against it'}" in shown


def test_status_bits_must_be_the_same() -> None:
    maps = {"tabos": load_map("tabos")}
    words = {(0x6001, 0): (0x0003_FFFF, 4)}
    shown = "\n".join(comparison(maps, maps["tabos"], words, {"status": Measurement(2.0, 0.0)}))
    assert "map tabos: status 3, but 2 by the older protocol" in shown
