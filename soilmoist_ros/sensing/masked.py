# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Masked arrays of NumPy: their masked values are missing, never numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def floats(values: ArrayLike) -> NDArray[np.float64]:
    """Values as an array; the masked values of a masked array are NaN."""
    if not isinstance(values, np.ma.MaskedArray):
        return np.asarray(values, float)
    found: NDArray[np.float64] = np.array(values, np.float64)
    found[np.ma.getmaskarray(values)] = np.nan
    return found


def require_unmasked(name: str, values: ArrayLike) -> None:
    """Refuse an array with masked values where each value has to be known.

    :raises ValueError: if there are masked values
    """
    number = np.count_nonzero(np.ma.getmaskarray(values)) if isinstance(values, np.ma.MaskedArray) else 0
    if number:
        raise ValueError(f"{name} has {number} masked values: leave these samples out, as by values[~mask]")
