# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The map as pictures, one pixel a cell, its values at a place, and its irrigation dose in a sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import Field, Samples, VariogramFit
from soilmoist_ros.reporting import DRY_TO_WET, between, palette_png
from soilmoist_ros.sensing import CountRecord, Site

Array = NDArray[np.float64]

_COLOURS: Final = 127
_CERTAIN_TO_NOT: Final = np.array(
    [(247, 244, 249), (221, 199, 226), (201, 148, 199), (206, 76, 152), (160, 20, 90), (90, 0, 60)], float
)
LATER: Final = "No dose here: with earlier surveys it is in the report of the run."


class PageLayer(NamedTuple):
    """A way to show a band of the map, with its colours from low to high, shape (k, 3)."""

    key: str
    colours: Array

    @property
    def factor(self) -> float:
        """Factor from the band to its unit on the page: moisture is in % by volume."""
        return 100.0 if "vwc" in self.key else 1.0


LAYERS: Final = (
    PageLayer("vwc", DRY_TO_WET),
    PageLayer("vwc_sd", _CERTAIN_TO_NOT),
    PageLayer("rate", DRY_TO_WET[::-1]),
    PageLayer("rate_sd", _CERTAIN_TO_NOT),
)


class MapLayers:
    """One map, cut to the field; never changed.

    :param cells: fields x, y and the bands, shape (rows, columns), south first, NaN outside the field
    :param widest: limits of the colours so far, by layer, which are widened here; so a colour keeps its meaning
    """

    def __init__(
        self, cells: NDArray[Any], version: int, widest: dict[str, tuple[float, float]] | None = None
    ) -> None:
        inside = np.isfinite(cells["x"]) & np.isfinite(cells["y"])
        rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
        self.version = version
        self.widest = {} if widest is None else widest
        """Limits of the colours so far, by layer; to be cleared when maps of another field follow."""
        self._pictures: dict[str, bytes] = {}
        if not len(rows):
            self._cells, self._inside = cells[:0, :0], inside[:0, :0]
            return
        part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        self._cells, self._inside = cells[part], inside[part]
        x, y = self._cells["x"][self._inside], self._cells["y"][self._inside]
        west, east, south, north = (float(value) for value in (x.min(), x.max(), y.min(), y.max()))
        steps = max(self._cells.shape) - 1
        self._step_m = max(east - west, north - south) / steps if steps else 1.0
        half = self._step_m / 2
        self._shown = {layer.key: self._limits(layer) for layer in LAYERS if self._has(layer)}
        for key, (low, high) in self._shown.items():
            before = self.widest.get(key, (low, high))
            self._shown[key] = self.widest[key] = min(low, before[0]), max(high, before[1])
        self.extent = [round(edge, 3) for edge in (west - half, east + half, south - half, north + half)]

    @classmethod
    def after(cls, before: MapLayers | None, cells: NDArray[Any]) -> MapLayers:
        """The next version of a map, in limits that only widen; the first one after ``None``."""
        if before is None:
            return cls(cells, 1)
        return cls(cells, before.version + 1, before.widest)

    @property
    def about(self) -> dict[str, Any]:
        """The layers that have values, for JSON; without a map, none."""
        shown = [layer for layer in LAYERS if self._has(layer)]
        return {
            "version": self.version,
            "extent": self.extent if shown else [],
            "layers": [
                {
                    "key": layer.key,
                    "limits": [float(f"{layer.factor * value:.3g}") for value in self._shown[layer.key]],
                    "colours": ["#" + bytes(colour).hex() for colour in layer.colours.astype(np.uint8)],
                    "mean": float(f"{layer.factor * np.nanmean(self._cells[layer.key]):.3g}"),
                }
                for layer in shown
            ],
        }

    def png(self, key: str) -> bytes:
        """Picture of a layer, north up, transparent outside the field; ``KeyError`` if there is no such layer."""
        if key not in self._pictures:
            layer = next((one for one in LAYERS if one.key == key and self._has(one)), None)
            if layer is None:
                raise KeyError(key)
            low, high = self._shown[key]
            values = np.asarray(self._cells[key], float)
            share = np.clip((values - low) / (high - low), 0, 1) if high > low else np.full(values.shape, 0.5)
            palette = between(layer.colours, np.linspace(0, 1, _COLOURS))
            index = np.rint(np.where(np.isfinite(values), share, 0.0) * (_COLOURS - 1))
            index[~np.isfinite(values)] = len(palette)
            self._pictures[key] = palette_png(index[::-1], palette)
        return self._pictures[key]

    def at(self, x_m: float, y_m: float) -> dict[str, float]:
        """Finite values of all bands at a place; nothing outside the field."""
        if not self._cells.size or not (math.isfinite(x_m) and math.isfinite(y_m)):
            return {}
        west, _, south, _ = self.extent
        row, column = math.floor((y_m - south) / self._step_m), math.floor((x_m - west) / self._step_m)
        rows, columns = self._cells.shape
        if not (0 <= row < rows and 0 <= column < columns and self._inside[row, column]):
            return {}
        cell = self._cells[row, column]
        bands = (name for name in cell.dtype.names or () if name not in "xyz")
        return {name: float(f"{cell[name]:.5g}") for name in bands if math.isfinite(cell[name])}

    def _has(self, layer: PageLayer) -> bool:
        return bool(np.isfinite(self._cells[layer.key]).any())

    def _limits(self, layer: PageLayer) -> tuple[float, float]:
        """Quantiles, so that a few outliers have no effect."""
        low, high = np.nanquantile(np.asarray(self._cells[layer.key], float), (0.02, 0.98))
        return float(low), float(high)


def live_dose(
    field: Field,
    cell_m: float,
    cells: NDArray[Any],
    samples: Samples,
    fit: VariogramFit,
    basis: Mapping[str, Any],
    stamp_s: float,
) -> str:
    """The dose of a published map, as its report will have it; without a dose, what is missing.

    :param cell_m: cell size of the map [m]
    :param cells: its cells with rate and standard deviation, shape (ny, nx)
    :param basis: see :meth:`soilmoist_ros.pipeline.FieldSurvey.dose_basis`
    :param stamp_s: end of its last record [s since 1970-01-01 UTC]
    :returns: empty if the map is not of this field
    :raises ValueError: if the basis cannot be read
    """
    from soilmoist_ros.mapping import SoilMap
    from soilmoist_ros.pipeline import make_run  # slow to import, and the page comes first
    from soilmoist_ros.reporting import dose_sentence

    if basis["earlier"]:
        return LATER
    site, (f_pressure, f_humidity) = Site.model_validate(basis["site"]), basis["air"]
    grid = field.grid(cell_m, site.footprint_radius_m)
    if grid.shape != cells.shape or not np.array_equal(grid.mask, np.isfinite(cells["rate"])):
        return ""
    rate, sd = (np.asarray(cells[name], float) for name in ("rate", "rate_sd"))
    soil_map = SoilMap(grid, rate, sd**2, samples, fit.variogram, fit, fit.mean_rate, site.curve, True, None, 0)
    mean = CountRecord(stamp_s, math.nan, math.nan, math.nan, 0, 1.0, 1.0, float(f_pressure), float(f_humidity))
    simulated = bool(basis["simulated"])
    return dose_sentence(
        make_run(soil_map, [mean], site, field.frame, field_name=field.name, settings={}, simulated=simulated)
    )
