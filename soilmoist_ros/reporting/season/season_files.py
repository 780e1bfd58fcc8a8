# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Output folder of a season: page, NetCDF stack, table and summary."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import __version__, csv_text
from soilmoist_ros.mapping import Estimate, FieldChange
from soilmoist_ros.recording import SUMMARY
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE, calibration_state
from soilmoist_ros.reporting.files.strict_json import write_json
from soilmoist_ros.reporting.output_folder import replaced_together
from soilmoist_ros.reporting.season.season import Season, SeasonSurvey
from soilmoist_ros.reporting.season.season_page import write_season_page

if TYPE_CHECKING:
    from scipy.io import netcdf_file

Array = NDArray[np.float64]

NAMES = (SUMMARY, "report.html", "season.nc", "season.csv")
FILL = np.float32(9.96921e36)
"""Value of cells outside the field: the default of NetCDF."""
_MOISTURE = ("vwc", "vwc_sd", "vwc_p05", "vwc_p95", "vwc_change", "vwc_change_sd")
LAYERS = {
    "vwc": ("1", "volumetric water content of the soil"),
    "vwc_sd": ("1", "standard deviation of the volumetric water content"),
    "vwc_p05": ("1", "5 % quantile of the volumetric water content"),
    "vwc_p95": ("1", "95 % quantile of the volumetric water content"),
    "rate": ("s-1", "corrected neutron count rate"),
    "rate_sd": ("s-1", "standard deviation of the corrected neutron count rate"),
    "vwc_change": ("1", "change of the volumetric water content since the survey before"),
    "vwc_change_sd": ("1", "standard deviation of the change of the volumetric water content"),
    "rate_change": ("s-1", "change of the corrected neutron count rate since the survey before"),
    "rate_change_sd": ("s-1", "standard deviation of the change of the corrected neutron count rate"),
    "significant": (
        "1",
        "1 drier, -1 wetter than the survey before, 0 not significant "
        f"(false discovery rate {FieldChange.FALSE_SHARE:g})",
    ),
}
"""Unit and meaning of each variable of the NetCDF file."""


def write_season(folder: Path, season: Season) -> list[Path]:
    """Write ``summary.json``, ``report.html``, ``season.nc`` and ``season.csv``: all are replaced, or none.

    :param folder: output folder; made if missing
    :returns: the paths
    :raises InputError: if the folder cannot be written
    """
    with replaced_together(folder, NAMES) as workshop:
        write_season_page(workshop / "report.html", season)
        write_stack(workshop / "season.nc", season)
        _write_table(workshop / "season.csv", season)
        write_json(workshop / SUMMARY, summary(season))
    return [folder / name for name in NAMES]


def estimate_text(survey: SeasonSurvey) -> str:
    """Mean of a survey with its interval, and the change since the one before, on one line."""
    if survey.mean_vwc is not None:
        text = _text(survey.mean_vwc, 100.0, "% by volume", 1)
        change = survey.change and survey.change.mean_vwc and _text(survey.change.mean_vwc, 100.0, "", 1, True)
    else:
        text = _text(survey.mean_rate, 1.0, "counts/s", 3)
        change = survey.change and _text(survey.change.mean_rate, 1.0, "", 3, True)
    return f"{text}{f', change {change}' if change else ''}"


def _text(estimate: Estimate, factor: float, unit: str, digits: int, sign: bool = False) -> str:
    form = f"{'+' if sign else ''}.{digits}f"
    low, high = (factor * value for value in estimate.interval95)
    return f"{factor * estimate.value:{form}} {unit}".strip() + f" ({low:{form}} to {high:{form}})"


def summary(season: Season) -> dict[str, Any]:
    """The season in numbers, for programs."""
    persistence = season.persistence
    return {
        "schema": 1,
        "software": "soilmoist_ros",
        "version": __version__,
        "kind": "season",
        "title": season.title,
        "field": season.field_name,
        "simulated": season.simulated,
        "calibration": _calibration(season),
        "time_zone": season.time_zone or None,
        "created_utc": f"{season.created_utc:%Y-%m-%dT%H:%M:%SZ}",
        "datum": asdict(season.frame),
        "cell_m": season.grid.cell_m,
        "cells": int(np.count_nonzero(season.grid.mask)),
        "variogram": {
            "model": season.variogram.model,
            "nugget_cps2": season.variogram.nugget,
            "range_m": season.variogram.range_m,
            "sill_cps2": season.variogram.sill,
        },
        "pattern_correlation": persistence.share,
        "pattern_correlation_sd": persistence.sd,
        "pattern_decay_days": persistence.decay_days if math.isfinite(persistence.decay_days) else None,
        "false_discovery_rate": FieldChange.FALSE_SHARE,
        "warnings": list(season.notes),
        "surveys": rows(season),
        "outputs": list(NAMES),
    }


def _calibration(season: Season) -> str:
    return calibration_state(season.curve is not None, not season.illustrative, season.simulated)


