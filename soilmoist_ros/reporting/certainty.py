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

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.mapping import SoilMap, common_rate_sd, possible_moisture
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
_NODES = 40
"""Equally probable values of the rate, by which errors of the moisture are combined with the curve."""
_LATTICE = (80, 16)
"""Rates and standard deviations between which figures of more places are interpolated, to 0.001 and 0.01 mm."""


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


def has_no_level(run: MapRun) -> bool:
    """True if a map has moistures whose level is a guess, or nearly unknown."""
    return calibration_of(run) in NO_LEVEL


def calibration_of(run: MapRun) -> str:
    """Origin of the calibration of a map, see :func:`calibration_state`."""
    method = "cores" if run.calibration is None else run.calibration.method
    return calibration_state(run.calibrated, absolute(run), run.simulated, method)


@dataclass(frozen=True, eq=False)
class Moistures:
    """Distribution of the moisture at places: the rate is normal, and the curve makes it a moisture.

    :param rate: estimate [counts/s], and its standard deviation ``sd``, shape (n,)
    :param shift: is added to the moisture, as for soil below the sensed depth [m^3/m^3]
    :param table: rising rates, evenly spaced, and their moistures
    """

    rate: Array
    sd: Array
    curve: MoistureCurve
    shift: float
    table: tuple[Array, Array]

    @classmethod
    def of(cls, rate: Array, rate_sd: Array, curve: MoistureCurve, shift: float = 0.0) -> Moistures:
        """Distribution with the errors of counting and mapping (``rate_sd``), and of the calibration."""
        common = common_rate_sd(curve, rate)
        sd = rate_sd if common is None else np.hypot(rate_sd, common)
        reach = 4 * sd.max(initial=1e-9)
        rates = np.linspace(max(rate.min(initial=np.inf) - reach, 0.0), rate.max(initial=0.0) + reach, 4000)
        return cls(rate, sd, curve, shift, (rates, possible_moisture(curve, rates)))

    @cached_property
    def values(self) -> Array:
        """Equally probable moistures of each place, shape (:data:`_NODES`, n)."""
        from scipy.special import ndtri

        nodes = ndtri((np.arange(_NODES) + 0.5) / _NODES)
        nodes /= math.sqrt(float((nodes**2).mean()))
        rates, moistures = self.table
        place = (self.rate + nodes[:, None] * self.sd - rates[0]) * ((len(rates) - 1) / (rates[-1] - rates[0]))
        index = np.clip(place.astype(np.intp), 0, len(rates) - 2)
        return np.asarray(moistures[index] + (place - index) * np.diff(moistures)[index] + self.shift)

    def figure(self, make: Callable[[Moistures], Array], places: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Figure of places, by default all: of each place, or of many places interpolated on a lattice."""
        from scipy.ndimage import map_coordinates

        of_places = self.rate[places], self.sd[places]
        if len(of_places[0]) <= math.prod(_LATTICE):
            return make(replace(self, rate=of_places[0], sd=of_places[1]))
        axes = [np.linspace(one.min(), one.max(), count) for one, count in zip(of_places, _LATTICE, strict=True)]
        rate, sd = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
        at = [(one - axis[0]) / max(axis[1] - axis[0], 1e-12) for one, axis in zip(of_places, axes, strict=True)]
        found = make(replace(self, rate=rate, sd=sd))
        return np.asarray(map_coordinates(found.reshape(_LATTICE), at, order=1, mode="nearest"))

    def below(self, limit: float, sd: float = 0.0) -> Array:
        """Probability of a moisture below a limit, which is uncertain by a standard deviation, shape (n,)."""
        from scipy.special import ndtr

        if (limit <= 0 and sd == 0) or limit == -math.inf:
            return np.zeros(len(self.rate))
        if sd == 0:
            edge = float(self.curve.rate_cps(max(limit - self.shift, 0.0)))
            return np.asarray(ndtr((self.rate - edge) / np.maximum(self.sd, 1e-12)), float)
        return self.figure(lambda one: np.asarray(ndtr((limit - one.values) / sd).mean(axis=0), float))

    def missing(self, full: float, sd: float) -> Array:
        """Mean of the moisture missing to a target, which is uncertain by a standard deviation, shape (n,)."""
        from scipy.special import ndtr

        def mean(one: Moistures) -> Array:
            short = full - one.values
            if sd == 0:
                return np.asarray(np.maximum(short, 0).mean(axis=0))
            z = short / sd
            return np.asarray((short * ndtr(z) + sd * np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi)).mean(axis=0))

        return self.figure(mean)

    def quantiles_missing(self, full: float, sd: float) -> tuple[Array, Array]:
        """Quantiles 0.05 and 0.95 of the missing moisture: one-sided distances of the two errors combined in
        quadrature, shape (n,) each [m^3/m^3].
        """
        middle, away = np.interp(self.rate, *self.table), SoilMap.QUANTILE_SD * self.sd
        dry, wet = (np.interp(self.rate + side * away, *self.table) for side in (1, -1))
        other, short = SoilMap.QUANTILE_SD * sd, full - middle - self.shift
        low, high = short - np.hypot(wet - middle, other), short + np.hypot(middle - dry, other)
        return np.maximum(low, 0), np.maximum(high, 0)


def class_probability(
    rate: Array,
    rate_sd: Array,
    number: ArrayLike,
    edges: ArrayLike,
    curve: MoistureCurve | None,
    relative: bool,
    edge_sds: Sequence[float] = (),
    shift: float = 0.0,
) -> Array:
    """Probability that the true value of a place lies in a class; rates are normal.

    :param rate: estimate of each place [counts/s], any shape; without a curve any quantity that is normal
    :param rate_sd: its standard deviation, same shape
    :param number: class of each place, from 0 for the lowest values, same shape or one number; NaN for none
    :param edges: rising limits between the classes: of the moisture [m^3/m^3], without a curve in the unit of
        the rate
    :param curve: calibration; moist soil has low rates
    :param relative: whether the limits are quantiles of this map: an error of the calibration shifts them as well
    :param edge_sds: standard deviations of the limits minus what is not sensed; exact ones if left out
    :param shift: moisture of the classes minus that of the rate, see :class:`Moistures`
    :returns: same shape, 0 for places without a class
    """
    from scipy.special import ndtr

    limits = np.asarray(edges, float)
    known = np.isfinite(rate) & np.isfinite(np.asarray(number, float)) & np.isfinite(rate_sd)
    of_place, sd = np.asarray(rate, float)[known], np.asarray(rate_sd, float)[known]
    own = np.broadcast_to(number, known.shape)[known].astype(int)
    if curve is None or relative:
        if curve is not None:  # moist soil has low rates
            limits, of_place = -np.asarray(curve.rate_cps(np.maximum(limits, 0.0)), float), -of_place
        below = [ndtr((edge - of_place) / np.maximum(sd, 1e-12)) for edge in limits]
    else:
        moistures = Moistures.of(of_place, sd, curve, shift)
        sds = edge_sds or [0.0] * len(limits)
        below = [moistures.below(edge, sd) for edge, sd in zip(limits.tolist(), sds, strict=True)]
    table = np.array([np.zeros_like(of_place), *below, np.ones_like(of_place)])
    at, found = np.arange(len(own)), np.zeros(known.shape)
    found[known] = np.maximum(table[own + 1, at] - table[own, at], 0.0)
    return found


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
