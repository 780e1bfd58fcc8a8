# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The sealed sample of a certificate: places drawn at random before the mission, which anybody can draw again.

The cells of the field are put in order along a Hilbert curve, which keeps neighbours together. The order is cut
into as many equal pieces as places are wanted, and one cell is drawn from each piece: a stratified sample that
is spread over the field, in which each cell has the same known probability (de Gruijter, Brus, Bierkens and
Knotters 2006, Sampling for Natural Resource Monitoring; the order as in Stevens and Olsen 2004, J. Am. Stat.
Assoc. 99:262-278).
"""

from __future__ import annotations

import hashlib
import json
import zlib
from base64 import b64decode, b64encode
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.travel.stop import Stop, stops_xy
from soilmoist_ros.foundation import InputError, read_json
from soilmoist_ros.mapping import FieldGrid

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MIN_PLACES = 5  # the scatter of fewer places is too uncertain
NEAR_CELLS = 0.75  # a cell this near to a stop can be visited [cells]


@dataclass(frozen=True)
class SealedSample:
    """Places of a certificate, with all that is needed to draw them again.

    :param corner: centre of the cell in the south-west corner of the raster, east and north [m]
    :param inside: which cells of the raster lie inside the field: bits row by row, compressed, as base64
    :param cells: number of each drawn cell among the cells inside, in the order of the pieces
    :param stops: stop at each of these cells: the one nearest to it; places of a graph may share one
    :param visitable: share of the cells inside at which there is a stop; the others count as their nearest stop
    """

    seed: int
    dwell_s: float  # shortest time to count at each [s]
    corner: tuple[float, float]
    cell_m: float
    shape: tuple[int, int]  # rows and columns
    inside: str
    cells: tuple[int, ...]
    stops: tuple[Stop, ...]
    visitable: float

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        """Cells of the raster inside the field, shape (rows, columns)."""
        bits = np.unpackbits(np.frombuffer(zlib.decompress(b64decode(self.inside)), np.uint8))
        return bits[: self.shape[0] * self.shape[1]].astype(bool).reshape(self.shape)

    @property
    def cells_xy(self) -> Array:
        """Centres of the drawn cells, shape (k, 2) [m]."""
        row, column = (axis[list(self.cells)] for axis in np.nonzero(self.mask))
        return np.asarray(np.array(self.corner) + self.cell_m * np.column_stack([column, row]))

    @property
    def names(self) -> frozenset[str]:
        """Names of the stops."""
        return frozenset(stop.name for stop in self.stops)

    @cached_property
    def digest(self) -> str:
        """First 16 digits of the SHA-256 of the text: whoever knows them beforehand sees a changed sample."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:16]

    @cached_property
    def text(self) -> str:
        """The sample as JSON."""
        places = [[cell, stop.name, stop.x_m, stop.y_m] for cell, stop in zip(self.cells, self.stops, strict=True)]
        content = {
            "seed": self.seed, "dwell_s": self.dwell_s, "corner_m": self.corner, "cell_m": self.cell_m,
            "shape": self.shape, "inside": self.inside, "visitable": self.visitable, "places": places,
        }  # fmt: skip
        return json.dumps(content, separators=(",", ":"))

    @property
    def is_as_drawn(self) -> bool:
        """True if the seed draws these cells."""
        return self.cells == tuple(drawn(self.mask, len(self.cells), self.seed).tolist())


def drawn(mask: NDArray[np.bool_], count: int, seed: int) -> Indices:
    """Numbers of the drawn cells among the cells inside, shape (count,); the order of the pieces.

    >>> drawn(np.ones((4, 4), bool), 4, seed=1).tolist()
    [5, 9, 10, 3]
    """
    order = np.argsort(hilbert(*np.nonzero(mask)), kind="stable")
    where = (np.arange(count) + np.random.default_rng(seed).random(count)) * len(order) / count
    return np.asarray(order[np.minimum(where.astype(int), len(order) - 1)], np.intp)


def check_places(count: int, robots: int = 1) -> None:
    """Check the number of places of a certificate; 0 is none.

    :raises InputError: if it is too small, or there are several robots
    """
    if 0 < count < MIN_PLACES:
        raise InputError(f"certify: {count} places are too few", f"give at least {MIN_PLACES}; 12 are usual")
    if count and robots > 1:
        raise InputError("certify: a certificate is made by one robot", "let one robot survey, or leave it out")


def hilbert(row: ArrayLike, column: ArrayLike) -> Indices:
    """Positions of cells along a Hilbert curve (Hilbert 1891, Math. Ann. 38:459-460).

    >>> hilbert([0, 1, 1, 0], [0, 0, 1, 1]).tolist()
    [0, 1, 2, 3]
    """
    y, x = np.array(row, np.int64), np.array(column, np.int64)
    levels = int(max(x.max(initial=1), y.max(initial=1))).bit_length()
    found = np.zeros(len(x), np.int64)
    for level in range(levels - 1, -1, -1):
        right, up = (x >> level) & 1, (y >> level) & 1
        found += ((3 * right) ^ up) << (2 * level)
        mirrored = (up == 0) & (right == 1)
        x, y = np.where(mirrored, ~x, x), np.where(mirrored, ~y, y)
        x, y = np.where(up == 0, y, x), np.where(up == 0, x, y)
    return found


def draw_sample(
    grid: FieldGrid, stops: tuple[Stop, ...], reached: NDArray[np.bool_], count: int, dwell_s: float, seed: int
) -> SealedSample:
    """Draw the places of a certificate.

    :param stops: where the robot may measure; ``reached``: those that it can reach, at least one
    """
    from scipy.spatial import cKDTree

    possible = [stop for stop, can in zip(stops, reached, strict=True) if can]
    away_m, nearest = cKDTree(stops_xy(possible)).query(grid.cells)
    cells = drawn(grid.mask, count, seed)
    return SealedSample(
        seed, dwell_s, (float(grid.x_m[0]), float(grid.y_m[0])), grid.cell_m, grid.shape,
        b64encode(zlib.compress(np.packbits(grid.mask).tobytes(), 9)).decode(), tuple(cells.tolist()),
        tuple(possible[number] for number in nearest[cells].tolist()),
        round(float(np.mean(away_m <= NEAR_CELLS * grid.cell_m)), 4),
    )  # fmt: skip


@lru_cache(maxsize=4)
def sample_from_text(text: str) -> SealedSample:
    """The sample that :attr:`SealedSample.text` describes.

    :raises InputError: if the text describes none
    """
    try:
        values = read_json(text)
        places = values.pop("places")
        corner, shape = values.pop("corner_m"), values.pop("shape")
        sample = SealedSample(
            **values, corner=(float(corner[0]), float(corner[1])), shape=(int(shape[0]), int(shape[1])),
            cells=tuple(int(place[0]) for place in places),
            stops=tuple(Stop(str(name), float(x_m), float(y_m)) for _, name, x_m, y_m in places),
        )  # fmt: skip
        if not places or max(sample.cells) >= np.count_nonzero(sample.mask) or min(sample.cells) < 0:
            raise ValueError("a place lies outside the field")
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, zlib.error, OverflowError) as error:
        raise InputError(f"this is not a sealed sample: {error!s:.200}", "restore the file, or replay") from None
    return sample
