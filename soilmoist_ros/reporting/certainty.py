# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Certainty of the map about a class of moisture: one definition for report, page, summary and exports.

A place is certain of a class if its true value lies in it with a probability of :data:`CERTAIN` or more. A zone is
certain if this share of its area, or more, can be expected to belong to its class: the mean of the probabilities
of its places. These are probabilities given all counts, not p-values, so the number of places does not matter:
the expected share of wrong places is one minus the mean, also where errors of neighbours are alike (Newton et al.
2004, Biostatistics 5:155-176: the false discovery rate of Benjamini & Hochberg from posterior probabilities).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping import common_rate_sd
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.sensing import UNKNOWN_SENSOR, MoistureCurve

Array = NDArray[np.float64]
T = TypeVar("T")

CERTAIN = 0.8
"""Probability from which a place is certain, and expected share of its area from which a zone is."""
CALIBRATION_TAG = "SOILMOIST_CALIBRATION"
"""Tag of GeoTIFFs with one of the words of :func:`calibration_state`."""
ILLUSTRATIVE = "illustrative"
NO_LEVEL = (ILLUSTRATIVE, UNKNOWN_SENSOR)
"""Origins of calibrations that give the pattern of the moisture, but not its level."""


def once_a_run(make: Callable[[MapRun], T]) -> Callable[[MapRun], T]:
    """Decorator of a function of a run whose result is kept with the run, since report and summary want it."""

    @wraps(make)
    def found(run: MapRun) -> T:
        known, name = vars(run), f"_{make.__name__}"
        if name not in known:
            known[name] = make(run)
        result: T = known[name]
        return result

    return found


def calibration_state(calibrated: bool, absolute: bool, simulated: bool, method: str = "cores") -> str:
    """Origin of the calibration.

    It is ``own`` (soil cores of the site), ``general`` (no core of the site), ``combined`` (both),
    ``unknown sensor`` (nearly any level), ``illustrative`` (a guess), ``simulated`` or ``none`` (a rate map).

    :param method: method of the calibration, see :class:`soilmoist_ros.sensing.Calibration`
    """
    if not calibrated or method == UNKNOWN_SENSOR:
        return method if calibrated else "none"
    of_method = "own" if method == "cores" else method
    return ILLUSTRATIVE if not absolute else "simulated" if simulated else of_method


def guess_text(state: str) -> str:
    """Addition to names of a moisture whose level is not known, by the origin of its calibration."""
    return f", {state}" if state in NO_LEVEL else ""


def absolute(run: MapRun) -> bool:
    """True if the map has moistures that limits can be compared with."""
    return run.calibrated and not (run.calibration is not None and run.calibration.illustrative)


def calibration_of(run: MapRun) -> str:
    """Origin of the calibration of a map, see :func:`calibration_state`."""
    method = "cores" if run.calibration is None else run.calibration.method
    return calibration_state(run.calibrated, absolute(run), run.simulated, method)


def class_probability(
    rate: Array, rate_sd: Array, number: ArrayLike, edges: ArrayLike, curve: MoistureCurve | None, relative: bool
) -> Array:
    """Probability that the true value of a place lies in a class; rates are normal.

    :param rate: estimate of each place [counts/s], any shape; without a curve any quantity that is normal
    :param rate_sd: its standard deviation, same shape
    :param number: class of each place, from 0 for the lowest values, same shape or one number; NaN for none
    :param edges: rising limits between the classes: of the moisture [m^3/m^3], without a curve in the unit of
        the rate
    :param curve: calibration; moist soil has low rates
    :param relative: whether the limits are quantiles of this map: an error of the calibration shifts them as well
    :returns: same shape, 0 for places without a class
    """
    from scipy.special import ndtr

    sd, limits = np.asarray(rate_sd, float), np.asarray(edges, float)
    bounds = np.concatenate([[-np.inf], limits, [np.inf]])
    if curve is not None:
        common = None if relative else common_rate_sd(curve, rate)
        sd = sd if common is None else np.hypot(sd, common)
        bounds = np.concatenate([[np.inf], np.asarray(curve.rate_cps(np.maximum(limits, 0.0)), float), [-np.inf]])
    known = np.isfinite(rate) & np.isfinite(np.asarray(number, float))
    own = np.where(known, number, 0).astype(int)
    with np.errstate(invalid="ignore", divide="ignore"):
        inside = np.abs(ndtr((bounds[own + 1] - rate) / sd) - ndtr((bounds[own] - rate) / sd))
    return np.where(known, np.nan_to_num(inside), 0.0)


@dataclass(frozen=True)
class Certainty:
    """Certainty of the map about a zone.

    :param expected: share of its area that can be expected to belong to its class [0..1], NaN if it is empty
    :param sure: share of its area that is certain place by place [0..1], NaN if it is empty
    """

    expected: float
    sure: float

    @property
    def certain(self) -> bool:
        """True if the zone is certain; an empty one is not."""
        return self.expected >= CERTAIN


def certainty(probability: Array) -> Certainty:
    """Certainty of a zone.

    :param probability: probability of its class at each of its places, shape (n,)
    """
    if not probability.size:
        return Certainty(np.nan, np.nan)
    return Certainty(float(probability.mean()), float((probability >= CERTAIN).mean()))
