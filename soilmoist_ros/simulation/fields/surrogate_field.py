# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A surrogate field: rate and soil moisture are known everywhere; grids that interpolate or extrapolate them."""

from __future__ import annotations

import json
import math
import warnings
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import Field, Variogram
from soilmoist_ros.sensing import Calibration, Irrigation, MoistureCurve, Site, Soil

Array = NDArray[np.float64]
CORES_SD = 0.015
"""Relative standard deviation of N0 by one day of soil cores: 18 profiles where the moisture of profiles has a
standard deviation of 5 % by volume, at 20 % by volume and 1.4 g/cm^3."""
IRRIGATION = {"texture": "loam", "root_depth_mm": 300.0, "depletion": 0.5, "efficiency": 0.8}
"""Irrigation keys of a simulated site: assumptions, to be replaced by a site file."""


@dataclass(frozen=True, eq=False)
class SurrogateField:
    """A field whose truth is known.

    :param truth: corrected rate of the whole sensor [counts/s], shape (n,), at positions of shape (n, 2) [m]
    """

    name: str  # short name, as given to :func:`surrogate_field`
    title: str  # name shown in reports
    field: Field  # plane, boundary, no-go areas and cell size
    truth: Callable[[Array], Array]
    curve: MoistureCurve | None = None  # calibration that links moisture and rate, ``None`` without a calibration
    hours: float = 2.0  # usual mission time [h]
    variogram: Variogram | None = None  # that of the rate, if it is a random field

    @property
    def frame(self) -> LocalFrame:
        """East-north plane about the field's datum."""
        return self.field.frame

    @property
    def polygon(self) -> Array:
        """Boundary, shape (k, 2) [m]."""
        return self.field.polygon

    def rate_at(self, xy_m: ArrayLike) -> Array:
        """True corrected count rate of the whole sensor [counts/s] at positions of shape (n, 2) [m], shape (n,).

        Far beyond the boundary, it is the rate at the nearest known position.
        """
        return self.truth(np.atleast_2d(np.asarray(xy_m, float)))


def write_field_file(field: SurrogateField, path: Path) -> None:
    """Write the field file of a surrogate field, without its truth.

    :raises InputError: if it cannot be written
    """
    _write(path, _yaml(_outline(field)))


def simulated_site(field: SurrogateField, irrigation: Irrigation | None = None) -> Site:
    """Site of a surrogate field as a user would know it: soil, and N0 of one day of soil cores with its ±.

    The error of N0 is a draw that depends on the name of the field alone: one sensor, calibrated once. The counts
    come from the true curve of the field.

    :param irrigation: irrigation keys instead of :data:`IRRIGATION`
    """
    return Site.model_validate(_site(field, irrigation))


def write_site_file(field: SurrogateField, path: Path, irrigation: Irrigation | None = None) -> None:
    """Write the site file of :func:`simulated_site`; without a curve the field has no soil and no calibration.

    :raises InputError: if it cannot be written
    """
    _write(path, _yaml(_site(field, irrigation)))


def _outline(field: SurrogateField) -> dict[str, Any]:
    frame, about = field.frame, field.field
    content: dict[str, Any] = {
        "name": f"{field.title} (simulated)",
        "datum": {"latitude_deg": frame.latitude_deg, "longitude_deg": frame.longitude_deg},
        "polygon": field.polygon.tolist(),
    }
    more = {
        "no_go": [ring.tolist() for ring in about.no_go],
        "cell_m": about.cell_m,
        "covariates": [one.section for one in about.covariates],
    }
    return content | {key: value for key, value in more.items() if value}


def _site(field: SurrogateField, irrigation: Irrigation | None) -> dict[str, Any]:
    corrections = {"humidity": {"method": "linear"}}  # as the simulated weather acts on the counts
    about: dict[str, Any] = {"name": "simulated sensor", "corrections": corrections}
    known = _calibration(field)
    if known:
        true = known["calibration"]["n0_cps"]
        error = CORES_SD * np.random.default_rng(zlib.crc32(field.name.encode())).normal()
        known["calibration"] |= {
            "n0_cps": float(f"{true * (1 + error):.4g}"),
            "n0_sd_cps": float(f"{true * CORES_SD:.2g}"),
            "note": f"one simulated day of soil cores; the true N0 is {true:g} counts/s",
        }
    keys = IRRIGATION if irrigation is None else irrigation.model_dump(exclude_none=True)
    return about | known | {"irrigation": dict(keys)}


def _calibration(field: SurrogateField) -> dict[str, dict[str, Any]]:
    if field.curve is None:
        return {}
    known = {name: value for name, value in field.curve.parameters.items() if value}
    return {
        part: {name: known[name] for name in model.model_fields if name in known}
        for part, model in (("soil", Soil), ("calibration", Calibration))
    }


def _yaml(content: dict[str, Any]) -> str:
    """One key per line; JSON values are YAML as well."""
    return "".join(f"{key}: {json.dumps(value, ensure_ascii=False)}\n" for key, value in content.items())


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"cannot be written: {error.strerror}", "choose a file in a folder that you may write to", path
        ) from None


# A quantity on the nodes of a grid: interpolated, or extrapolated from points by ordinary kriging (PyKrige) -----

