# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Symmetric matrices as vectors: half the work for functions of each element, and no memory asked for twice."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Packed:
    """Lower triangles of symmetric matrices of one size, column after column (the packed storage of BLAS).

    :param n: rows

    Attributes
    ----------
    positions : NDArray
        where the elements are in the matrix as one vector, shape (n (n + 1) / 2,)
    diagonal : NDArray
        which of the elements are on the diagonal, shape (n,)
    """

    def __init__(self, n: int) -> None:
        self.n = n
        self.positions, self.diagonal = _positions(n)
        self._memory = np.empty(n * n)

    def pack(self, matrix: Array) -> Array:
        """The lower triangle of a matrix of shape (n, n) in Fortran's order, or of a symmetric one in any."""
        flat = matrix.reshape(-1, order="F" if matrix.flags.f_contiguous else "C")
        return flat.take(self.positions)

    def unpack(self, packed: Array) -> Array:
        """The matrix, in Fortran's order; above the diagonal it is anything. The next call takes its memory."""
        self._memory[self.positions] = packed
        return self._memory.reshape(self.n, self.n, order="F")

    def inner(self, a: Array, b: Array) -> float:
        """Sum of the products of all elements of two matrices."""
        return float(2 * (a @ b) - a[self.diagonal] @ b[self.diagonal])

    def times(self, a: Array, vector: Array) -> Array:
        """Matrix times vector, shape (n,)."""
        from scipy.linalg.blas import dspmv

        return np.asarray(dspmv(self.n, 1.0, a, vector, lower=1))


@lru_cache(maxsize=4)
def _positions(n: int) -> tuple[Indices, Indices]:
    """Positions and diagonal of :class:`Packed`; kept, for many likelihoods are of the same number of places."""
    column, row = np.triu_indices(n)
    found = column * n + row, np.flatnonzero(column == row)
    for indices in found:
        indices.setflags(write=False)
    return found
