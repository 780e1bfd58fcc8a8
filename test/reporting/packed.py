# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reads the packed rasters of a page, as its script does."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.page.viewer import NOTHING

Array = NDArray[np.float64]


def unpack(packed: dict[str, Any], shape: tuple[int, int]) -> Array:
    codes = np.frombuffer(base64.b64decode(packed["data"]), "<u2").reshape(shape)
    return np.where(codes == NOTHING, np.nan, packed["offset"] + packed["step"] * codes)


def unpack_bits(text: str, shape: tuple[int, int]) -> NDArray[np.bool_]:
    if not text:
        return np.zeros(shape, bool)
    bits = np.unpackbits(np.frombuffer(base64.b64decode(text), np.uint8), bitorder="little")
    return bits[: shape[0] * shape[1]].reshape(shape).astype(bool)
