# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Errors of a map relative to the truth."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import possible_moisture
from soilmoist_ros.sensing import MoistureCurve

Array = NDArray[np.float64]

_COVERAGE_SD = 1.959964


class MapErrors(NamedTuple):
    """Errors of a map over the cells of a field; NaN before the first map, or without a truth.

    :param mse: mean squared error of the rate [(counts/s)^2]
    :param vwc_rmse: root mean squared error of the moisture [m^3/m^3], estimates kept between 0 and the pore
        volume; NaN without a calibration curve
    :param coverage95: share of the cells whose true rate lies in the 95 % interval
    """

    mse: float = math.nan
    vwc_rmse: float = math.nan
    coverage95: float = math.nan


def map_errors(
    rate_cps: Array,
    rate_sd_cps: Array,
    true_rate_cps: Array,
    curve: MoistureCurve | None,
    true_vwc: Array | None = None,
) -> MapErrors:
    """Errors over the cells of a field.

    :param rate_cps: estimated rate, shape (g,) [counts/s]
    :param rate_sd_cps: standard deviation of the estimate, shape (g,) [counts/s]
    :param true_rate_cps: true rate, shape (g,) [counts/s]
    :param curve: calibration curve, if any
    :param true_vwc: :func:`possible_moisture` of the true rate, if already computed, shape (g,) [m^3/m^3]
    """
    error = rate_cps - true_rate_cps
    covered = float(np.mean(np.abs(error) <= _COVERAGE_SD * rate_sd_cps))
    vwc_rmse = math.nan
    if curve is not None:
        if true_vwc is None:
            true_vwc = possible_moisture(curve, true_rate_cps)
        difference = possible_moisture(curve, rate_cps) - true_vwc
        vwc_rmse = float(np.sqrt(np.mean(difference**2)))
    return MapErrors(float(np.mean(error**2)), vwc_rmse, covered)
