"""What `pip install .` installs: the program, the shipped files, and only five libraries."""

import re
import shutil
import subprocess
import sys
import zipfile
from email import message_from_bytes
from email.message import Message
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LEFT_OUT = (".*", "*.egg-info", "__pycache__", "build", "dist", "run", "tests")
RUNTIME = {"canopen", "pyserial", "python-can", "pyyaml", "transitions"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built offline from a copy, so nothing of an earlier build gets into it."""
    source, target = tmp_path_factory.mktemp("source") / "copy", tmp_path_factory.mktemp("wheel")
    shutil.copytree(ROOT, source, symlinks=True, ignore=shutil.ignore_patterns(*LEFT_OUT))
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-index")
    subprocess.run((*pip, "--no-deps", "--no-build-isolation", "--wheel-dir", target, source), check=True)
    (built,) = target.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel unpacked outside any checkout."""
    target = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(target)
    return target


def metadata(installed: Path) -> Message:
    (path,) = installed.glob("*.dist-info/METADATA")
    return message_from_bytes(path.read_bytes())


def files(folder: Path, pattern: str) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob(pattern) if path.is_file()}


def test_every_module_is_inside(installed: Path) -> None:
    assert files(installed / "orchestrator", "*.py") == files(ROOT / "orchestrator", "*.py")
    assert (installed / "orchestrator" / "py.typed").exists()
    pages = files(installed / "orchestrator", "*.html")
    assert pages == files(ROOT / "orchestrator", "*.html")
    assert pages, "the workbench's page"


@pytest.mark.parametrize("folder", ["policies", "configs"])
def test_everything_that_ships_is_inside(installed: Path, folder: str) -> None:
    inside = installed / "orchestrator" / "_shipped" / folder
    assert files(inside, "*") == files(ROOT / folder, "*")
    assert files(inside, "*.yaml")
    assert not inside.is_symlink()


def test_nothing_else_is_inside(installed: Path) -> None:
    assert {path.name for path in installed.iterdir() if path.suffix != ".dist-info"} == {"orchestrator"}


def test_the_runtime_needs_five_libraries(installed: Path) -> None:
    required = metadata(installed).get_all("Requires-Dist", [])
    runtime = {line.split(";")[0] for line in required if "extra ==" not in line}
    assert {re.split("[<>]", line)[0].lower() for line in runtime} == RUNTIME
    assert all(">=" in line and "<" in line for line in runtime), "each has a lower and an upper bound"


def test_the_command_is_there(installed: Path) -> None:
    (path,) = installed.glob("*.dist-info/entry_points.txt")
    assert "orchestrator = orchestrator.__main__:main" in path.read_text().splitlines()


def test_the_installed_package_finds_what_ships(installed: Path, tmp_path: Path) -> None:
    code = "import sys; sys.path.insert(0, sys.argv[1]); from orchestrator.config import shipped; "
    code += "print(shipped.__file__, *shipped.shipped_names('policies'))"
    run = subprocess.run(
        (sys.executable, "-c", code, installed), cwd=tmp_path, check=True, capture_output=True, text=True
    )
    source, *names = run.stdout.split()
    assert Path(source).is_relative_to(installed)
    assert names == sorted(path.stem for path in (ROOT / "policies").glob("*.yaml"))
