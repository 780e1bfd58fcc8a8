# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The irrigation dose of the map that a mapper has published, as the sentence that leads the page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import Field, Samples, SoilMap, VariogramFit
from soilmoist_ros.pipeline import make_run
from soilmoist_ros.reporting import dose_sentence
from soilmoist_ros.sensing import CountRecord, Site

LATER = "No dose here: with earlier surveys it is in the report of the run."


def live_dose(
    field: Field,
    cell_m: float | None,
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
