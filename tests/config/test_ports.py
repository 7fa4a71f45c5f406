"""An emergency stop finds its ports whatever else is wrong with the file."""

from pathlib import Path

import pytest

from orchestrator.config.load import check, load_station
from orchestrator.config.ports import Wiring, wiring

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
    assert tuple(wiring(file).ports) == ("/dev/ttyS1", "/dev/ttyS2")
    assert wiring(file).socket == str(tmp_path / "run" / "orchestrator.sock")
    assert (check([file]) == []) == (what == "well")


def test_ports_are_those_that_the_service_opens(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(GOOD.replace("/dev/ttyS1", "./tty"))
    assert tuple(wiring(file).ports) == tuple(bay.charger.port for bay in load_station(file).bays)


def test_names_and_socket_are_the_services(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(GOOD)
    station = load_station(file)
    assert dict(wiring(file).ports) == {bay.charger.port: bay.name for bay in station.bays}
    assert wiring(file).socket == str(station.control.socket)


def test_a_port_in_a_comment_is_none(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(GOOD + "# port: /dev/ttyS8\n#port: /dev/ttyS9\n")
    assert tuple(wiring(file).ports) == ("/dev/ttyS1", "/dev/ttyS2")


def test_a_port_under_a_misspelt_key_is_not_forgotten(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(GOOD.replace("charger:", "chrager:", 1))
    assert dict(wiring(file).ports) == {"/dev/ttyS2": "bay-2", "/dev/ttyS1": ""}


def test_a_port_whose_name_no_file_can_have_is_shown_as_written(tmp_path: Path) -> None:
    """Passing it to the system would abort the emergency stop halfway."""
    file = tmp_path / "x.yaml"
    file.write_text(GOOD.replace("/dev/ttyS1", r'"/dev/\0\ud800"') + 'x:\n  port: "/dev/\0"\n')
    assert set(wiring(file).ports) == {"/dev/ttyS2", r"/dev/\0", r"/dev/\0\ud800"}
    file.write_text(GOOD.replace("run/orchestrator.sock", r'"a\0b\ud800"'))
    assert wiring(file).socket == str(tmp_path / r"a\0b\ud800")


def test_a_file_without_ports_has_none(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text("bays: 7\n")
    assert wiring(file) == Wiring({}, "", damaged=True)
    file.write_text("bays: [7, {charger: 1}, {charger: {port: [1]}}, {charger: {port: tty}}]\n")
    assert wiring(file) == Wiring({}, "", damaged=True)
    with pytest.raises(OSError, match="No such file"):
        wiring(tmp_path / "none.yaml")


CONTACTOR = "    contactor: {chip: /dev/gpiochip0, line: 17}\n"


def with_contactor(tmp_path: Path, text: str) -> tuple[tuple[str, int, bool], ...]:
    file = tmp_path / "x.yaml"
    file.write_text(GOOD.replace("\ncontrol:", f"\n{text}control:"))
    return wiring(file).contactors


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (CONTACTOR, ("/dev/gpiochip0", 17, False)),
        (CONTACTOR.replace("}", ", active_low: true}"), ("/dev/gpiochip0", 17, True)),
        (CONTACTOR.replace("17", "0x11"), ("/dev/gpiochip0", 17, False)),
        (CONTACTOR + "    no-such-key: 1\n", ("/dev/gpiochip0", 17, False)),
    ],
)
def test_a_contactor_is_found(text: str, found: tuple[str, int, bool], tmp_path: Path) -> None:
    assert with_contactor(tmp_path, text) == (found,)


@pytest.mark.parametrize(
    "spoilt",
    [
        CONTACTOR.replace("}", ", active_lo: true}"),
        CONTACTOR.replace("}", ", active_low: yes}"),
        CONTACTOR.replace("}", ", active_low: }"),
        CONTACTOR.replace("17", "GPIO17"),
        CONTACTOR.replace("17", "-1"),
        CONTACTOR.replace("/dev/gpiochip0", "gpiochip0"),
    ],
)
def test_a_contactor_in_doubt_is_left_alone(spoilt: str, tmp_path: Path) -> None:
    """With the wrong polarity the stop would close it."""
    assert with_contactor(tmp_path, spoilt) == ()


def test_contactors_are_those_of_the_service(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(GOOD.replace("\ncontrol:", f"\n{CONTACTOR.replace('/dev', './dev')}control:"))
    first, second = (bay.contactor for bay in load_station(file).bays)
    assert first is None
    assert second is not None
    assert wiring(file).contactors == ((second.chip, second.line, second.active_low),)
