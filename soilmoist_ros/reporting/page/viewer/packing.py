# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rasters and places as compact text for the page's script."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOTHING = 65535
"""Code of a cell without a value."""
MAX_CELLS = 90_000
"""Cells from which a raster is thinned."""


def thinning(shape: tuple[int, ...]) -> int:
    """Step at which rows and columns are taken so that at most :data:`MAX_CELLS` remain."""
    rows, columns = shape
    step = 1
    while -(-rows // step) * -(-columns // step) > MAX_CELLS:
        step += 1
    return step


def pack(values: Array) -> dict[str, Any]:
    """A raster as 16-bit numbers: value = offset + step * code, row by row from south-west, 65535 for NaN.

    The error is half a step, 1/131 068 of the range.

    :param values: shape (ny, nx)
    """
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    step = (high - low) / (NOTHING - 1) or 1.0
    codes = np.full(values.shape, NOTHING, "<u2")
    codes[finite] = np.round((values[finite] - low) / step).astype("<u2")
    return {"offset": low, "step": step, "data": base64.b64encode(codes.tobytes()).decode("ascii")}


def unpack(packed: dict[str, Any], shape: tuple[int, int]) -> Array:
    """The raster of :func:`pack`."""
    codes = np.frombuffer(base64.b64decode(packed["data"]), "<u2").reshape(shape)
    return np.where(codes == NOTHING, np.nan, packed["offset"] + packed["step"] * codes)


def pack_bits(mask: NDArray[np.bool_]) -> str:
    """A mask, eight cells a byte, row by row from south-west; empty if it is empty."""
    if not mask.any():
        return ""
    return base64.b64encode(np.packbits(mask.ravel(), bitorder="little").tobytes()).decode("ascii")


def unpack_bits(text: str, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """The mask of :func:`pack_bits`."""
    if not text:
        return np.zeros(shape, bool)
    bits = np.unpackbits(np.frombuffer(base64.b64decode(text), np.uint8), bitorder="little")
    return bits[: shape[0] * shape[1]].reshape(shape).astype(bool)


def rounded(xy: Array, digits: int = 1) -> list[list[float]]:
    """Places as short numbers [m]."""
    return [[round(x, digits), round(y, digits)] for x, y in np.asarray(xy, float).tolist()]
