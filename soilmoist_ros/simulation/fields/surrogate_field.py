# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A surrogate field: count rate and soil moisture are known everywhere; its files can be written."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import Field, FieldGrid, Variogram
from soilmoist_ros.sensing import Calibration, MoistureCurve, Soil

Array = NDArray[np.float64]


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
    points_xy: Array | None = None  # positions of the points for a truth from points [m], shape (k, 2)
    points_rate: Array | None = None  # rates at the points [counts/s], shape (k,)
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

    def vwc_at(self, xy_m: ArrayLike) -> Array:
        """True volumetric water content [m^3/m^3] at positions of shape (n, 2) [m], shape (n,).

        :raises ValueError: if the field has no calibration curve
        """
        if self.curve is None:
            raise ValueError(f"the field {self.name!r} has no calibration curve, hence no soil moisture")
        return self.curve.vwc(self.rate_at(xy_m))


def write_field_file(field: SurrogateField, path: Path) -> None:
    """Write the field file of a surrogate field, without its truth.

    :raises InputError: if it cannot be written
    """
    _write(path, _yaml(_outline(field)))


def write_site_file(field: SurrogateField, path: Path, footprint_m: float = 0.0) -> None:
    """Write a site file with the soil and the calibration of a surrogate field, if it has any.

    :raises InputError: if it cannot be written
    """
    about: dict[str, Any] = {"name": "simulated sensor"}
    if footprint_m > 0:
        about["footprint_radius_m"] = footprint_m
    about["corrections"] = {"humidity": {"method": "linear"}}  # as the simulated weather acts on the counts
    known = _calibration(field)
    if known:
        known["calibration"]["note"] = "the calibration that the simulation uses"
    _write(path, _yaml(about | known))


def write_truth_file(field: SurrogateField, grid: FieldGrid, path: Path) -> None:
    """Write the truth as a field file, readable as a surrogate field, and its grid as CSV in the same folder.

    :raises InputError: if the files cannot be written
    """
    table = path.with_suffix(".csv")
    x, y = (axis.ravel() for axis in np.meshgrid(grid.x_m, grid.y_m))
    rate = field.rate_at(np.column_stack([x, y]))
    rows = (f"{east!r},{north!r},{cps!r}\n" for east, north, cps in np.column_stack([x, y, rate]).tolist())
    _write(table, "x_m,y_m,rate_cps\n" + "".join(rows))
    truth = {"grid": table.name, "hours": field.hours, **_calibration(field)}
    _write(path, _yaml({**_outline(field), "truth": truth}))


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
