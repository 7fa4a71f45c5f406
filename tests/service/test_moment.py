"""Times of decisions and readings are whole milliseconds."""

from hypothesis import given
from hypothesis import strategies as st

from orchestrator.model.moment import moment
from orchestrator.service.rows import thousandths


@given(st.floats(0, 1e9))
def test_a_moment_is_the_millisecond_rounded_down(t_s: float) -> None:
    at_s = moment(t_s)
    assert t_s - 0.001001 < at_s <= t_s + 1e-6
    assert thousandths(at_s) is not None, "it is written as a whole number"
    assert moment(at_s) == at_s


@given(st.floats(0, 1e9), st.floats(0, 1e6))
def test_moments_never_go_back(t_s: float, later_s: float) -> None:
    assert moment(t_s + later_s) >= moment(t_s)
