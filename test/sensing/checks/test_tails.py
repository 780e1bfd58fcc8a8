# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tails of counts are those of SciPy."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.stats import binom, chi2, poisson

from soilmoist_ros.sensing.checks.tails import binomial_tails, chi_square_tail, poisson_tails

CLOSE = {"rel": 1e-9, "abs": 1e-290}
COUNTS = st.integers(0, 20_000)


@given(COUNTS, st.floats(1e-6, 5e4))
@example(0, 0.0)
@example(3, 0.0)
@example(0, 800.0)
@example(20_000, 1.0)
def test_poisson(count, mean):
    assert poisson_tails(count, mean) == (
        pytest.approx(poisson.cdf(count, mean), **CLOSE),
        pytest.approx(poisson.sf(count - 1, mean), **CLOSE),
    )


@given(COUNTS, COUNTS, st.floats(1e-6, 1 - 1e-6) | st.sampled_from([0.0, 1.0]))
def test_binomial(count, rest, share):
    total = count + rest
    assert binomial_tails(count, total, share) == (
        pytest.approx(binom.cdf(count, total, share), **CLOSE),
        pytest.approx(binom.sf(count - 1, total, share), **CLOSE),
    )


@given(st.integers(1, 5000), st.floats(0, 3))
def test_chi_square(freedom, index):
    expected = chi2.sf(freedom * index, freedom)
    assert chi_square_tail(freedom, freedom * index) == pytest.approx(expected, **CLOSE)
    assert math.isfinite(expected)
