"""An emergency stop finds its ports, whatever else is wrong with the file."""

from pathlib import Path

import pytest

from orchestrator.config.load import check, load_station
from orchestrator.config.ports import charger_ports

GOOD = (Path(__file__).parent / "good" / "station.yaml").read_text()


@pytest.mark.parametrize(
    ("what", "text"),
    [
        ("well", GOOD),
        ("no policy", GOOD.replace("policy: li-ion-48v", "policy: no-such")),
        ("a typing error", GOOD.replace("limits:", "limit:").replace("station:", "stattion:")),
        ("a doubled key", GOOD + "journal: {}\n"),
        ("not YAML", GOOD + "]"),
        ("not YAML, before the ports", GOOD.replace("station: depot-3", "station: 'depot-3")),
        ("a tab", GOOD.replace("journal:", "\tjournal:")),
        ("not UTF-8", GOOD.replace("depot-3", "d\x00pot")),
        ("a port in quotes", GOOD.replace("/dev/ttyS1", "'/dev/ttyS1'") + "]"),
        ("a port twice", GOOD.replace("control: {", "port: /dev/ttyS1\ncontrol: {") + "]"),
    ],
)  # fmt: skip
def test_ports_are_found(what: str, text: str, tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(text)
    assert charger_ports(file) == ("/dev/ttyS1", "/dev/ttyS2")
    assert (check([file]) == []) == (what == "well")


def test_ports_are_those_that_the_service_opens(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(GOOD.replace("/dev/ttyS1", "./tty"))
    assert charger_ports(file) == tuple(bay.charger.port for bay in load_station(file).bays)


def test_a_file_without_ports_has_none(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text("bays: 7\n")
    assert charger_ports(file) == ()
    file.write_text("bays: [7, {charger: 1}, {charger: {port: [1]}}, {charger: {port: tty}}]\n")
    assert charger_ports(file) == ()
    with pytest.raises(OSError, match="No such file"):
        charger_ports(tmp_path / "none.yaml")