MARGIN_M = 10.0  # margin of the grid around the box of the field [m]; robots and footprints may cross the boundary
MAX_NODES = 1_000_000  # maximum number of nodes of a grid; the step is doubled until the grid fits
MAX_POINTS = 1000  # maximum number of points; with more, the dense kriging system of PyKrige takes too long
NUMBERS_AT_ONCE = 4_000_000


class GridExtent(NamedTuple):
    """The box of a field and the resolution of its truth."""

    low: Array  # south-west corner [m], shape (2,)
    high: Array  # north-east corner [m], shape (2,)
    step_m: float  # distance between nodes [m], > 0

    @classmethod
    def of(cls, polygon: Array, cell_m: float) -> GridExtent:
        """Box of a polygon of shape (k, 2) [m], with nodes at half cells: every cell centre is a node."""
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        step = cell_m / 2
        while np.prod((high - low + 2 * MARGIN_M) / step + 2) > MAX_NODES:
            step *= 2
        return cls(low, high, step)

    @property
    def centre(self) -> Array:
        """Middle of the box [m], shape (2,)."""
        return (self.low + self.high) / 2

    def axes(self) -> tuple[Array, Array]:
        """Node coordinates x and y [m]: multiples of the step that cover the box and its margin."""
        first = [math.floor((value - MARGIN_M) / self.step_m) for value in self.low]
        last = [math.ceil((value + MARGIN_M) / self.step_m) for value in self.high]
        x, y = (np.arange(first[axis], last[axis] + 1) * self.step_m for axis in (0, 1))
        return x, y


@dataclass(frozen=True, eq=False)
class RateGrid:
    """Interpolates values on a regular grid: bilinear between nodes, constant beyond the edges.

    :func:`scipy.ndimage.map_coordinates` interpolates a single position five times as fast as
    ``RegularGridInterpolator``, with equal results.
    """

    x_m: Array  # columns, ascending and evenly spaced, shape (nx,), nx >= 2 [m]
    y_m: Array  # rows, ascending and evenly spaced, shape (ny,), ny >= 2 [m]
    values: Array  # finite values on the nodes, shape (ny, nx)

    def __call__(self, xy: Array) -> Array:
        """Values at positions of shape (n, 2) [m], shape (n,)."""
        from scipy.ndimage import map_coordinates

        column = (xy[:, 0] - self.x_m[0]) / (self.x_m[1] - self.x_m[0])
        row = (xy[:, 1] - self.y_m[0]) / (self.y_m[1] - self.y_m[0])
        return np.asarray(map_coordinates(self.values, [row, column], order=1, mode="nearest"))


def kriged_grid(xy: Array, rate_cps: Array, variogram: Variogram, x_m: Array, y_m: Array) -> RateGrid:
    """Point rates extrapolated to the nodes of a grid by ordinary kriging.

    The nugget is treated as noise of the values and filtered. Without a nugget, the surface reproduces the points;
    with a nugget, it passes them smoothly, without spikes.

    :raises ValueError: if there are too few or too many points, the kriging system is ill-conditioned (smooth
        models without a nugget, points close together), or the extrapolated rate is not positive somewhere
    """
    if not 3 <= len(xy) <= MAX_POINTS:
        raise ValueError(f"kriging takes 3 to {MAX_POINTS} points, got {len(xy)}")
    east, north = np.meshgrid(x_m, y_m)
    nodes = np.column_stack([east.ravel(), north.ravel()])
    estimates = _estimate(xy, rate_cps, variogram, np.concatenate([nodes, xy]))
    error = np.abs(estimates[len(nodes) :] - rate_cps).max()
    exact = variogram.nugget > 0 or error <= 1e-4 * np.abs(rate_cps).max()
    if not (exact and np.isfinite(estimates).all()):
        raise ValueError(
            f"the kriging system of {len(xy)} points is ill-conditioned for the {variogram.model} model with "
            f"range {variogram.range_m:g} m and nugget {variogram.nugget:g}"
        )
    rate = estimates[: len(nodes)]
    if rate.min() <= 0:
        x, y = nodes[rate.argmin()]
        raise ValueError(
            f"the extrapolated rate is {rate.min():.3g} counts/s at x = {x:g} m, y = {y:g} m: "
            f"the {variogram.model} model overshoots the points"
        )
    return RateGrid(x_m, y_m, rate.reshape(east.shape))


def _estimate(xy: Array, values: Array, variogram: Variogram, places: Array) -> Array:
    """PyKrige's estimates at positions of shape (m, 2), in blocks that fit into memory; NaN if it fails."""
    from pykrige.ok import OrdinaryKriging
    from scipy.linalg import LinAlgError, LinAlgWarning

    def semivariance(parameters: list[float], distance: Array) -> Array:
        # Include the nugget at distance 0: PyKrige zeroes the diagonal, and the estimate filters the nugget.
        return variogram.nugget + variogram.structured_sill * (1 - variogram.correlation(distance))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LinAlgWarning)  # the caller checks the result
        try:
            kriging = OrdinaryKriging(
                *xy.T, values, "custom", [0.0], variogram_function=semivariance, exact_values=False
            )
            blocks = np.array_split(places, -(-len(places) * (len(xy) + 1) // NUMBERS_AT_ONCE))
            return np.concatenate([np.asarray(kriging.execute("points", *block.T)[0]) for block in blocks])
        except LinAlgError:
            return np.full(len(places), np.nan)