def rows(season: Season) -> list[dict[str, Any]]:
    """One row per survey; undefined values are ``None``."""
    about = {"calibration": _calibration(season)}
    return [{**_row(*one), **about} for one in zip(season.labels, season.surveys, strict=True)]


def _row(label: str, survey: SeasonSurvey) -> dict[str, Any]:
    run, change = survey.run, survey.change
    end = datetime.fromtimestamp(run.survey.stamp_s, UTC) if run.date else None
    drier, wetter = change.shares if change else (None, None)
    return {
        "survey": run.survey.name,
        "label": label,
        "end_utc": None if end is None else f"{end:%Y-%m-%dT%H:%M:%SZ}",
        "end_stamp_s": run.survey.stamp_s,
        "records": len(run.records),
        "samples": len(run.survey.samples),
        **_columns("mean_rate_cps", survey.mean_rate),
        **_columns("mean_vwc", survey.mean_vwc),
        **_columns("change_rate_cps", change.mean_rate if change else None),
        **_columns("change_vwc", change.mean_vwc if change else None),
        "drier_share": drier,
        "wetter_share": wetter,
        "remarks": " ".join(run.remarks),
    }


def _columns(name: str, estimate: Estimate | None) -> dict[str, float | None]:
    if estimate is None:
        return dict.fromkeys((name, f"{name}_low95", f"{name}_high95"))
    low, high = estimate.interval95
    return {name: estimate.value, f"{name}_low95": low, f"{name}_high95": high}


def _write_table(path: Path, season: Season) -> None:
    table = rows(season)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(table[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: csv_text(value) for name, value in row.items()} for row in table)


def write_stack(path: Path, season: Season) -> Path:
    """Write all maps as NetCDF-3 by the CF conventions, over (time, y, x) in the field's own plane.

    ``lat`` and ``lon`` have the place of each cell on earth.
    """
    from scipy.io import netcdf_file

    grid = season.grid
    with netcdf_file(path, "w", version=2) as file:
        file.Conventions = "CF-1.8"
        file.title = season.title
        file.calibration = _calibration(season)
        kind = "simulation" if season.simulated else "surface observation"
        file.source = f"{kind}: cosmic-ray neutron counts, joint Poisson kriging by soilmoist_ros {__version__}"
        for name, size in (("time", len(season.surveys)), ("y", grid.y_m.size), ("x", grid.x_m.size)):
            file.createDimension(name, size)
        stamps = np.array([survey.run.survey.stamp_s for survey in season.surveys])
        clock = "" if season.surveys[0].run.date else "; the clock had no date"
        _put(file, "time", stamps, ("time",), standard_name="time", long_name=f"end of the survey{clock}",
             units="seconds since 1970-01-01 00:00:00", calendar="standard", axis="T")  # fmt: skip
        for name, axis in (("x", grid.x_m), ("y", grid.y_m)):
            _put(file, name, axis, (name,), standard_name=f"projection_{name}_coordinate", units="m",
                 axis=name.upper())  # fmt: skip
        across, up = np.meshgrid(grid.x_m, grid.y_m)
        places = season.frame.to_geographic(np.column_stack([across.ravel(), up.ravel()]))
        earthly = (("lat", "latitude", "degrees_north"), ("lon", "longitude", "degrees_east"))
        for (name, standard, unit), values in zip(earthly, places.T, strict=True):
            _put(file, name, values.reshape(across.shape), ("y", "x"), standard_name=standard, units=unit)
        mapping = season.frame.crs.to_cf().items()
        _put(
            file,
            "crs",
            np.int32(0),
            (),
            **{key: one for key, one in mapping if one not in (None, "", "undefined")},
        )
        for name, (unit, meaning) in LAYERS.items():
            if season.curve is None and name in _MOISTURE:
                continue
            if season.illustrative and name in _MOISTURE:
                meaning = f"{meaning}, {ILLUSTRATIVE}"
            stack = np.stack([layer(survey, name) for survey in season.surveys])
            raster = np.where(np.isfinite(stack), stack, FILL).astype(np.float32)
            _put(file, name, raster, ("time", "y", "x"), long_name=meaning, units=unit, grid_mapping="crs",
                 coordinates="lat lon", _FillValue=FILL)  # fmt: skip
    return path


def layer(survey: SeasonSurvey, name: str) -> Array:
    """A raster of a survey by its name in :data:`LAYERS`; NaN where it does not exist."""
    if name in survey.bands._fields:
        return np.asarray(getattr(survey.bands, name), float)
    change = survey.change
    if change is None:
        return np.full(survey.bands.rate.shape, np.nan)
    return np.asarray(getattr(change, name.replace("_change", "")), float)


def _put(file: netcdf_file, name: str, values: Any, dimensions: Sequence[str], **attributes: Any) -> None:
    """A variable with its attributes."""
    array = np.asarray(values)
    variable = file.createVariable(name, array.dtype, tuple(dimensions))
    variable[...] = array
    for key, value in attributes.items():
        setattr(variable, key, value)
