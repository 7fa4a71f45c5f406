"""A weighted linear fit of a few figures, and how uncertain its value is. Pure.

Theory of operation. `fitted` finds the value at x = 0 of a quantity that is linear in each x: in time, because
batteries age, in temperature. What is known of the slopes beforehand enters as a normal distribution (a Bayesian, or
ridge, regression): with few figures a slope is hardly believed, and what it might be widens the interval; with many
the figures alone tell. The scatter comes from the figures themselves, and `t95` from how many there are (Student's t).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

#: Two-sided 95 % quantiles of Student's t, by degrees of freedom; between them 1/dof is linear, nearly.
T95 = (
    (1.0, 12.706), (1.5, 6.030), (2.0, 4.303), (3.0, 3.182), (4.0, 2.776), (5.0, 2.571), (6.0, 2.447), (8.0, 2.306),
    (10.0, 2.228), (15.0, 2.131), (20.0, 2.086), (30.0, 2.042), (60.0, 2.000), (120.0, 1.980),
)  # fmt: skip
NORMAL_95 = 1.960
#: The scatter depends on how far the slopes are believed, and the other way round: settled after a few rounds.
ROUNDS = 8

Matrix = list[list[float]]


@dataclass(frozen=True, slots=True)
class Row:
    """One figure: `value` with the standard uncertainty `expected`, if that is right, at the place `x`."""

    value: float
    expected: float
    x: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Fit:
    """The value at x = 0, its standard uncertainty and the degrees of freedom of that."""

    value: float
    uncertainty: float
    dof: float


def fitted(rows: Sequence[Row], priors: Sequence[tuple[float, float]], least_ratio: float) -> Fit | None:
    """The fit; None for too few rows. `priors` has the mean and the deviation of each slope.

    `least_ratio`: the real scatter is not believed to be smaller than this share of the expected one.
    """
    size = len(priors) + 1
    columns = [(1.0, *row.x) for row in rows]
    weights = [row.expected**-2 for row in rows]
    normal = [[_total(weights, columns, i, j) for j in range(size)] for i in range(size)]
    right = [sum(w * x[i] * row.value for w, x, row in zip(weights, columns, rows, strict=True)) for i in range(size)]
    ratio, found = 1.0, None
    for _ in range(ROUNDS):
        pull = [0.0, *(ratio / deviation**2 for _, deviation in priors)]
        inverse = inverted([[normal[i][j] + (pull[i] if i == j else 0.0) for j in range(size)] for i in range(size)])
        given = [right[0], *(right[i] + pull[i] * mean for i, (mean, _) in enumerate(priors, 1))]
        solved = [sum(a * b for a, b in zip(line, given, strict=True)) for line in inverse]
        dof = len(rows) - sum(inverse[i][j] * normal[j][i] for i in range(size) for j in range(size))
        if dof < 1.0:
            return None
        misses = (
            w * (row.value - sum(a * b for a, b in zip(solved, x, strict=True))) ** 2
            for w, x, row in zip(weights, columns, rows, strict=True)
        )
        ratio = max(sum(misses) / dof, least_ratio**2)
        found = Fit(solved[0], math.sqrt(ratio * inverse[0][0]), dof)
    return found


def _total(weights: Sequence[float], columns: Sequence[Sequence[float]], i: int, j: int) -> float:
    return sum(w * x[i] * x[j] for w, x in zip(weights, columns, strict=True))


def inverted(matrix: Matrix) -> Matrix:
    """The inverse of a small positive definite matrix."""
    size = len(matrix)
    lines = [[*line, *(float(i == j) for j in range(size))] for i, line in enumerate(matrix)]
    for at in range(size):
        pivot = lines[at][at]
        lines[at] = [value / pivot for value in lines[at]]
        for other in range(size):
            if other != at:
                factor = lines[other][at]
                lines[other] = [a - factor * b for a, b in zip(lines[other], lines[at], strict=True)]
    return [line[size:] for line in lines]


def t95(dof: float) -> float:
    """How many standard uncertainties hold the true value in 95 of 100 cases."""
    before, before_t = T95[0]
    for after, after_t in T95:
        if dof <= after:
            share = 0.0 if after == before else (1 / dof - 1 / before) / (1 / after - 1 / before)
            return before_t + share * (after_t - before_t)
        before, before_t = after, after_t
    return NORMAL_95 + (before_t - NORMAL_95) * before / dof


def half_width(fit: Fit, common: float) -> float:
    """Half of the 95 % interval; `common` is the standard uncertainty that all rows share.

    The degrees of freedom of the sum are those of Welch and Satterthwaite.
    """
    total = math.hypot(fit.uncertainty, common)
    ratio = total / fit.uncertainty
    return t95(fit.dof * ratio * ratio * ratio * ratio) * total


def within(*bounds: float) -> float:
    """The standard uncertainty of a sum of errors, each of which is within ± its bound in 95 devices of 100."""
    return math.hypot(*bounds) / NORMAL_95
