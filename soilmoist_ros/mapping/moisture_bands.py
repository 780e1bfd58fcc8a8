# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From the kriged rate to soil moisture with an interval, kept to what the soil can hold.

The moisture curve is monotone, so quantiles of the rate become quantiles of the moisture: an interval that is
symmetric in the rate is long towards wet soil. The rate is taken as normal with the mean and variance of kriging.
A gamma or log-normal rate of the same mean and variance missed more truths on one side in simulated surveys,
also with five counts a stop (``test/mapping/test_tail_coverage.py``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.sensing import MoistureCurve, soil_limits

Array = NDArray[np.float64]

QUANTILE_SD = 1.6448536269514722
"""Quantile 0.95 of the standard normal distribution."""
ORDERS, _NODES = 5, 24
"""Orders of the expansion of the moisture; nodes of the quadrature over the rate."""
UNITS = {
    "rate": "counts/s", "rate_sd": "counts/s",
    "vwc": "m3/m3", "vwc_sd": "m3/m3", "vwc_p05": "m3/m3", "vwc_p95": "m3/m3",
}  # fmt: skip
"""Unit of each band."""


class Bands(NamedTuple):
    """The bands of a map, of one shape. Bands of moisture are NaN without a curve.

    Each band of moisture lies within the limits of the soil (:func:`soil_limits`). A rate below the pole of the
    curve means saturated soil.

    :param rate: corrected count rate [counts/s]
    :param rate_sd: its kriging standard deviation [counts/s]
    :param vwc: volumetric water content of the rate [m^3/m^3]: near the median of its distribution, since the
        curve keeps medians; the mean would be larger
    :param vwc_sd: its standard deviation, third order (Jakobi et al. 2020), of the part that differs between
        places [m^3/m^3]; at most half of the distance of the limits (Popoviciu 1935)
    :param vwc_p05: quantile 0.05 of the moisture, the uncertainty of the calibration included where it is known
        [m^3/m^3]
    :param vwc_p95: quantile 0.95 likewise [m^3/m^3]
    """

    rate: Array
    rate_sd: Array
    vwc: Array
    vwc_sd: Array
    vwc_p05: Array
    vwc_p95: Array


def make_bands(rate: Array, variance: Array, curve: MoistureCurve | None) -> Bands:
    """All bands of a kriged rate.

    :param rate: rate [counts/s], any shape; NaN stays NaN
    :param variance: its kriging variance [(counts/s)^2]
    :param curve: calibration, if any
    """
    rate_sd = np.sqrt(variance)
    if curve is None:
        none = np.full(rate.shape, np.nan)
        return Bands(rate, rate_sd, none, none, none, none)
    limits = soil_limits(curve.bulk_density_gcm3)
    vwc = possible_moisture(curve, rate)
    # fmin: the expansion has no value below the pole, where nothing is known but the limits.
    half = (limits.saturation - limits.dryness) / 2
    vwc_sd = np.where(np.isnan(rate), np.nan, np.fmin(curve.vwc_and_sd(rate, rate_sd)[1], half))
    common = common_rate_sd(curve, rate)
    away = QUANTILE_SD * (rate_sd if common is None else np.hypot(rate_sd, common))
    return Bands(
        rate, rate_sd, vwc, vwc_sd, possible_moisture(curve, rate + away), possible_moisture(curve, rate - away)
    )


def possible_moisture(curve: MoistureCurve, rate_cps: ArrayLike) -> Array:
    """Moisture of rates, limited to what the soil can hold [m^3/m^3].

    The curve has a pole: without limits, one cell with a slightly low estimate would dominate a mean of the map.
    A rate too low for any moisture counts as saturated soil.

    :param rate_cps: rates, any shape [counts/s]; NaN stays NaN
    """
    rate = np.asarray(rate_cps, float)
    limits = soil_limits(curve.bulk_density_gcm3)
    vwc = np.fmin(curve.vwc(rate), limits.saturation)  # fmin takes the limit where the curve has no value
    return np.where(np.isnan(rate), np.nan, np.maximum(vwc, limits.dryness))


def moisture_terms(curve: MoistureCurve, rate_cps: ArrayLike, rate_sd_cps: ArrayLike) -> Array:
    """Hermite coefficients of the moisture of normal rates; the first one is the expected moisture [m^3/m^3].

    With the coefficients c and d of two rates of correlation r, the covariance of their moistures is the sum over
    k >= 1 of ``c[k] d[k] r^k`` (Mehler's formula): exact for any curve but for the orders left out.

    :param rate_cps: means, shape (n,) [counts/s]; NaN stays NaN
    :param rate_sd_cps: standard deviations, shape (n,) [counts/s]
    :returns: shape (:data:`ORDERS`, n)
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    polynomials = np.polynomial.hermite_e.hermevander(nodes, ORDERS - 1) * (weights / weights.sum())[:, None]
    polynomials /= np.sqrt([math.factorial(order) for order in range(ORDERS)])
    rate, sd = np.asarray(rate_cps, float), np.asarray(rate_sd_cps, float)
    terms = np.zeros((ORDERS, len(rate)))
    for node, factors in zip(nodes.tolist(), polynomials, strict=True):
        terms += np.outer(factors, possible_moisture(curve, rate + node * sd))
    return terms


def common_rate_sd(curve: MoistureCurve, rate: Array) -> Array | None:
    """Standard deviation of the rate that has the effect of an uncertain calibration [counts/s].

    The errors of N0 and bulk density shift all places together. A curve depends on the rate in units of N0, so the
    relative error of N0 acts like that of the rate. Moisture is proportional to the bulk density; its error is
    taken as independent of that of N0.

    :param rate: rates, any shape [counts/s]
    :returns: same shape; ``None`` for a calibration whose standard deviations are unknown
    """
    n0 = curve.n0_sd_cps / curve.n0_cps
    density = curve.bulk_density_sd_gcm3 / curve.bulk_density_gcm3
    if density == 0:
        return rate * n0 if n0 > 0 else None
    of_density = possible_moisture(curve, rate) / np.where(curve.valid(rate), curve.slope(rate), -np.inf)
    return np.hypot(rate * n0, of_density * density)
