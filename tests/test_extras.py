"""A package of an extra that is missing: the line to type works in the Python that runs this."""

import subprocess
import sys
from importlib.metadata import requires

import pytest

from orchestrator.cli import main
from orchestrator.extras import DISTRIBUTION, install_extra, pip_install


def test_the_line_names_this_python_and_the_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    assert install_extra("gpio") == f"{sys.executable} -m pip install 'gpiod<3,>=2.2'"
    assert install_extra("dask").endswith(" -m pip install 'distributed>=2025'")
    assert {line.partition(" -m ")[0] for line in (install_extra("demo"), pip_install("x"))} == {sys.executable}
    monkeypatch.setattr(sys, "executable", "/opt/our own/python")
    assert pip_install("x") == "'/opt/our own/python' -m pip install x"


def test_every_extra_has_packages() -> None:
    extras = {
        line.partition("extra ==")[2].strip(" '\"") for line in requires(DISTRIBUTION) or () if "extra ==" in line
    }
    assert extras == {"completion", "gpio", "demo", "web", "workbench", "dask"}
    assert not [extra for extra in extras if DISTRIBUTION in install_extra(extra)]


def test_a_program_that_is_not_installed_names_its_extra() -> None:
    assert install_extra("demo", "not-installed").endswith(" -m pip install 'not-installed[demo]'")


def test_a_verb_without_its_package_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pygraphviz", None)
    monkeypatch.delitem(sys.modules, "orchestrator.workbench.draw.drawing", raising=False)
    assert main(["diagram", "--format", "svg", "--out", "/dev/null"]) == 1
    assert capsys.readouterr().err.startswith(
        f"orchestrator: svg needs the package pygraphviz: {sys.executable} -m pip install "
    )


def test_the_page_without_its_packages_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.startswith("orchestrator.northbound.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "starlette.requests", None)
    assert main(["serve", "northbound.yaml"]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"orchestrator: the page needs the package starlette.requests: {sys.executable} -m pip ")
    assert "uvicorn" in said


#: Stands in for a Python without the extra `demo`.
WITHOUT_DEMO = """
import sys
sys.modules |= dict.fromkeys(("durand", "msgpack", "rich"))
from orchestrator.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    ("words", "status", "out", "err"),
    [
        (("--fault", "list"), 0, "reverse_polarity", ""),
        (("--fault", "nothing"), 1, "", "orchestrator: no fault 'nothing': "),
        ((), 1, "", f"orchestrator: the demo needs the package durand: {sys.executable} -m pip install 'durand"),
    ],
)
def test_the_names_of_faults_need_no_extra(words: tuple[str, ...], status: int, out: str, err: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_DEMO, "demo", *words], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == status, done.stderr
    assert out in done.stdout
    assert done.stderr.startswith(err)
    assert bool(done.stderr) == bool(err)
