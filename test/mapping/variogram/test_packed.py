# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.mapping.variogram.packed import Packed


def symmetric(n, seed):
    matrix = np.random.default_rng(seed).normal(size=(n, n))
    return matrix + matrix.T


@pytest.mark.parametrize("n", [1, 2, 7])
def test_packed_matrices_do_what_whole_ones_do(n):
    a, b, packed = symmetric(n, 1), symmetric(n, 2), Packed(n)
    vector = np.random.default_rng(3).normal(size=n)
    np.testing.assert_array_equal(packed.pack(a)[packed.diagonal], np.diag(a))
    np.testing.assert_array_equal(np.tril(packed.unpack(packed.pack(a))), np.tril(a))
    assert packed.inner(packed.pack(a), packed.pack(b)) == pytest.approx(np.sum(a * b))
    np.testing.assert_allclose(packed.times(packed.pack(a), vector), a @ vector)


def test_only_the_lower_triangle_counts_in_the_order_of_fortran():
    a, packed = symmetric(5, 1), Packed(5)
    np.testing.assert_array_equal(packed.pack(np.asfortranarray(np.tril(a))), packed.pack(a))
