# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Colours, colour maps, and rasters as PNG pictures, without a plotting library: a report takes less time."""

from __future__ import annotations

import base64
import struct
import zlib
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

INK = "#22303c"
SOFT = "#5d6b78"
FAINT = "#d5dbe1"
WATER = "YlGnBu"
RATE = "YlOrBr"
UNCERTAIN = "Purples"
DIFFERENCE = "BrBG"
"""Colour maps that colour-blind readers can distinguish. Each quantity has its own in every report, dark for wet,
for many counts and for uncertain."""
PALEST, DARKEST = 0.06, 0.97
"""Part of a colour map in use: its palest end is invisible on white paper."""
_EVENLY: Final = {
    WATER: "ffffd9 edf8b1 c7e9b4 7fcdbb 41b6c4 1d91c0 225ea8 253494 081d58",
    RATE: "ffffe5 fff7bc fee391 fec44f fe9929 ec7014 cc4c02 993404 662506",
    UNCERTAIN: "fcfbfd efedf5 dadaeb bcbddc 9e9ac8 807dba 6a51a3 54278f 3f007d",
    DIFFERENCE: "543005 8c510a bf812d dfc27d f6e8c3 f5f5f5 c7eae5 80cdc1 35978f 01665e 003c30",
}
"""Evenly spaced colours of each map, by Cynthia Brewer (colorbrewer2.org, Apache-2.0)."""

DRY_TO_WET = np.array(
    [list(bytes.fromhex(text)) for text in ("fdedc4", "dee296", "98cb81", "48ac93", "1d859e", "1a5893", "222a6b")],
    float,
)
"""Colours from dry to wet: light sand over green to deep blue, in even steps of lightness, shape (7, 3)."""


def colour_ramp(name: str, count: int) -> NDArray[np.uint8]:
    """Colours of a map from light to dark, without its palest end; shape (count, 3), red, green and blue.

    >>> colour_ramp("Purples", 2).tolist()
    [[246, 244, 249], [68, 9, 129]]

    :param name: one of the colour maps above; with ``_r`` at its end, from dark to light
    :param count: number of colours, >= 1; a single one is from the middle
    """
    known = np.array([list(bytes.fromhex(text)) for text in _EVENLY[name.removesuffix("_r")].split()], float)
    known = known[::-1] if name.endswith("_r") else known
    return between(known, np.linspace(PALEST, DARKEST, count) if count > 1 else (PALEST + DARKEST) / 2)


def between(colours: Array, places: ArrayLike) -> NDArray[np.uint8]:
    """Colours between evenly spaced ones.

    :param colours: from low to high, shape (k, 3), each part 0 to 255
    :param places: from 0, the first colour, to 1, the last one, shape (n,)
    :returns: shape (n, 3)
    """
    places, at = np.atleast_1d(np.asarray(places, float)), np.linspace(0.0, 1.0, len(colours))
    parts = [np.interp(places, at, part) for part in colours.T]
    return np.asarray(np.rint(np.column_stack(parts)), np.uint8)


def hex_ramp(name: str, count: int) -> list[str]:
    """The colours of :func:`colour_ramp` as text.

    >>> hex_ramp("Purples", 2)
    ['#f6f4f9', '#440981']
    """
    return ["#" + bytes(colour).hex() for colour in colour_ramp(name, count)]


def coloured_png(shares: Array, colours: NDArray[np.uint8]) -> bytes:
    """A PNG with a pixel for each cell; cells without a value are transparent.

    :param shares: places on the colour scale, from 0 to 1, beyond that its ends; NaN without a value; shape
        (ny, nx), the first row at the top
    :param colours: shape (k, 3), k at most 255
    """
    inside = np.isfinite(shares)
    places = np.rint(np.clip(np.where(inside, shares, 0.0), 0.0, 1.0) * (len(colours) - 1))
    return palette_png(np.where(inside, places, len(colours)), colours)


def palette_png(index: Array, colours: NDArray[np.uint8]) -> bytes:
    """A PNG of numbered colours.

    :param index: numbers of colours, k is transparent; shape (ny, nx), the first row at the top
    :param colours: shape (k, 3), k at most 255
    """
    palette = np.vstack([colours, np.zeros((1, 3), np.uint8)])
    lines = np.pad(index.astype(np.uint8), ((0, 0), (1, 0)))  # each line begins with its filter: none
    height, width = index.shape
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in (
            (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)), (b"PLTE", palette.tobytes()),
            (b"tRNS", b"\xff" * len(colours) + b"\x00"), (b"IDAT", zlib.compress(lines.tobytes(), 6)),
            (b"IEND", b""),
        )
    )  # fmt: skip


def robust_range(values: ArrayLike, share: float = 0.95) -> tuple[float, float]:
    """Colour limits around the middle ``share`` of the values.

    A flat map gets limits around its value, so that rounding errors do not look like contrast.
    """
    finite = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = (float(q) for q in np.quantile(finite, (0.5 - share / 2, 0.5 + share / 2)))
    least = max(abs(low), abs(high), 1e-9) * 1e-3
    if high - low < least:
        middle = (low + high) / 2
        low, high = middle - least, middle + least
    return low, high


def data_uri(mime: str, content: bytes) -> str:
    """A file inside a page, such as a picture."""
    return f"data:{mime};base64,{base64.b64encode(content).decode('ascii')}"
