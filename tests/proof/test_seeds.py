"""The seeds still apply to the package, so the table cannot rot."""

from pathlib import Path

import pytest

from tests.proof.scenes import SCENES
from tests.proof.seed_table import SEEDS
from tests.proof.seeded.seed import Seed
from tests.proof.seeds import PAGE, PROOFS, ROOT, Result, apply, page, search


@pytest.mark.parametrize("seed", SEEDS, ids=lambda seed: seed.name)
def test_a_seed_applies(seed: Seed, tmp_path: Path) -> None:
    for name, _, _ in seed.changes:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text((ROOT / name).read_text(encoding="utf-8"), encoding="utf-8")
    apply(seed, tmp_path)
    for name, _, _ in seed.changes:
        changed = (tmp_path / name).read_text(encoding="utf-8")
        assert changed != (ROOT / name).read_text(encoding="utf-8")
        compile(changed, name, "exec")


def test_a_seed_that_does_not_fit_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file.py").write_text("a = 1\na = 1\n", encoding="utf-8")
    with pytest.raises(ValueError, match="2 times"):
        apply(Seed("double", "stop", "-", (("file.py", "a = 1", "a = 2"),)), tmp_path)


def test_names_are_unique_and_proofs_exist() -> None:
    assert len({seed.name for seed in SEEDS}) == len(SEEDS)
    assert {seed.likely for seed in SEEDS} <= set(PROOFS)


@pytest.mark.parametrize("seed", SEEDS, ids=lambda seed: seed.name)
def test_what_comes_first_is_there(seed: Seed) -> None:
    for where in seed.where:
        file, _, test = where.partition("::")
        assert where in SCENES if seed.likely == "environment" else (ROOT / file).exists()
        assert not test or f"def {test}(" in (ROOT / file).read_text(encoding="utf-8")


def test_the_page_names_what_nobody_found() -> None:
    text = "\n".join(page([Result(SEEDS[0], "scripts", "seed 7", 3.0, 4.0), Result(SEEDS[1], "", "", 0.0, 100.0)]))
    assert "1 of 2 are found" in text
    assert "**nothing**" in text


#: A few that take a second or two, one for each check on a status.
QUICK = (
    "nobody is told of a changed line",
    "a stranger's lock is no alarm",
    "mode 5 alone is full",
    "another kind of pack is deeply discharged",
    "out of control is told with advice about cables",
    "a reading is divided by",
    "a restart ends the alarm",
    "charges begin together",
    "a loose plug never latches",
    "runs are one run",
)


@pytest.mark.parametrize("name", QUICK)
def test_a_seed_is_found_where_it_is_looked_for_first(name: str) -> None:
    seed = next(seed for seed in SEEDS if seed.name == name)
    result = search(seed)
    assert result.proof == "environment"
    assert result.by.removeprefix("scene ") in seed.where


def test_the_written_page_has_every_seed() -> None:
    written = PAGE.read_text(encoding="utf-8")
    missing = [seed.name for seed in SEEDS if f"| {seed.name} | {seed.about} |" not in written]
    assert not missing, "make campaign ARGS=seeds"
