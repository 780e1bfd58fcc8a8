# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Probabilities of counts at least, or at most, so large: Poisson, binomial and chi-square.

Sums of probabilities, from the count outwards: exact to 1e-10, and quick for one record at a time. Importing
``scipy.special`` would take 15 MB of a robot's memory, and the driver needs nothing else of SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable

_NEGLIGIBLE = 1e-17  # share of the sum below which the terms that follow change nothing


def poisson_tails(count: int, mean: float) -> tuple[float, float]:
    """Probabilities that a Poisson count with a mean is at most, and at least, a count >= 0.

    >>> [round(chance, 6) for chance in poisson_tails(2, 3.0)]
    [0.42319, 0.800852]
    """
    if mean <= 0:
        return 1.0, float(count == 0)
    here = math.exp(count * math.log(mean) - mean - math.lgamma(count + 1))
    return _tails(count, mean, here, math.inf, lambda one: mean / one)


def binomial_tails(count: int, total: int, share: float) -> tuple[float, float]:
    """Probabilities that a binomial count of a total is at most, and at least, a count.

    >>> [round(chance, 6) for chance in binomial_tails(2, 4, 0.25)]
    [0.949219, 0.261719]
    """
    if not 0 < share < 1:
        return (1.0, float(count == 0)) if share <= 0 else (float(count == total), 1.0)
    ways = math.lgamma(total + 1) - math.lgamma(count + 1) - math.lgamma(total - count + 1)
    here = math.exp(ways + count * math.log(share) + (total - count) * math.log1p(-share))
    odds = share / (1 - share)
    return _tails(count, total * share, here, total, lambda one: (total - one + 1) / one * odds)


def chi_square_tail(freedom: int, value: float) -> float:
    """Probability that a chi-square variable with some degrees of freedom, at least one, exceeds a value.

    With even degrees it is that of a Poisson count below half of them; with odd ones the sum has steps of one
    half (Abramowitz & Stegun 1964, 26.4.4 and 26.4.5).

    >>> round(chi_square_tail(3, 2.5), 6)
    0.475291
    """
    half = max(value, 0.0) / 2
    if half == 0:
        return 1.0
    beyond = math.erfc(math.sqrt(half)) if freedom % 2 else 0.0
    powers = [freedom / 2 - 1 - step for step in range(freedom // 2)]
    return beyond + math.fsum(math.exp(one * math.log(half) - half - math.lgamma(one + 1)) for one in powers)


def _tails(
    count: int, mean: float, here: float, largest: float, ratio: Callable[[int], float]
) -> tuple[float, float]:
    """Both tails: the shorter one as a sum, the other as what is left.

    :param here: probability of the count itself
    :param ratio: of a count's probability to that of the count before
    """
    rest, term, one = 0.0, here, count
    if count >= mean:
        while term > _NEGLIGIBLE * (here + rest) and one < largest:
            one += 1
            term *= ratio(one)
            rest += term
        return max(1.0 - rest, here), here + rest
    while term > _NEGLIGIBLE * (here + rest) and one > 0:
        term /= ratio(one)
        rest += term
        one -= 1
    return here + rest, max(1.0 - rest, here)
