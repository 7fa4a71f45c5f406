"""The seeds still fit the package they are about, so that the table cannot rot."""

from pathlib import Path

import pytest

from tests.proof.scenes import SCENES
from tests.proof.seed_table import SEEDS, Seed
from tests.proof.seeds import PROOFS, ROOT, Result, apply, page


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
        assert where in SCENES if seed.likely == "environment" else (ROOT / where.partition("::")[0]).exists()


def test_the_page_names_what_nobody_found() -> None:
    text = "\n".join(page([Result(SEEDS[0], "scripts", "seed 7", 3.0, 4.0), Result(SEEDS[1], "", "", 0.0, 100.0)]))
    assert "1 of 2 are found" in text
    assert "**nothing**" in text
