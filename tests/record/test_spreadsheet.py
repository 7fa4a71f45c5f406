"""The CSV of charges, opened by LibreOffice itself: numbers are numbers, and names stay what they are."""

import shutil
import subprocess
from collections.abc import Iterator, Sequence
from xml.etree import ElementTree as ET

import pytest

from orchestrator.model.cause import plain, said
from orchestrator.record.row import as_record, as_row
from orchestrator.record.table import BOM, as_csv
from tests.record.made import end

SOFFICE = shutil.which("soffice")
TABLE, TEXT, OFFICE = (f"{{urn:oasis:names:tc:opendocument:xmlns:{name}:1.0}}" for name in ("table", "text", "office"))
#: Ids of batteries that a spreadsheet might take for something else.
NAMES = ("B-0042", "0042", "1E5", "1-2", "=1+1", 'B "x", y', "배터리")
SECONDS = 100.0
#: Comma, double quote, UTF-8: its dialog proposes that because of the byte order mark. Without a dialog nothing looks.
FILTER = "--infilter=CSV:44,34,76"


def cells(row: ET.Element) -> Iterator[tuple[str, str]]:
    """The type and the value of each cell of a row; equal ones beside each other are written once."""
    for cell in row.iter(f"{TABLE}table-cell"):
        kind = cell.get(f"{OFFICE}value-type", "")
        text = "\n".join("".join(one.itertext()) for one in cell.iter(f"{TEXT}p"))
        value = cell.get(f"{OFFICE}value", text) if kind == "float" else text
        yield from [(kind, value)] * int(cell.get(f"{TABLE}number-columns-repeated", "1"))


@pytest.fixture(name="sheet", scope="module")
def _sheet(tmp_path_factory: pytest.TempPathFactory) -> Sequence[dict[str, tuple[str, str]]]:
    """The rows as LibreOffice has them: column → type and value."""
    if SOFFICE is None:
        pytest.skip("LibreOffice is not installed: apt-get install libreoffice-calc-nogui")
    path = tmp_path_factory.mktemp("sheet")
    made = [
        {**end(at, 3, 12.5 + at, battery=name), "result": plain(said("끝: 1, 2")), "by": plain(said("=kim"))}
        for at, name in enumerate(NAMES)
    ]
    charges = [as_record(as_row(one)) for one in made]
    (path / "charges.csv").write_text("".join(as_csv(charges, "ko")), encoding="utf-8", newline="")
    profile = f"-env:UserInstallation={(path / 'profile').as_uri()}"
    command = [
        SOFFICE,
        "--headless",
        profile,
        FILTER,
        "--convert-to",
        "fods",
        "--outdir",
        str(path),
        str(path / "charges.csv"),
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=SECONDS)
    head, *rows = ET.parse(path / "charges.fods").getroot().iter(f"{TABLE}table-row")
    names = [value for _, value in cells(head) if value]
    return [dict(zip(names, cells(row), strict=False)) for row in rows if any(value for _, value in cells(row))]


def test_every_charge_is_a_row_with_every_column(sheet: Sequence[dict[str, tuple[str, str]]]) -> None:
    assert len(sheet) == len(NAMES)
    assert next(iter(sheet[0])) == "id", "the byte order mark is none of a name"
    assert [*sheet[0]][-1] == "why"


def test_numbers_are_numbers(sheet: Sequence[dict[str, tuple[str, str]]]) -> None:
    assert [row["charger_ah"] for row in sheet] == [("float", f"{12.5 + at}") for at in range(len(NAMES))]
    assert sheet[0]["soc_begin_pct"] == ("float", "20")


def test_names_and_sentences_are_text(sheet: Sequence[dict[str, tuple[str, str]]]) -> None:
    shown = [row["battery"] for row in sheet]
    assert shown == [("string", name) for name in ("B-0042", "'0042", "'1E5", "'1-2", "'=1+1", 'B "x", y', "배터리")]
    assert {row["why"] for row in sheet} == {("string", "끝: 1, 2")}
    assert {row["by"] for row in sheet} == {("string", "'=kim")}
    assert {row["id"][0] for row in sheet} == {"string"}


def test_it_begins_with_a_byte_order_mark() -> None:
    assert "".join(as_csv([], "en")).startswith(f"{BOM}id,")
