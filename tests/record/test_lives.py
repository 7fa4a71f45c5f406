"""Nothing is in the record twice, nothing is lost: few of the lives and cuts of `python -m tests.record.lives`."""

import pytest

from tests.record.cuts import cuts
from tests.record.lives import live


@pytest.mark.parametrize("seed", range(8))
def test_a_life_leaves_the_record_right(seed: int) -> None:
    assert live(seed)["charges"] > 0


def test_a_power_cut_at_any_byte_of_a_write_leaves_the_record_right() -> None:
    assert cuts(163) > 20
