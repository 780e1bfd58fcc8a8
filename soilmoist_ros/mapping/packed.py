"""Symmetric matrices as vectors: half the work for functions of each element, and no memory asked for twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
        column, row = np.triu_indices(n)
        self.n = n
        self.positions = column * n + row
        self.diagonal = np.flatnonzero(column == row)
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
